"""The page on imports works as it stands: an agent's tables in, a start out, its learning curves back in, and what it gained."""

from __future__ import annotations

import csv
import os
import re
import subprocess
import sys
from pathlib import Path

from ready import Ready

PAGE = (Path(__file__).parents[2] / "docs" / "import.md").read_text()


def _block(language: str) -> str:
    [found] = re.findall(rf"^```{language}\n(.*?)^```", PAGE, re.MULTILINE | re.DOTALL)
    return str(found)


def test_an_agent_of_ones_own_gains_what_the_page_says(tmp_path: Path, ready: Ready) -> None:
    (tmp_path / "learner.py").write_text(_block("python"))
    (tmp_path / "bin").mkdir()
    (tmp_path / "bin" / "qinit").symlink_to(ready.qinit)
    (tmp_path / "bin" / "python").write_text(f'#!/bin/sh\nexec {sys.executable} "$@"\n')
    (tmp_path / "bin" / "python").chmod(0o755)
    lines = _block("sh") + "qinit compare - --format csv < runs.txt > compared.csv\n"
    ended = subprocess.run(
        ["bash", "-e", "-c", f"set -o pipefail\n{lines}"],
        cwd=tmp_path,
        env={**os.environ, "PATH": f"{tmp_path / 'bin'}{os.pathsep}{os.environ['PATH']}"},
        capture_output=True,
        text=True,
    )
    assert ended.returncode == 0, ended.stderr
    with (tmp_path / "compared.csv").open() as file:
        rows = {row["method"]: row for row in csv.DictReader(file)}
    for name in ("return", "jumpstart"):
        for method in ("zero", "logqinit-median"):
            assert f"{float(rows[method][name]):.2f}" in PAGE
    assert float(rows["logqinit-median"]["difference_low"]) > 0
