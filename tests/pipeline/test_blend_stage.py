"""`--blend`: what it goes with, how a run of it is called, stored and compared, and what it learns."""

from __future__ import annotations

import json
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from running import Ended

import qinit_cli as qinit
from qinit_cli.artefacts.settings import FitSettings, RunSettings, SourcesSettings
from qinit_cli.comparison.rows import remark
from qinit_cli.environments.gridworld import Gridworld
from qinit_cli.errors import UsageError
from qinit_cli.fitted import FitOptions
from qinit_cli.learners import LEARNERS
from qinit_cli.learning import KNOWN_AT
from qinit_cli.methods import METHODS
from qinit_cli.methods.plus import initialisations
from qinit_cli.pipeline.asked import LearningTargets
from qinit_cli.pipeline.transfer import check_together, stem_of, targets_of
from qinit_cli.plots.names import marked
from qinit_cli.tasks import SourceTasks

FAMILY = Gridworld()
SOURCES = SourcesSettings.of(SourceTasks(FAMILY, "exact", FAMILY.source_learning, 0), 9)
FIT = FitSettings.of(SOURCES, "0" * 64, FitOptions())
MEAN = METHODS["mean"]()
BLENDING = ("q-learning", "sarsa", "expected-sarsa")


def settings(**asked: Any) -> tuple[RunSettings, str]:
    """Of a run of mean that is asked for so, and what its name begins with."""
    targets, count = targets_of(MEAN, LearningTargets(**asked), SOURCES)
    return RunSettings.of(MEAN, targets, count, "0" * 64, FIT), stem_of(MEAN, targets, count)


@pytest.mark.parametrize(
    ("asked", "sentence"),
    [
        ({"known_at": 5}, "--known-at says how soon a blend gives way; give --blend knownness too"),
        ({"blend": "none", "known_at": 5}, "--known-at says how soon"),
        ({"blend": "knownness", "known_at": 0}, "--known-at is 0; it must be at least 1"),
        ({"blend": "knownness", "known_at": 2.5}, "--known-at is 2.5; it must be a whole number"),
        ({"blend": "knowness"}, "--blend is 'knowness'; did you mean knownness"),
    ],
)
def test_a_blend_that_cannot_be_is_refused_in_a_sentence(asked: dict[str, Any], sentence: str) -> None:
    with pytest.raises(ValueError, match=sentence):
        LearningTargets(**asked)


@pytest.mark.parametrize(
    ("method", "brings"),
    [
        ("posterior", "changes its start"),
        ("ptrs", "shapes rewards"),
        ("drs", "shapes rewards"),
        ("ops-tl", "follows policies"),
    ],
)
def test_a_method_that_is_more_than_a_start_table_is_not_blended(method: str, brings: str) -> None:
    with pytest.raises(UsageError, match=f"{method} {brings} .* leave out --blend"):
        check_together(METHODS[method](), LEARNERS["q-learning"](), blends=True)


def test_start_tables_are_blended_by_learners_of_one_step() -> None:
    for name, learner in LEARNERS.items():
        for method in (*initialisations(), "optimal"):
            if name in BLENDING:
                check_together(METHODS[method](), learner(), blends=True)
        if name not in BLENDING:
            with pytest.raises(
                UsageError, match=f"--learner {name} does not make; q-learning, sarsa, expected-sarsa do"
            ):
                check_together(MEAN, learner(), blends=True)


def test_a_run_says_its_blend_in_label_name_and_settings() -> None:
    plain, stem = settings()
    assert "blend" not in plain.spec()["method"]
    assert settings(blend="none") == (plain, stem)
    for asked, known_at, label, name in (
        ({}, KNOWN_AT, "mean blend=knownness", "mean-blend-knownness"),
        ({"known_at": KNOWN_AT}, KNOWN_AT, "mean blend=knownness", "mean-blend-knownness"),
        ({"known_at": 7}, 7, "mean blend=knownness known-at=7", "mean-blend-knownness-known-at-7"),
    ):
        made, stem = settings(blend="knownness", **asked)
        spec = made.spec()
        assert spec["method"]["blend"] == {"name": "knownness", "known_at": known_at}
        assert (spec["method"]["label"], stem) == (label, f"gridworld-variance-7-{name}-200-seed-0")
        assert RunSettings.read(json.loads(json.dumps(spec))).spec() == spec


@pytest.mark.parametrize(
    ("blend", "clause"),
    [
        ({"name": "knownness", "known_at": 0}, "known_at is 0"),
        ({"name": "knownness", "known_at": "7"}, "known_at is '7' in the blend"),
        ({"name": "knownness"}, "the blend lacks known_at"),
        ({"name": "fading", "known_at": 7}, "fading"),
        (7, "the blend is 7"),
    ],
)
def test_a_blend_that_cannot_be_is_not_read(blend: Any, clause: str) -> None:
    spec = settings(blend="knownness")[0].spec()
    spec["method"]["blend"] = blend
    with pytest.raises(ValueError, match=clause):
        RunSettings.read(spec)


def test_a_blend_is_marked_as_a_reconstruction() -> None:
    assert (remark("mean"), remark("mean", blended=True)) == ("", "reconstruction")
    assert remark("optimal", blended=True) == "privileged, reconstruction"
    assert marked("mean blend=knownness", "mean", blended=True) == "mean blend=knownness (reconstruction)"


def test_runs_with_a_blend_are_those_of_the_command_and_stand_beside_plain_ones(
    here: Callable[..., Ended],
) -> None:
    family = qinit.families.gridworld(size=5, variance=2)
    fit = qinit.fit(qinit.train_sources(family, tasks=12, learner="exact"))
    words = ("train-sources", "gridworld", "--size", 5, "--variance", 2, "--tasks", 12, "--learner", "exact")
    here(*words, "-o", "s.h5")
    here("fit", "s.h5", "-o", "f.h5")
    how: dict[str, Any] = {"tasks": 3, "episodes": 6, "blend": "knownness"}
    mean, zero = qinit.transfer("mean", fit, **how), qinit.transfer("zero", fit, **how, known_at=1)
    command = ("transfer", "mean", "f.h5", "--tasks", 3, "--episodes", 6, "--blend", "knownness", "--json")
    assert json.loads(here(*command).out)["digest"] == mean.digest
    assert qinit.lifelong("mean", fit, **how).digest == mean.digest
    with pytest.raises(UsageError, match="a part of their start is left in them; give --min-visits 60 too"):
        qinit.lifelong("mean", fit, **how, known_at=60, update=True)
    plain = [qinit.transfer(name, fit, tasks=3, episodes=6) for name in ("zero", "mean")]
    # from zero, and known at once, nothing is left to blend
    np.testing.assert_array_equal(zero["steps"], plain[0]["steps"])
    assert (mean["steps"] != plain[1]["steps"]).any()
    rows = {row["method"]: row["remark"] for row in qinit.compare([*plain, mean, zero]).rows}
    assert rows == {
        "zero": "",
        "mean": "",
        "mean blend=knownness": "reconstruction",
        "zero blend=knownness known-at=1": "reconstruction",
    }


def test_the_command_refuses_before_anything_is_written(here: Callable[..., Ended]) -> None:
    words = ("train-sources", "gridworld", "--size", 4, "--variance", 1, "--tasks", 2, "--learner", "exact")
    here(*words, "-o", "s.h5")
    here("fit", "s.h5", "-o", "f.h5")
    for asked, sentence in (
        (("ptrs", "f.h5", "--blend", "knownness"), "leave out --blend"),
        (("mean", "f.h5", "--blend", "knownness", "--learner", "double-q"), "--learner double-q does not"),
        (("mean", "f.h5", "--known-at", 3), "give --blend knownness too"),
    ):
        ended = here("transfer", *asked)
        assert (ended.code, ended.out) == (2, "")
        assert sentence in ended.err
        assert ended.err.count("\n") == 1
