"""A job in shares, each an artefact of its own, joined into what one run would have made."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from qinit_store.reading import describe, open_artefact

SOURCES = ("train-sources", "gridworld", "--size", 5, "--learner", "exact", "--tasks", 7)


@pytest.fixture
def run(here: Callable[..., Any]) -> Callable[..., Any]:
    """One command line that must succeed; the object it prints with --json."""

    def call(*arguments: object, stdin: str = "") -> dict[str, Any]:
        ended = here(*arguments, "--json", stdin=stdin)
        assert ended.code == 0, ended.err
        told: dict[str, Any] = ended.json
        return told

    return call


def shares_of(run: Callable[..., Any], words: tuple[object, ...], shares: int) -> list[dict[str, Any]]:
    return [run(*words, "--shard", f"{share}/{shares}") for share in range(1, shares + 1)]


def whole_elsewhere(run: Callable[..., Any], *words: object) -> dict[str, Any]:
    """The same in one run, in a store that has no shares to take over."""
    return run(*words, "--store", "elsewhere")


def test_three_shares_of_sources_are_merged_into_what_one_run_makes(run: Callable[..., Any]) -> None:
    shares = shares_of(run, SOURCES, 3)
    assert [share["tasks"] for share in shares] == [3, 2, 2]
    merged = run("merge", *(share["path"] for share in shares))
    whole = whole_elsewhere(run, *SOURCES)
    assert merged["digest"] == whole["digest"]
    assert Path(merged["path"]).name == Path(whole["path"]).name
    again = run(*SOURCES)
    assert (again["path"], again["skipped"]) == (merged["path"], 7), "one run finds it done"


@pytest.mark.parametrize("method", ["zero", "optimal"])
def test_three_shares_of_a_run_are_merged_into_what_one_run_makes(
    run: Callable[..., Any], pipeline: Any, method: str
) -> None:
    words = ("transfer", method, pipeline.fit, "--tasks", 5, "--episodes", 30)
    shares = shares_of(run, words, 3)
    merged = run("merge", "-", stdin="\n".join(share["path"] for share in shares))
    assert merged["digest"] == whole_elsewhere(run, *words)["digest"]
    assert len(describe(Path(merged["path"])).inputs) == 3


def test_the_same_share_again_is_done_and_its_file_is_left_alone(here: Callable[..., Any]) -> None:
    words = (*SOURCES, "--shard", "2/3")
    first = here(*words)
    before = first.path.stat()
    again = here(*words, "--json")
    told = again.json
    assert (again.code, told["tasks"], told["skipped"]) == (0, 2, 2)
    assert "2 tasks: already complete" in again.err
    assert first.path.stat().st_ino == before.st_ino


def test_shares_can_gather_in_one_file(run: Callable[..., Any]) -> None:
    for share, tasks in ((2, [3, 4]), (1, [0, 1, 2, 3, 4]), (3, [*range(7)])):
        told = run(*SOURCES, "--shard", f"{share}/3", "-o", "a.h5")
        with open_artefact(Path("a.h5")) as artefact:
            assert artefact.tasks.tolist() == tasks
    assert told["digest"] == whole_elsewhere(run, *SOURCES)["digest"]


def test_one_run_takes_over_what_shares_in_the_store_have_learned(
    run: Callable[..., Any], here: Callable[..., Any]
) -> None:
    shares_of(run, SOURCES, 3)
    ended = here(*SOURCES, "--json")
    assert ended.json["skipped"] == 7
    assert ended.json["digest"] == whole_elsewhere(run, *SOURCES)["digest"]
    assert "tasks are taken over from" in ended.err


def test_a_missing_share_is_told_and_can_be_added(here: Callable[..., Any], run: Callable[..., Any]) -> None:
    one, two, three = (share["path"] for share in shares_of(run, SOURCES, 3))
    ended = here("merge", one, three)
    assert (ended.code, describe(ended.path).tasks) == (0, 5)
    assert "5 tasks of 2 shares; 2 of 7 are in none of them" in ended.err
    before = ended.path.stat().st_ino
    assert here("merge", one, three).path.stat().st_ino == before
    assert run("merge", one, two, three)["digest"] == whole_elsewhere(run, *SOURCES)["digest"]


def test_more_shares_than_tasks_leave_some_empty(run: Callable[..., Any]) -> None:
    words = (*SOURCES[:-1], 3)
    shares = shares_of(run, words, 5)
    assert [share["tasks"] for share in shares] == [1, 1, 1, 0, 0]
    again = shares_of(run, words, 5)
    assert [(share["tasks"], share["skipped"]) for share in again] == [(1, 1), (1, 1), (1, 1), (0, 0), (0, 0)]
    merged = run("merge", *(share["path"] for share in shares))
    assert merged["digest"] == whole_elsewhere(run, *words)["digest"]


def test_a_trial_of_a_share_tells_of_its_tasks_alone(here: Callable[..., Any]) -> None:
    told = here(*SOURCES, "--shard", "1/3", "--dry-run", "--json").json
    assert (told["tasks"], told["missing"]) == (3, 3)
    made = here(*SOURCES, "--shard", "1/3").path
    assert told["path"] == str(made)
    assert here(*SOURCES, "--shard", "1/3", "--dry-run", "--json").json["missing"] == 0
    assert here(*SOURCES, "--shard", "2/3", "--dry-run", "--json").json["missing"] == 2


def test_shares_of_other_settings_are_refused_and_named(here: Callable[..., Any]) -> None:
    one = here(*SOURCES, "--shard", "1/2").path
    other = here(*SOURCES, "--shard", "2/2", "--seed", 1).path
    ended = here("merge", one, other)
    assert (ended.code, ended.out) == (4, "")
    assert "seed: asked for 0, there is 1" in ended.err


def test_a_damaged_share_is_refused_and_nothing_is_made(here: Callable[..., Any], tmp_path: Path) -> None:
    one, two = (here(*SOURCES, "--shard", f"{share}/2").path for share in (1, 2))
    spoilt = tmp_path / "spoilt.h5"
    shutil.copy(two, spoilt)
    content = bytearray(spoilt.read_bytes())
    content[len(content) // 2 :] = bytes(len(content) - len(content) // 2)
    spoilt.write_bytes(content)
    ended = here("merge", one, spoilt, "-o", "merged.h5")
    assert (ended.code, ended.out) == (6, "")
    assert not (tmp_path / "merged.h5").exists()


@pytest.mark.parametrize("shard", ["0/3", "4/3", "1", "a/b", "1/0"])
def test_what_is_no_share_is_refused(here: Callable[..., Any], shard: str) -> None:
    ended = here(*SOURCES, "--shard", shard)
    assert ended.code == 2
    assert "K/N" in ended.err


def test_a_share_that_is_named_twice_counts_once(here: Callable[..., Any], run: Callable[..., Any]) -> None:
    first, second = (share["path"] for share in shares_of(run, SOURCES, 2))
    ended = here("merge", first, Path(first).absolute(), second)
    assert ended.code == 0
    twice, summary = ended.err.splitlines()
    assert "is named twice and counts once" in twice
    assert summary == "7 tasks of 2 shares"


def test_the_whole_never_replaces_a_share(here: Callable[..., Any], run: Callable[..., Any]) -> None:
    first, second = (Path(share["path"]) for share in shares_of(run, SOURCES, 2))
    whole = first.with_name(first.name.replace("-share-1-of-2", ""))
    shutil.copy(first, whole)  # has the name that the whole would get
    refused = here("merge", second, whole, "--force")
    assert (refused.code, refused.out) == (2, "")
    assert whole.read_bytes() == first.read_bytes()
