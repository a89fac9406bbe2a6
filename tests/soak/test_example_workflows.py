"""The examples for Snakemake and DVC, run by these themselves; the second time they find nothing to do."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

pytestmark = pytest.mark.soak

ROOT = Path(__file__).parents[2]
WORKFLOWS = {
    "snakemake": ((("snakemake", "--cores", "2"),), "Nothing to be done"),
    "dvc": ((("dvc", "init", "--quiet", "--no-scm"), ("dvc", "repro")), "up to date"),
}


@pytest.mark.parametrize("name", WORKFLOWS)
def test_a_workflow_comes_to_rest(name: str, tmp_path: Path) -> None:
    commands, rest = WORKFLOWS[name]
    tools, folder = tmp_path / "venv" / "bin", tmp_path / "examples"
    subprocess.run([sys.executable, "-m", "venv", tools.parent], check=True)
    subprocess.run([tools / "python", "-m", "pip", "install", "--quiet", name], check=True)
    shutil.copytree(ROOT / "examples", folder)
    qinit = Path(sys.executable).parent
    environment = os.environ | {"PATH": os.pathsep.join([str(tools), str(qinit), os.environ["PATH"]])}

    def told(*words: str) -> str:
        ended = subprocess.run(
            words, cwd=folder, env=environment, capture_output=True, text=True, check=False
        )
        assert ended.returncode == 0, ended.stdout + ended.stderr
        return ended.stdout + ended.stderr

    for words in commands:
        told(*words)
    assert (folder / "comparison.csv").read_text().count("\n") == 4
    assert (folder / "curves.svg").is_file()
    assert rest in told(*commands[-1])
