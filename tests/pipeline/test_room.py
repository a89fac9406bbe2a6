"""What cannot fit is refused before it begins, with the figure and what to do."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from running import SMALL_SOURCES, Ended, Pipeline

from qinit_cli.pipeline import room
from qinit_cli.pipeline.sources import bin_sizes

GRID = ("gridworld", "--size", "6", "--variance", "2")
BILLION = 1_000_000_000


@pytest.mark.parametrize("more", [(), ("--dry-run",), ("--learner", "exact")])
def test_more_tasks_than_an_artefact_holds_are_refused(
    here: Callable[..., Ended], more: tuple[str, ...]
) -> None:
    ended = here("train-sources", *GRID, "--tasks", BILLION, *more)
    assert (ended.code, ended.out) == (4, "")
    assert "an artefact holds" in ended.err
    assert "fewer --tasks" in ended.err


@pytest.mark.parametrize(
    ("command", "asked"),
    [
        (("transfer", "zero"), ("--episodes", BILLION)),
        (("transfer", "zero"), ("--tasks", BILLION)),
        (("transfer", "drs"), ("--tasks", BILLION, "--dry-run")),
        (("lifelong", "mean"), ("--episodes", BILLION, "--update")),
        (("transfer", "zero"), ("--episodes", 50_000_000, "--evaluate-every", 1)),
    ],
)
def test_targets_that_no_run_could_hold_are_refused_before_one_is_drawn(
    here: Callable[..., Ended], pipeline: Pipeline, command: tuple[str, ...], asked: tuple[object, ...]
) -> None:
    ended = here(*command, pipeline.fit, *asked)
    assert ended.code == 4
    assert "ask for fewer --" in ended.err


def test_too_little_memory_is_said_with_both_figures(
    here: Callable[..., Ended], monkeypatch: pytest.MonkeyPatch
) -> None:
    # of 32 tasks that one thread learns at once: 144 pairs of 8 + 8 + 4 + 8 bytes each, and more
    monkeypatch.setattr(room, "memory_available", lambda: 32 * 144 * 28)
    ended = here("train-sources", *GRID, "--tasks", 40, "--jobs", 1)
    assert ended.code == 7
    assert "of memory, 0.1 MB are available" in ended.err
    assert not list(Path("qinit-store").rglob("*.h5"))


def test_too_small_a_disk_is_said_before_a_task_is_learned(
    here: Callable[..., Ended], monkeypatch: pytest.MonkeyPatch
) -> None:
    # q and td_var alone, which parts keep as they are: 8 tasks of 144 pairs of 16 bytes
    monkeypatch.setattr(
        os, "statvfs", lambda path: SimpleNamespace(f_bavail=8 * 144 * 16, f_frsize=1, f_blocks=10**6)
    )
    ended = here("train-sources", *GRID, "--tasks", 8, "--learner", "exact")
    assert ended.code == 7
    assert "0.0 MB are free" in ended.err


def test_what_is_complete_needs_no_room(
    here: Callable[..., Ended], pipeline: Pipeline, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(room, "memory_available", lambda: 0)
    again = here("train-sources", *SMALL_SOURCES, "--store", pipeline.store)
    assert (again.code, again.path) == (0, pipeline.sources)


def test_memory_of_a_control_group_is_what_is_left_of_it_files_apart(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "memory.max").write_text("1000\n")
    (tmp_path / "memory.current").write_text("900\n")
    (tmp_path / "memory.stat").write_text("anon 600\ninactive_file 250\n")
    monkeypatch.setattr(room, "CGROUP", tmp_path)
    assert room.memory_available() == 350


@pytest.mark.parametrize(("episodes", "bins"), [(1, 1), (7, 3), (101, 100), (12_345, 100)])
def test_bins_hold_the_episodes_that_fall_into_them(episodes: int, bins: int) -> None:
    counted = np.bincount(np.arange(episodes) * bins // episodes, minlength=bins)
    np.testing.assert_array_equal(bin_sizes(episodes, bins), counted)
    assert bin_sizes(10**15, 100).sum() == 10**15


def _refuses(folder: Path) -> os.statvfs_result:
    raise OSError(38, "Function not implemented")


@pytest.mark.parametrize(
    "answer", [_refuses, lambda folder: SimpleNamespace(f_bavail=0, f_frsize=4096, f_blocks=0)]
)
def test_a_file_system_that_does_not_tell_its_free_space_is_written_to(
    answer: Callable[[Path], object],
    here: Callable[..., Ended],
    monkeypatch: pytest.MonkeyPatch,
    tmp_path: Path,
) -> None:
    monkeypatch.setattr(os, "statvfs", answer)
    room.check_disk(room.Footprint(1, 10**6), 10**9, tmp_path / "a.h5")
    assert "free space unknown" in here("doctor", "--store", tmp_path).out
