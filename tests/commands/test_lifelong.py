"""`qinit lifelong`: the paper's loop, frozen or updated, as a run that everything else reads."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

import h5py
import numpy as np
import pytest

if TYPE_CHECKING:
    from pathlib import Path

    from running import Ended, Pipeline

Here = Callable[..., "Ended"]
SHORT = ("--tasks", "4", "--episodes", "60")


def test_a_frozen_lifetime_is_the_run_of_transfer(here: Here, pipeline: Pipeline) -> None:
    lived = here("lifelong", "mean", pipeline.fit, *SHORT, "--store", "own", "--json")
    transferred = here("transfer", "mean", pipeline.fit, *SHORT, "--store", "own", "--json")
    assert lived.code == transferred.code == 0, lived.err
    assert lived.json["digest"] == transferred.json["digest"]
    assert transferred.json["skipped"] == 4


def test_sources_are_fitted_first(here: Here, pipeline: Pipeline) -> None:
    from_sources = here("lifelong", "mean", pipeline.sources, *SHORT, "--update", "--store", "own")
    from_fit = here("lifelong", "mean", pipeline.fit, *SHORT, "--update", "--store", "own", "--json")
    assert from_sources.code == 0, from_sources.err
    assert "fitted: " in from_sources.err
    assert from_fit.json["path"] == from_sources.out.strip()
    assert from_fit.json["skipped"] == 4


def test_an_updated_lifetime_stands_beside_the_frozen_one(here: Here, pipeline: Pipeline) -> None:
    updated = here(
        "lifelong",
        "logqinit-median",
        pipeline.fit,
        *SHORT,
        "--update",
        "--min-visits",
        "5",
        "-o",
        "updated.h5",
    )
    frozen = here("lifelong", "logqinit-median", pipeline.fit, *SHORT, "-o", "frozen.h5")
    assert updated.code == frozen.code == 0, updated.err
    assert "sd(ln Q)" in updated.err
    compared = here("compare", "updated.h5", "frozen.h5", "--baseline", "logqinit-median", "--format", "json")
    rows = {row["method"]: row for row in compared.json["rows"]}
    assert set(rows) == {"logqinit-median", "logqinit-median updated"}
    with h5py.File("updated.h5") as one, h5py.File("frozen.h5") as other:
        np.testing.assert_array_equal(one["steps"][0], other["steps"][0])  # before anything was added
        np.testing.assert_array_equal(one["goal_row"][:], other["goal_row"][:])
        assert one["added"][:].sum() > 0


def test_more_tasks_go_on_from_those_there_and_equal_one_long_life(here: Here, pipeline: Pipeline) -> None:
    arguments = (
        "lifelong",
        "logqinit-median",
        pipeline.fit,
        "--episodes",
        "60",
        "--update",
        "--min-visits",
        "5",
        "--json",
    )
    here(*arguments, "--tasks", "2", "--store", "own")
    grown = here(*arguments, "--tasks", "5", "--store", "own").json
    whole = here(*arguments, "--tasks", "5", "--store", "other").json
    assert grown["skipped"] == 2
    assert grown["digest"] == whole["digest"]


@pytest.mark.parametrize(
    ("arguments", "part"),
    [
        (("ops-tl", "--update"), "ops-tl does not start from mu, sigma or means"),
        (("optimal", "--update"), "optimal does not start from"),
        (("mean", "--min-visits", "9"), "give --update too"),
        (("mean", "--update", "--shard", "1/2"), "leave out --shard"),
    ],
)
def test_what_cannot_be_meant_is_refused(
    arguments: tuple[str, ...], part: str, here: Here, pipeline: Pipeline
) -> None:
    method, *options = arguments
    ended = here("lifelong", method, pipeline.fit, *SHORT, *options)
    assert ended.code == 2
    assert part in ended.err
    assert ended.out == ""


def test_a_plus_variant_moves_its_start_alone(here: Here, pipeline: Pipeline) -> None:
    ended = here(
        "lifelong",
        "ptrs",
        pipeline.fit,
        *SHORT,
        "--init",
        "mean",
        "--update",
        "--min-visits",
        "2",
        "-o",
        "ptrs.h5",
    )
    assert ended.code == 0, ended.err
    with h5py.File("ptrs.h5") as run:
        assert run["potential"].ndim == 2
        assert (run["start"][1:] != run["start"][0]).any()


def test_a_dry_run_makes_nothing(here: Here, pipeline: Pipeline) -> None:
    foreseen = here("lifelong", "mean", pipeline.fit, *SHORT, "--update", "--dry-run", "--store", "own")
    assert foreseen.code == 0, foreseen.err
    assert "would hold 4 tasks" in foreseen.out + foreseen.err
    refused = here("lifelong", "mean", pipeline.sources, *SHORT, "--dry-run", "--store", "own")
    assert refused.code == 2
    assert "qinit fit" in refused.err


@pytest.mark.parametrize(
    "words", [("mean", "--shift", "wind=1"), ("optimal", "--update"), ("mean", "--update", "--shard", "1/2")]
)
def test_what_is_refused_is_refused_before_sources_are_fitted(
    words: tuple[str, ...], here: Here, pipeline: Pipeline, tmp_path: Path
) -> None:
    method, *rest = words
    ended = here("lifelong", method, pipeline.sources, *rest, "--store", "own")
    assert ended.code == 2
    assert not list(tmp_path.rglob("*.h5"))
