"""Tasks that fail: told when they fail, tried again by the same command, and never at the cost of the others."""

from __future__ import annotations

import re
import shlex
import sys
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import pytest

from qinit_cli.pipeline import sources, transfer
from qinit_store.reading import open_artefact

EXACT = ("train-sources", "gridworld", "--size", 4, "--learner", "exact", "--tasks", 8)


@dataclass
class Unreliable:
    """qinit in this process, of which the tasks `bad` cannot be learned; keeps what was tried in the last command."""

    here: Callable[..., Any]
    bad: set[int] = field(default_factory=set)
    tried: list[list[int]] = field(default_factory=list)

    def __call__(self, bad: set[int], *arguments: object) -> Any:
        self.bad, self.tried = bad, []
        sys.argv[:] = ["qinit", *map(str, arguments)]
        return self.here(*arguments)

    def failing(self, learn: Callable[..., Any]) -> Callable[..., Any]:
        def call(*arguments: Any) -> Any:
            ids = arguments[-2].tolist()
            self.tried.append(ids)
            if hit := sorted(self.bad.intersection(ids)):
                raise ValueError(f"no way in {hit[0]}")
            return learn(*arguments)

        return call


@pytest.fixture
def failing(here: Callable[..., Any], monkeypatch: pytest.MonkeyPatch) -> Unreliable:
    """Runs one command line of which some tasks fail: `failing({5}, "train-sources", ...)`."""
    unreliable = Unreliable(here)
    monkeypatch.setattr(sys, "argv", [])
    monkeypatch.setattr(sources, "learn_sources", unreliable.failing(sources.learn_sources))
    monkeypatch.setattr(transfer, "learn_targets", unreliable.failing(transfer.learn_targets))
    return unreliable


def tasks_in(path: Path) -> list[int]:
    with open_artefact(path) as artefact:
        ids: list[int] = artefact.tasks.tolist()
    return ids


def test_a_task_that_fails_is_told_and_the_rest_are_saved(failing: Unreliable, tmp_path: Path) -> None:
    ended = failing({5}, *EXACT, "-o", "a.h5")
    assert (ended.code, ended.out) == (3, "a.h5\n"), ended.err
    assert "task 5 failed, ValueError: no way in 5; alone it is qinit train-sources" in ended.err
    assert ended.err.splitlines()[-1] == "qinit: 1 of 8 tasks failed; the same command tries them again"
    assert "7 tasks learned" in ended.err
    assert "Traceback" not in ended.err
    assert tasks_in(tmp_path / "a.h5") == [0, 1, 2, 3, 4, 6, 7]
    assert [path.name for path in tmp_path.iterdir()] == ["a.h5"]


def test_the_same_command_tries_what_failed_again_and_nothing_else(
    failing: Unreliable, tmp_path: Path
) -> None:
    failing({2, 5}, *EXACT, "-o", "a.h5")
    again = failing({5}, *EXACT, "-o", "a.h5", "--json")
    told = again.json
    assert (again.code, told["skipped"], told["failed"]) == (3, 6, 1)
    assert sorted({task for ids in failing.tried for task in ids}) == [2, 5]
    last = failing(set(), *EXACT, "-o", "a.h5", "--json")
    straight = failing(set(), *EXACT, "-o", "b.h5", "--json")
    assert (last.code, last.json["skipped"]) == (0, 7)
    assert last.json["digest"] == straight.json["digest"]


@pytest.mark.parametrize("where", [(), ("-o", "a.h5")])
def test_the_command_in_the_message_makes_that_task_fail_alone(
    failing: Unreliable, tmp_path: Path, where: tuple[str, ...]
) -> None:
    first = failing({5}, *EXACT, *where)
    made = tmp_path / first.out.strip()
    before, names = made.read_bytes(), sorted(path.name for path in made.parent.iterdir())
    [command] = re.findall(r"alone it is (qinit .*)$", first.err, re.MULTILINE)
    alone = failing({5}, *shlex.split(command)[1:])
    assert (alone.code, alone.out, failing.tried) == (3, "", [[5]])
    assert "task 5 failed, ValueError: no way in 5" in alone.err
    assert made.read_bytes() == before
    assert sorted(path.name for path in made.parent.iterdir()) == names


def test_with_fail_fast_the_first_failure_ends_it_and_what_was_learned_is_kept(
    failing: Unreliable, tmp_path: Path
) -> None:
    words = (*EXACT[:-1], 300, "-o", "a.h5", "--jobs", 1)
    ended = failing({5}, *words, "--fail-fast")
    assert (ended.code, ended.out) == (3, "")
    assert not (tmp_path / "a.h5").exists()
    said = re.search(r"stopped after task .+ failed \(.+\): (\d+) of 300 tasks are saved", ended.err)
    assert said is not None, ended.err
    assert 0 < int(said[1]) < 299
    told = failing(set(), *words, "--json").json
    assert told["skipped"] == int(said[1])
    assert told["digest"] == failing(set(), *words[:-4], "-o", "b.h5", "--json").json["digest"]


def test_when_every_task_fails_nothing_is_made(failing: Unreliable, tmp_path: Path) -> None:
    ended = failing(set(range(8)), *EXACT, "-o", "a.h5")
    assert (ended.code, ended.out) == (3, "")
    assert "0 of 8 tasks are saved" in ended.err
    assert list(tmp_path.iterdir()) == []


def test_a_target_that_fails_leaves_the_others_their_run(
    failing: Unreliable, tmp_path: Path, pipeline: Any
) -> None:
    words = ("transfer", "zero", pipeline.fit, "--tasks", 6, "--episodes", 20, "--json")
    ended = failing({0}, *words, "-o", "a.h5")
    told = ended.json
    assert (ended.code, told["failed"], told["path"]) == (3, 1, "a.h5")
    assert tasks_in(tmp_path / "a.h5") == [1, 2, 3, 4, 5]
    again, straight = failing(set(), *words, "-o", "a.h5"), failing(set(), *words, "-o", "b.h5")
    assert again.json["digest"] == straight.json["digest"]


def test_sources_of_which_some_failed_are_fitted_without_them(failing: Unreliable, tmp_path: Path) -> None:
    failing({1}, *EXACT, "-o", "a.h5")
    ended = failing(set(), "fit", "a.h5", "-o", "fit.h5")
    assert ended.code == 0, ended.err
    with open_artefact(tmp_path / "fit.h5") as fit:
        assert fit.read("library_task").tolist() == [0, 2, 3, 4, 5, 6, 7]
