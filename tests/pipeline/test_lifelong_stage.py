"""A lifetime adds what tasks learned, as a fit of them all would; resumed or not."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from qinit_cli.environments.gridworld import Gridworld
from qinit_cli.errors import NotAllowed
from qinit_cli.fitted import FittedTables
from qinit_cli.methods import METHODS
from qinit_cli.pipeline.fit import pair_statistics
from qinit_cli.pipeline.lifelong import Known, Lifetime, log_std
from qinit_cli.pipeline.transfer import learn_targets
from qinit_cli.tasks import TargetTasks
from qinit_cli.watch import Watch

FAMILY = Gridworld(size=6, variance=2)
TARGETS = TargetTasks(FAMILY, replace(FAMILY.target_learning, episodes=60), 3, True, keep_visits=True)
SHAPE = (36, 4)
MIN_VISITS = 8
MEDIAN = METHODS["logqinit-median"]()


def _fit(tables: Any) -> FittedTables:
    """The fit of tables (N, S, A), by numpy."""
    from qinit_cli.analysis.moments import moments

    counted = tables > 0
    with np.errstate(divide="ignore"):
        logs = np.where(counted, np.log(np.where(counted, tables, 1.0)), 0.0)
    statistics = pair_statistics(moments(logs, counted), moments(tables, counted), "mle")
    nothing = np.empty((0, *SHAPE))
    value = tables.max(axis=2).mean(axis=0)
    return FittedTables(
        **statistics, value_mean=value, library_q=nothing, library_td_var=nothing, estimator="mle"
    )


@pytest.fixture(scope="module")
def sources() -> Any:
    """Tables of five sources, one of which does not know the first ten states."""
    tables = np.random.default_rng(4).uniform(0.05, 0.9, (5, *SHAPE))
    tables[2, :10] = 0.0
    tables[:, 20, 1] = 0.0  # a pair that no source knows
    return tables


def _live(sources: Any, count: int, lived: Any = None, first: int = 0) -> dict[str, Any]:
    lifetime = Lifetime(MEDIAN, TARGETS, _fit(sources), MIN_VISITS, *([lived] if lived else []))
    ids, rows = lifetime(np.arange(first, count), Watch())
    np.testing.assert_array_equal(ids, np.arange(first, count))
    return rows


def test_updating_one_by_one_equals_a_fit_of_all_entries(sources: Any) -> None:
    rows = _live(sources, 6)
    tables, visits = rows["q"].reshape(6, *SHAPE), rows["visits"].reshape(6, *SHAPE)
    known = Known.of(_fit(sources))
    for q, seen in zip(tables, visits, strict=True):
        known = known.with_task(q, seen, MIN_VISITS)
    everything = np.concatenate([sources, np.where(visits >= MIN_VISITS, tables, 0.0)])
    counted = everything > 0
    logs = np.ma.masked_array(np.log(np.where(counted, everything, 1.0)), ~counted)
    updated = known.fit(_fit(sources))
    there = counted.any(axis=0)
    np.testing.assert_array_equal(updated.n, counted.sum(axis=0))
    np.testing.assert_allclose(updated.mu[there], logs.mean(axis=0).filled(np.nan)[there], rtol=1e-12)
    np.testing.assert_allclose(
        updated.sigma[there], logs.std(axis=0).filled(np.nan)[there], rtol=0, atol=1e-12
    )
    values = np.ma.masked_array(everything, ~counted)
    np.testing.assert_allclose(updated.mean[there], values.mean(axis=0).filled(np.nan)[there], rtol=1e-12)
    np.testing.assert_array_equal(updated.max[there], values.max(axis=0).filled(np.nan)[there])
    assert np.isnan(updated.mu[~there]).all()
    median_spread = float(np.median(logs.std(axis=0).filled(np.nan)[there]))
    assert rows["log_std"][-1] == pytest.approx(median_spread, abs=1e-12)


def test_a_start_that_was_hardly_visited_is_never_added(sources: Any) -> None:
    rows = _live(sources, 4)
    visits = rows["visits"].reshape(4, *SHAPE)
    positive = rows["q"].reshape(4, *SHAPE) > 0
    assert (visits < MIN_VISITS).any(), "the test needs pairs that were hardly visited"
    np.testing.assert_array_equal(rows["added"], ((visits >= MIN_VISITS) & positive).sum(axis=(1, 2)))


def test_each_task_starts_from_the_sources_and_the_tasks_before_it(sources: Any) -> None:
    rows = _live(sources, 3)
    tables, visits = rows["q"].reshape(3, *SHAPE), rows["visits"].reshape(3, *SHAPE)
    before = np.concatenate([sources, np.where(visits[:2] >= MIN_VISITS, tables[:2], 0.0)])
    with np.errstate(divide="ignore", invalid="ignore"):
        logs = np.ma.masked_array(np.log(before), before <= 0)
    wanted = np.exp(logs.mean(axis=0).filled(-np.inf))  # 0 where nobody knows
    np.testing.assert_allclose(rows["start"].reshape(3, *SHAPE)[2], np.clip(wanted, 0, 1), rtol=1e-12)


def test_the_first_task_is_learned_as_transfer_learns_it(sources: Any) -> None:
    rows = _live(sources, 1)
    initial = MEDIAN.initial_of_all(_fit(sources), TARGETS.family, TARGETS.learning)
    _, plain = learn_targets(TARGETS, initial, np.arange(1), Watch())
    np.testing.assert_array_equal(rows["steps"], plain["steps"])


def test_a_lifetime_that_was_interrupted_goes_on_with_the_same_numbers(sources: Any) -> None:
    straight = _live(sources, 6)
    saved = {index: {name: straight[name][index] for name in ("q", "visits")} for index in range(4)}
    rest = _live(sources, 6, saved.__getitem__, first=4)
    for name in ("q", "steps", "start", "added", "log_std"):
        np.testing.assert_array_equal(rest[name], straight[name][4:])


def test_a_task_before_which_one_is_missing_is_refused(sources: Any) -> None:
    lifetime = Lifetime(MEDIAN, TARGETS, _fit(sources), MIN_VISITS)
    with pytest.raises(NotAllowed, match="task 0 was not learned"):
        lifetime(np.array([2]), Watch())


def test_a_stopped_lifetime_keeps_what_was_finished(sources: Any) -> None:
    watch = Watch()
    watch.stop()
    ids, rows = Lifetime(MEDIAN, TARGETS, _fit(sources), MIN_VISITS)(np.arange(3), watch)
    assert len(ids) == 0
    assert rows == {}


def test_the_spread_of_what_nobody_knows_is_not_a_number() -> None:
    assert np.isnan(log_std(Known.of(_fit(np.zeros((3, *SHAPE)))).log_q))
