"""The examples work as they stand, with fewer tasks: make comes to rest, shares make the whole, notebooks show a gain."""

from __future__ import annotations

import json
import os
import re
import shutil
import subprocess
from pathlib import Path

import pytest
from ready import Ready

import qinit_cli as qinit

EXAMPLES = Path(__file__).parents[1] / "examples"


@pytest.fixture
def folder(tmp_path: Path, ready: Ready, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A copy of the examples, where qinit is found first."""
    copied = tmp_path / "examples"
    shutil.copytree(EXAMPLES, copied, ignore=shutil.ignore_patterns("__pycache__"))
    monkeypatch.setenv("PATH", f"{ready.folder}{os.pathsep}{os.environ['PATH']}")
    monkeypatch.chdir(copied)
    return copied


def _told(*words: str, **environment: str) -> str:
    ended = subprocess.run(
        words, env=os.environ | environment, capture_output=True, text=True, check=False, timeout=300
    )
    assert ended.returncode == 0, ended.stderr
    return ended.stdout


def test_every_example_is_in_the_readme() -> None:
    named = set(re.findall(r"`([\w-]+(?:\.\w+)?)`", (EXAMPLES / "README.md").read_text()))
    there = {path.name for path in EXAMPLES.iterdir() if path.is_file()}
    assert there - named == {"README.md"}


def test_make_comes_to_rest(folder: Path) -> None:
    make = ("make", "TASKS=4", "EPISODES=20", "METHODS=zero mean")
    _told(*make)
    assert (folder / "comparison.csv").read_text().count("\n") == 3  # a header and two methods
    assert "Nothing to be done" in _told(*make)
    (folder / "sources.h5").touch()
    assert "qinit fit" in _told(*make)  # which finds all of it done
    assert "Nothing to be done" in _told(*make)


def test_a_job_array_makes_what_one_command_makes(folder: Path) -> None:
    script = folder / "slurm-array.sbatch"
    script.write_text(script.read_text().replace("--tasks 50", "--tasks 6 --episodes 100"))
    for job in (1, 2, 3, 4, 0):
        _told("bash", str(script), SLURM_ARRAY_TASK_ID=str(job))
    family = qinit.families.gridworld(size=10, variance=3)
    assert qinit.open("sources.h5").digest == qinit.train_sources(family, tasks=6, episodes=100).digest
    assert qinit.open("run-logqinit-median.h5")["steps"].shape == (6, 200)


@pytest.mark.parametrize("name", ["own_tables", "own_environment"])
def test_a_notebook_shows_what_a_start_gains(
    folder: Path, name: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.syspath_prepend(str(folder))
    cells = json.loads((folder / f"{name}.ipynb").read_text())["cells"]
    names: dict[str, object] = {"__name__": "__main__"}
    for number, cell in enumerate(cells):
        if cell["cell_type"] == "code":
            assert cell["outputs"] == []
            exec(compile("".join(cell["source"]), f"{name}, cell {number}", "exec"), names)
    found = re.findall(
        r"^([\w-]+): mean return (?:over \d+ episodes )?([\d.]+)", capsys.readouterr().out, re.M
    )
    gained = {method: float(value) for method, value in found}
    assert gained["logqinit-median"] > 2 * gained["zero"]
