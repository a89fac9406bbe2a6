"""`qinit tune`: a choice that is kept, printed, and taken by transfer."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

from tests.conftest import run_here

if TYPE_CHECKING:
    from tests.conftest import Ended, Pipeline

Here = Callable[..., "Ended"]
SHORT = ("--episodes", "40", "--quantile", "0.1,0.9")


@pytest.fixture(scope="module")
def sources(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("tune") / "sources.h5"
    ended = run_here(
        [
            "train-sources",
            "gridworld",
            "--size",
            "6",
            "--variance",
            "2",
            "--tasks",
            "12",
            "--learner",
            "exact",
            "-o",
            str(path),
        ]
    )
    assert ended.code == 0, ended.err
    return path


def test_the_curve_is_printed_and_the_choice_is_taken_by_transfer(here: Here, sources: Path) -> None:
    told = json.loads(here("tune", "logqinit-quantile", sources, *SHORT, "--json").out)
    assert [row["quantile"] for row in told["rows"]] == sorted([0.1, 0.15865525393145707, 0.9])
    [best] = [row for row in told["rows"] if row["chosen"]]
    assert best["average"] == max(row["average"] for row in told["rows"])
    assert told["choice"] == {"quantile": best["quantile"]}
    fit = here("fit", sources).path
    tuned = here(
        "transfer", "logqinit-quantile", fit, "--tasks", "3", "--episodes", "30", "--tuned", told["path"]
    )
    given = here(
        "transfer",
        "logqinit-quantile",
        fit,
        "--tasks",
        "3",
        "--episodes",
        "30",
        "--quantile",
        best["quantile"],
    )
    assert tuned.code == given.code == 0, tuned.err
    assert tuned.out == given.out


def test_the_same_choice_again_is_complete(here: Here, sources: Path) -> None:
    first = json.loads(here("tune", "logqinit-quantile", sources, *SHORT, "--json", "--jobs", "1").out)
    again = here("tune", "logqinit-quantile", sources, *SHORT, "--json", "--jobs", "2")
    assert json.loads(again.out) == first
    other = json.loads(
        here("tune", "logqinit-quantile", sources, *SHORT, "--json", "-o", "other.h5", "--jobs", "2").out
    )
    assert other["digest"] == first["digest"]


def test_the_artefact_is_shown_listed_exported_and_verified(here: Here, sources: Path) -> None:
    path = json.loads(here("tune", "logqinit-quantile", sources, *SHORT, "--json").out)["path"]
    numbers = json.loads(here("show", path, "--json").out)["numbers"]
    assert numbers["sources"] == 12
    assert numbers["candidates"] == 3
    assert "tuning" in here("list", "--kind", "tuning").out
    assert here("verify", path).code == 0
    assert here("export", path, "-o", "averages.csv").code == 0
    header, *lines = Path("averages.csv").read_text().splitlines()
    assert {"task", "candidate", "quantile", "average"} <= set(header.split(","))
    assert len(lines) == 12 * 3


@pytest.mark.parametrize(
    ("arguments", "code", "part"),
    [
        (("logqinit-quantile", "--quantile", "0.1;0.2"), 2, "write numbers with commas"),
        (("logqinit-quantile", "--quantile", "2"), 2, "--quantile is 2.0"),
        (("maxqinit",), 2, "maxqinit"),
    ],
)
def test_what_cannot_be_meant_is_refused(
    arguments: tuple[str, ...], code: int, part: str, here: Here, sources: Path
) -> None:
    method, *options = arguments
    ended = here("tune", method, sources, *options)
    assert ended.code == code
    assert part in ended.err


def test_too_few_sources_are_refused(here: Here, pipeline: Pipeline) -> None:
    ended = here("tune", "ucoi", pipeline.sources)
    assert ended.code == 4
    assert "tune needs at least 10" in ended.err


def test_a_choice_of_another_method_or_distribution_is_refused(
    here: Here, sources: Path, pipeline: Pipeline
) -> None:
    path = json.loads(here("tune", "ucoi", sources, "--episodes", "20", "--kappa", "1", "--json").out)["path"]
    fit = here("fit", sources).path
    wrong = here("transfer", "logqinit-quantile", fit, "--tuned", path)
    assert (wrong.code, "of ucoi, not of logqinit-quantile" in wrong.err) == (4, True)
    both = here("transfer", "ucoi", fit, "--kappa", "3", "--tuned", path)
    assert (both.code, "leave one of them out" in both.err) == (2, True)
    elsewhere = here(
        "train-sources", "gridworld", "--size", "6", "--variance", "1", "--tasks", "4", "--learner", "exact"
    )
    other = here("transfer", "ucoi", here("fit", elsewhere.path).path, "--tuned", path)
    assert (other.code, "tune its own sources" in other.err) == (4, True)
