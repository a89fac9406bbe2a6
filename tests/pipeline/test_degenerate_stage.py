"""Settings that leave nothing to learn are said to, and none of their numbers is made up."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from qinit_cli.commands.train_sources import _told
from qinit_cli.learners.exploration import Boltzmann
from qinit_cli.learners.one_step import DoubleQ
from qinit_cli.learners.optimistic import DelayedQ, RMax
from qinit_cli.learning import Learning
from qinit_cli.pipeline.degenerate import SourcesLearned, TargetsLearned, of_fit, of_sources, of_targets
from qinit_cli.pipeline.source_findings import LearnedSources
from qinit_cli.schedules import Linear

LEARNING = Learning(alpha=0.1, gamma=0.95, epsilon=0.5, episodes=100, horizon=50, start="fixed")
SOUND = SourcesLearned(
    tasks=10, positive=10, solvable=10, solved=9, least=0.01, largest=1.0, steps=1e4, error=0.02
)
TARGETS = TargetsLearned(tasks=5, reached=100, unsolvable=0, steps=1e4, knows=True)


def sources(learner: str = "q-learning", learning: dict[str, Any] | None = None, **found: Any) -> list[str]:
    return list(of_sources(learner, replace(LEARNING, **(learning or {})), replace(SOUND, **found)))


def targets(learning: dict[str, Any] | None = None, **found: Any) -> list[str]:
    return list(of_targets(replace(LEARNING, **(learning or {})), replace(TARGETS, **found)))


def test_nothing_is_said_of_what_was_learned() -> None:
    assert sources() == sources("exact") == targets() == []


@pytest.mark.parametrize(
    ("learner", "learning", "found", "told"),
    [
        ("q-learning", {}, {"positive": 0}, "no source met the goal in 100 episodes of --horizon 50"),
        ("q-learning", {}, {"positive": 0}, "or --start anywhere"),
        (
            "q-learning",
            {},
            {"positive": 0, "anywhere": False},
            "ask for more --episodes or a longer --horizon",
        ),
        ("exact", {}, {"positive": 0}, "no way leads to the goal in any task: all values are 0"),
        ("q-learning", {}, {"positive": 7}, "3 of 10 sources never met the goal"),
        (
            "exact",
            {"gamma": 1.0},
            {"least": 1.0},
            "with --gamma 1 nothing is discounted, and all values above 0 are 1",
        ),
        (
            "q-learning",
            {"gamma": 1.0},
            {},
            "with --gamma 1 a value is the probability of reaching the goal at all",
        ),
        ("exact", {}, {"least": 0.9999}, "all values above 0 are 1: they tell no state"),
        ("exact", {"horizon": 1}, {"solvable": 0, "solved": 0}, "from its target start within --horizon 1"),
        ("q-learning", {}, {"solved": 0}, "no source is solved"),
        (
            "q-learning",
            {"alpha": 1e-9},
            {},
            "with --alpha 1e-09 the 10,000 steps of a task move a value by no more than 1e-05",
        ),
        ("q-learning", {"alpha": 1.0}, {}, "with --alpha 1 a value is its last sample"),
        ("q-learning", {"epsilon": 0.0}, {}, "with --epsilon 0 a source explores only"),
        ("q-learning", {}, {"error": 0.9}, "far from learned, by 90% in the median"),
    ],
)
def test_sources_that_teach_nothing_are_warned_of(
    learner: str, learning: dict[str, Any], found: dict[str, Any], told: str
) -> None:
    import re

    assert any(re.search(told, warning) for warning in sources(learner, learning, **found))


@pytest.mark.parametrize(
    ("learning", "found", "told"),
    [
        ({}, {"reached": 0}, "no target reached the goal in any episode: all returns are 0"),
        ({"horizon": 1}, {"reached": 0, "unsolvable": 5}, "in any episode, as none can within --horizon 1:"),
        ({"gamma": 1.0}, {}, "it is the share of success"),
        ({"epsilon": 1.0}, {}, "with --epsilon 1 every step explores"),
        ({"alpha": 1e-9}, {}, "with --alpha 1e-09"),
        ({}, {"knows": False}, "no source of this fit has a value above 0"),
    ],
)
def test_targets_that_tell_nothing_are_warned_of(
    learning: dict[str, Any], found: dict[str, Any], told: str
) -> None:
    [warning] = targets(learning, **found)
    assert told in warning


def test_a_fit_says_what_its_sources_do_not_tell() -> None:
    spec = {"sources": {"learning": {"gamma": 0.95}}}

    def said(n: list[int], least: list[float], largest: list[float]) -> list[str]:
        return list(of_fit(spec, {"n": np.array(n), "min": np.array(least), "max": np.array(largest)}))

    nan = math.nan
    assert said([2, 2], [0.1, 0.2], [0.3, 0.4]) == []
    assert "no source has a value above 0" in said([0, 0], [nan, nan], [nan, nan])[0]
    assert "in two sources: there is no spread" in said([1, 1], [0.1, 0.2], [0.1, 0.2])[0]
    assert "all sources have the same values" in said([2, 2], [0.1, 0.2], [0.1, 0.2])[0]
    assert "all values above 0 are 1" in said([2, 0], [1.0, nan], [1.0, nan])[0]


def test_an_error_over_no_entries_is_unknown() -> None:
    nothing = np.full((2, 4), np.nan)
    numbers = LearnedSources(
        np.arange(2), np.zeros(2, bool), np.zeros(2, bool), math.nan, math.nan, nothing
    ).error_numbers()
    assert numbers == {
        "error_tasks": 0,
        "median_relative_error": None,
        "worst_task": None,
        "worst_median_relative_error": None,
    }
    assert "unknown" in _told(numbers)
    some = np.array([[np.nan, 0.1], [0.3, 0.5]])
    numbers = LearnedSources(
        np.array([3, 8]), np.ones(2, bool), np.ones(2, bool), 0.1, 1.0, some
    ).error_numbers()
    assert numbers == {
        "error_tasks": 2,
        "median_relative_error": 0.3,
        "worst_task": 8,
        "worst_median_relative_error": 0.4,
    }


def test_every_stage_warns_on_stderr_and_in_json(here: Callable[..., Any]) -> None:
    small = ("gridworld", "--size", 5, "--variance", 2, "--tasks", 3)

    def warnings(*words: object) -> list[str]:
        ended = here(*words, "--json")
        assert ended.code == 0, ended.err
        told: list[str] = ended.json["warnings"]
        assert [
            line.removeprefix("warning: ") for line in ended.err.splitlines() if line.startswith("warning")
        ] == told
        return told

    alike = "with --gamma 1 nothing is discounted, and all values above 0 are 1: they tell no state or action from another"
    assert alike in warnings("train-sources", *small, "--gamma", 1, "--learner", "exact", "-o", "one.h5")
    assert warnings("fit", "one.h5", "-o", "fit.h5") == [
        alike,
        "all sources have the same values: there is no distribution to transfer from",
    ]
    [success, nothing] = warnings(
        "transfer", "mean", "fit.h5", "--tasks", 2, "--episodes", 5, "--horizon", 1
    )[::-1]
    assert "it is the share of success" in success
    assert "no target reached the goal in any episode" in nothing
    unmet = warnings(
        "train-sources", *small, "--episodes", 2, "--horizon", 1, "--start", "fixed", "-o", Path("none.h5")
    )
    assert "no source met the goal in 2 episodes of --horizon 1" in unmet[0]
    assert "no source has a value above 0" in warnings("fit", "none.h5")[0]


@pytest.mark.parametrize(
    "learning",
    [
        {"alpha": Linear(1.0, 1e-9, 10)},  # its step size is no number
        {"alpha": 1e-9, "learner": RMax()},  # it has none
        {"alpha": 1.0, "learner": DoubleQ()},  # two last samples
        {"epsilon": 0.0, "learner": DelayedQ()},  # it explores by its start
        {"epsilon": 0.0, "explore": Boltzmann()},
        {"epsilon": Linear(1.0, 0.0, 10)},
    ],
)
def test_no_warning_is_given_that_another_learner_makes_untrue(learning: dict[str, Any]) -> None:
    assert sources(learning=learning) == targets(learning=learning) == []
