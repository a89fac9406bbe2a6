"""The page on the ways out works as it stands."""

from __future__ import annotations

import os
import re
import subprocess
from pathlib import Path

import numpy as np
import pytest
from ready import Ready

PAGE = (Path(__file__).parents[2] / "docs" / "export.md").read_text()


def _blocks(language: str) -> list[str]:
    return re.findall(rf"^```{language}\n(.*?)^```", PAGE, re.MULTILINE | re.DOTALL)


def test_the_page_works_as_it_stands(tmp_path: Path, ready: Ready, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    ended = subprocess.run(
        ["bash", "-e", "-c", "set -o pipefail\n" + "\n".join(_blocks("sh"))],
        env={**os.environ, "PATH": f"{ready.folder}{os.pathsep}{os.environ['PATH']}"},
        capture_output=True,
        text=True,
    )
    assert ended.returncode == 0, ended.stderr
    for block in _blocks("python"):
        exec(block, {})
    with np.load("scores.npz") as scores:
        shapes = {name: scores[name].shape for name in scores.files}
    assert shapes == {"mean": (3, 12), "logqinit-median": (3, 12), "zero": (1, 12)}
