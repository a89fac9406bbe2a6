"""`qinit study status`: states by hand, the run that keeps its progress, living, dead or elsewhere, and what failed."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

TEXT = """\
[[distribution]]
family = "gridworld"
size = 5
variance = 2
sources = { tasks = 4, episodes = 60 }
targets = { tasks = 3, episodes = 20 }

[[method]]
name = ["zero", "mean"]
"""
LABEL = "gridworld-5-variance-2 seed 0"
Here = Callable[..., Any]


@pytest.fixture
def file(tmp_path: Path) -> Path:
    (tmp_path / "s.toml").write_text(TEXT)
    return tmp_path / "s.toml"


def _states(here: Here, file: Path, *more: object) -> dict[str, tuple[str, str | None]]:
    told = here("study", "status", file, "--artefacts", "--json", *more).json
    assert told["schema"] == "qinit.study-status-artefacts/1"
    return {one["name"].split()[0]: (one["state"], one["path"]) for one in told["rows"]}


def _progress(folder: Path, **changed: Any) -> None:
    folder.mkdir(exist_ok=True)
    told = {
        "schema": "qinit.study-progress/1",
        "pid": os.getpid(),
        "host": os.uname().nodename,
        "updated": time.time() - 600,  # shown to 0.1 min: some seconds pass before it is looked at
        "running": 50.0,
        "begun": 3,
        "of": 12,
        "under_way": [{"what": f"mean {LABEL}", "share": 0.25}],
        "left": 1200.0,
    }
    (folder / "progress.json").write_text(json.dumps(told | changed))


def test_an_artefact_is_missing_unfinished_or_complete_and_others_wait_for_it(here: Here, file: Path) -> None:
    states = _states(here, file)
    waits = (f"waits for sources {LABEL}", None)
    assert states["sources"][0] == "missing"
    assert (states["fit"], states["mean"]) == (waits, (f"waits for fit {LABEL}", None))

    target = file.parent / str(states["sources"][1])
    work = target.with_name(f".{target.name}.work")
    work.mkdir(parents=True)
    for first, count in ((0, 1), (2, 2)):  # tasks 0, 2 and 3
        (work / f"part-{first:012}-{count}-0123456789abcdef.h5").touch()
    assert _states(here, file)["sources"] == ("3 of 4 tasks", states["sources"][1])
    rows = here("study", "status", file).out.splitlines()
    assert rows == [
        "stage\tartefacts\tcomplete\tunfinished\tmissing\ttasks_saved",
        "sources\t1\t0\t1\t0\t3",
        "fits\t1\t0\t0\t1\t0",
        "runs\t2\t0\t0\t2\t0",
    ]
    for part in work.iterdir():
        part.unlink()

    options = ("--size", 5, "--variance", 2, "--tasks", 4, "--episodes", 60)
    sources = here("train-sources", "gridworld", *options, "-q").out.strip()
    states = _states(here, file)
    assert (states["sources"], states["fit"]) == (("complete", sources), ("missing", None))
    fit = here("fit", sources, "-q").out.strip()
    run = here("transfer", "mean", fit, "--tasks", 3, "--episodes", 20, "-q").out.strip()
    states = _states(here, file)
    assert (states["fit"], states["mean"]) == (("complete", fit), ("complete", run))
    assert states["zero"][0] == "missing"
    told = here("study", "status", file, "--json").json
    assert (told["schema"], told["complete"], told["run"], told["failed"]) == (
        "qinit.study-status/1",
        False,
        None,
        [],
    )
    assert [row["complete"] for row in told["rows"]] == [1, 1, 1]

    # damage in a task of the sources: looking does not read it, whoever fits them does
    content = bytearray(Path(file.parent / sources).read_bytes())
    marks = _middle_of_tasks(file.parent / sources)
    content[marks] ^= 0xFF
    Path(file.parent / sources).write_bytes(bytes(content))
    (file.parent / fit).unlink()
    assert _states(here, file)["fit"] == ("missing", None)
    ended = here("study", "run", file, "-o", "out", "-q")
    assert ended.code == 3
    manifest = json.loads((file.parent / "out" / "study.json").read_text())
    assert manifest["failed"][0]["name"] == f"fit {LABEL}"
    assert "damaged" in manifest["failed"][0]["problem"]
    again = here("study", "status", file, "-o", "out")
    assert f"failed in the last run: fit {LABEL}: " in again.err
    assert "; alone it is qinit fit " in again.err
    assert here("study", "status", file, "-o", "out", "--json").json["failed"] == manifest["failed"]


def _middle_of_tasks(path: Path) -> int:
    """The place, in the file, of a byte in the middle of the first block of Q."""
    import h5py

    with h5py.File(path) as opened:
        block = opened["q"].id.get_chunk_info(0)
        return int(block.byte_offset + block.size // 2)


def test_a_living_run_is_told_with_what_is_under_way_and_the_time_left(here: Here, file: Path) -> None:
    assert "no run is at work" in here("study", "status", file).err
    _progress(file.parent / "s-results")
    told = here("study", "status", file)
    assert "3 of 12 begun, under way: mean gridworld-5-variance-2 seed 0 (25%)" in told.err
    assert "about 10.0 min left" in told.err
    assert f"process {os.getpid()}, updated 10.0 min ago" in told.err
    run = here("study", "status", file, "--json").json["run"]
    assert (run["alive"], run["begun"], run["of"]) == (True, 3, 12)
    assert run["under_way"] == [{"what": f"mean {LABEL}", "share": 0.25}]
    assert 580 < run["left"] <= 600


def test_a_run_that_was_killed_is_not_at_work(here: Here, file: Path) -> None:
    with subprocess.Popen([sys.executable, "-c", ""]) as ended:
        ended.wait()
    _progress(file.parent / "out", pid=ended.pid)
    told = here("study", "status", file, "-o", "out")
    assert f"no run is at work: process {ended.pid} ended, at most 10.0 min ago" in told.err
    assert here("study", "status", file, "-o", "out", "--json").json["run"]["alive"] is False


def test_of_a_run_on_another_machine_its_last_word_is_told(here: Here, file: Path) -> None:
    _progress(file.parent / "out", host="elsewhere")
    assert (
        f"process {os.getpid()} on elsewhere, updated 10.0 min ago"
        in here("study", "status", file, "-o", "out").err
    )
    assert here("study", "status", file, "-o", "out", "--json").json["run"]["alive"] is None


def test_a_progress_that_is_none_and_another_study_are_refused(here: Here, file: Path) -> None:
    _progress(file.parent / "out", schema="other/1")
    ended = here("study", "status", file, "-o", "out")
    assert (ended.code, ended.out) == (4, "")
    assert "out/progress.json is no progress of a study" in ended.err
    (file.parent / "out" / "progress.json").unlink()
    other = {"schema": "qinit.study/1", "study": "other.toml"}
    (file.parent / "out" / "study.json").write_text(json.dumps(other))
    ended = here("study", "status", file, "-o", "out")
    assert (ended.code, ended.out) == (4, "")
    assert "out holds the study other.toml, not s.toml" in ended.err
