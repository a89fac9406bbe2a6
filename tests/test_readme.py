"""The README's commands are executed as they stand there; a stand-in for qinit makes the tasks small, and nothing else."""

from __future__ import annotations

import contextlib
import os
import re
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
from ready import Ready

README = Path(__file__).parents[1] / "README.md"
TINY = Path(__file__).parent / "commands" / "reproduce" / "tiny.py"
PICTURE_BYTES = 5_000

# what a command asks for itself comes later on its line, and wins
STAND_IN = """#!/bin/sh
case "$1 $2 $*" in
    "train-sources gym"*Acrobot*) set -- "$@" --tasks 1 --episodes 3 --horizon 50;;
    "train-sources gym"*CartPole*) set -- "$@" --tasks 3 --episodes 100;;
    "train-sources gridworld"*--map*) ;;
    "train-sources continuous-gridworld"*) set -- "$@" --tasks 2 --episodes 100 --bins 5;;
    "train-sources puddle-world"*) set -- "$@" --tasks 4 --episodes 100 --bins 5;;
    "train-sources cart-pole"*) set -- "$@" --tasks 2 --episodes 500 --bins 1,4,6,4 --horizon 30;;
    "train-sources acrobot"*) set -- "$@" --tasks 2 --episodes 20 --bins 3;;
    "train-sources "*gridworld*exact*) family=$2; shift 2; set -- train-sources $family --size 6 "$@";;
    "train-sources "*gridworld*) family=$2; shift 2; set -- train-sources $family --size 6 --tasks 4 --episodes 200 "$@";;
    "train-sources mountain-car"*) shift 2; set -- train-sources mountain-car --tasks 2 --episodes 100 "$@";;
    "study run study.toml"*)
        sed -i -e 's/^size = .*/size = 5/' -e 's/^sets = .*/sets = 1/' -e 's/^episodes = .*/episodes = 50/' \\
            -e 's/^tasks = .*/tasks = 10/' study.toml;;
    reproduce*) exec {tiny} "$@" --scale quick;;
    transfer*-h) ;;
    transfer*) method=$2; shift 2; set -- transfer "$method" --tasks 4 --episodes 40 "$@";;
esac
exec {qinit} "$@"
"""


def _blocks(language: str, page: Path = README) -> list[str]:
    return re.findall(rf"^```{language}\n(.*?)^```", page.read_text(), re.MULTILINE | re.DOTALL)


def _run(
    blocks: list[str], folder: Path, found_first: Path, ready: Ready
) -> subprocess.CompletedProcess[str]:
    ready.stand_in(found_first / "tiny", str(TINY))
    smaller = found_first / "qinit"
    smaller.write_text(STAND_IN.format(qinit=ready.qinit, tiny=found_first / "tiny"))
    smaller.chmod(0o755)
    python = found_first / "python"  # whichever the surroundings have, this one has numpy
    python.write_text(f'#!/bin/sh\nexec "{sys.executable}" "$@"\n')
    python.chmod(0o755)
    return subprocess.run(
        ["bash", "-e", "-c", "set -o pipefail\n" + "\n".join(blocks)],
        cwd=folder,
        env={**os.environ, "PATH": f"{found_first}{os.pathsep}{os.environ['PATH']}", "COLUMNS": "100"},
        capture_output=True,
        text=True,
        timeout=1200,
    )


def test_every_command_of_the_page_on_gymnasium_works(tmp_path: Path, ready: Ready) -> None:
    blocks = _blocks("sh", README.parent / "docs" / "gymnasium.md")
    (tmp_path / "bin").mkdir()
    ended = _run(blocks, tmp_path, tmp_path / "bin", ready)
    assert ended.returncode == 0, ended.stderr
    assert ended.stdout.count("logqinit-median") == 2  # a comparison of each environment
    pictures = {path.name for path in tmp_path.glob("*.png") if path.stat().st_size > PICTURE_BYTES}
    assert pictures == {"lake.png", "ice.png"}


def test_every_command_of_the_page_on_tasks_works(tmp_path: Path, ready: Ready) -> None:
    page = README.parent / "docs" / "tasks.md"
    (tmp_path / "bin").mkdir()
    ended = _run([*_blocks("sh", page)], tmp_path, tmp_path / "bin", ready)
    assert ended.returncode == 0, ended.stderr
    assert ended.stdout.count("tasks-mdps-5-folds-reward-native, 5 source sets, 4 targets of each") == 2
    assert ended.stdout.count("gym-FrozenLake-v1-use-0-4-") == 1
    [block] = _blocks("python", page)
    there: dict[str, Any] = {}
    with contextlib.chdir(tmp_path):
        exec(block, there)  # in this process: importing everything would take longer
    assert there["run"]["file_task"].tolist() == [14, 15, 16, 17, 18, 19]
    assert there["lakes"]["file_task"].tolist() == [0, 1, 2, 3]
    assert {row["sets"] for row in there["rows"]} == {5}


def test_every_command_of_the_page_on_continuous_environments_works(tmp_path: Path, ready: Ready) -> None:
    blocks = _blocks("sh", README.parent / "docs" / "continuous.md")
    (tmp_path / "bin").mkdir()
    ended = _run(blocks, tmp_path, tmp_path / "bin", ready)
    assert ended.returncode == 0, ended.stderr
    assert "square-fit.h5" in ended.stdout


def test_every_command_of_the_page_on_sensitivity_works(tmp_path: Path, ready: Ready) -> None:
    blocks = _blocks("sh", README.parent / "docs" / "sensitivity.md")
    (tmp_path / "bin").mkdir()
    ended = _run(blocks, tmp_path, tmp_path / "bin", ready)
    assert ended.returncode == 0, ended.stderr
    assert "interactions\t" in ended.stdout
    assert len((tmp_path / "variance.csv").read_text().splitlines()) == 1 + 3 * 3 * 2
    pictures = {path.name for path in tmp_path.glob("*.png") if path.stat().st_size > PICTURE_BYTES}
    assert pictures == {"sensitivity.png", "grid.png", "ranks.png"}


def test_every_command_of_the_page_on_studies_works(tmp_path: Path, ready: Ready) -> None:
    blocks = _blocks("sh", README.parent / "docs" / "studies.md")
    (tmp_path / "bin").mkdir()
    ended = _run(blocks, tmp_path, tmp_path / "bin", ready)
    assert ended.returncode == 0, ended.stderr
    assert ended.stdout.splitlines() == ["sources.toml", "results", "results"]
    assert "study.toml: already complete" in ended.stderr
    there = {path.name for path in (tmp_path / "results").iterdir()}
    assert {"report.html", "study.json", "shares.json", "compare.csv", "curves.png", "curves.svg"} <= there


def test_the_readme_shows_commands() -> None:
    commands = "\n".join(_blocks("sh"))
    for stage in ("train-sources", "fit", "transfer", "compare", "plot", "list"):
        assert f"qinit {stage}" in commands


def test_the_readme_works_as_it_stands(tmp_path_factory: pytest.TempPathFactory, ready: Ready) -> None:
    # one test: two would be two workers' work, and each would run every command
    folder = tmp_path_factory.mktemp("readme")
    ended = _run(_blocks("sh"), folder, tmp_path_factory.mktemp("bin"), ready)
    assert ended.returncode == 0, ended.stderr
    assert "logqinit-median" in ended.stdout
    pictures = {path.name for path in folder.glob("*.png") if path.stat().st_size > PICTURE_BYTES}
    assert {name for block in _blocks("sh") for name in re.findall(r"\S+\.png", block)} == pictures
    assert pictures
    for block in _blocks("python"):
        shown = subprocess.run(
            [sys.executable, "-c", block], cwd=folder, capture_output=True, text=True, timeout=600
        )
        assert shown.returncode == 0, shown.stderr
        assert shown.stdout.strip()


def test_every_exit_code_of_the_contract_is_explained() -> None:
    text = README.read_text()
    table = text[text.index("## Exit codes") :]
    for code in (*range(8), 130, 141, 143):
        assert re.search(rf"^\|[^|]*\b{code}\b", table, re.MULTILINE), code
