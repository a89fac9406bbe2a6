"""What trackers are handed, beside numpy on the arrays of the run; tests/soak reads it back from the trackers."""

from __future__ import annotations

import sys
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from running import Ended

import qinit_cli as qinit
from qinit_cli import library
from qinit_cli.artefacts.opening import open_artefact
from qinit_cli.trackers.run_record import RunRecord


@pytest.fixture(scope="module")
def fit() -> library.Fit:
    family = qinit.families.gridworld(size=4, variance=1)
    return qinit.fit(qinit.train_sources(family, tasks=5, learner="exact"))


@pytest.fixture(scope="module")
def run(fit: library.Fit) -> library.Run:
    return qinit.transfer("mean", fit, tasks=3, episodes=6, evaluate_every=2)


def _record(run: library.Run) -> RunRecord:
    with open_artefact(run.source, "run") as artefact:
        return RunRecord.of(artefact)


def test_a_record_has_the_means_over_targets(run: library.Run) -> None:
    record = _record(run)
    horizon = run.settings["learning"]["horizon"]
    np.testing.assert_allclose(record.curves["return"], run.returns().mean(axis=0), rtol=1e-12)
    np.testing.assert_allclose(record.curves["success"], run["reached"].mean(axis=0))
    np.testing.assert_allclose(record.curves["steps"], np.minimum(run["steps"], horizon).mean(axis=0))
    np.testing.assert_allclose(record.evaluations["greedy_return"], run["eval_return"].mean(axis=0))
    assert record.summary["average_return"] == pytest.approx(run.returns().mean())
    assert record.summary["v_eps"] == pytest.approx(run["v_eps"].mean())
    assert (record.name, record.content_sha256) == (run.name, run.digest)
    assert record.parameters["learning.gamma"] == 0.95
    assert record.parameters["source_set.family.variance"] == 1
    assert record.parameters["keep_q"] is False
    assert record.time > 1.7e9


def test_steps_join_episodes_and_evaluations(run: library.Run) -> None:
    record = replace(
        _record(run),
        curves={"return": np.array([0.1, 0.2])},
        evaluations={"greedy_return": np.array([0.3, 0.4])},
    )
    assert list(record.steps()) == [
        (0, {"return": 0.1, "greedy_return": 0.3}),
        (1, {"return": 0.2}),
        (2, {"greedy_return": 0.4}),
    ]


@pytest.mark.parametrize("tracker", ["mlflow", "wandb", "tensorboard"])
def test_a_tracker_that_is_not_there_is_refused_with_what_installs_it(
    here: Callable[..., Ended], fit: library.Fit, tracker: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    qinit.transfer("zero", fit, tasks=1, episodes=2, output="run.h5")
    monkeypatch.setitem(sys.modules, tracker, None)
    ended = here("log", "run.h5", "--to", tracker)
    assert (ended.code, ended.out) == (2, "")
    assert f"pip install '.[{tracker}]'" in ended.err
    assert len(ended.err.splitlines()) == 1


def test_what_is_no_run_and_no_tracker_is_refused(here: Callable[..., Ended], fit: library.Fit) -> None:
    qinit.fit(qinit.train_sources(qinit.families.gridworld(size=4), tasks=2, learner="exact"), output="f.h5")
    assert here("log", "f.h5").code == 2
    assert here("log", "f.h5", "--to", "tensorboard").code == 4
    assert here("log", "f.h5", "--to", "tensorbord").code == 2
