"""The metrics of a row: ratio, time to threshold, interquartile mean, probability of improvement, negative transfer."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from scipy import stats

from qinit_cli.artefacts.settings import FitSettings, RunSettings, SourcesSettings
from qinit_cli.comparison.rows import Row, compare
from qinit_cli.comparison.runs import ComparedRun
from qinit_cli.comparison.scores import Metric, curve
from qinit_cli.environments.gridworld import Gridworld
from qinit_cli.fitted import FitOptions
from qinit_cli.methods import METHODS
from qinit_cli.tasks import SourceTasks, TargetTasks

EPISODES = 100


def _run(
    method: str, returns: Any, *, sources: str = "set", targets: str = "t", possible: Any = None
) -> ComparedRun:
    """A run of gamma 1/2 with these returns (T, EPISODES), each a power of 1/2 or 0."""
    returns = np.asarray(returns, float)
    reached = returns > 0
    steps = np.where(reached, 1 - np.log2(np.where(reached, returns, 1)), 60).astype(np.int32)
    family = Gridworld(size=6, variance=2)
    learning = replace(family.target_learning, gamma=0.5, horizon=60, episodes=EPISODES)
    fit = FitSettings.of(
        SourcesSettings.of(SourceTasks(family, "q-learning", learning, 0), 4), sources, FitOptions()
    )
    wanted = TargetTasks(family, learning, 0, keep_q=False)
    return ComparedRun(
        name=f"{method}-{sources}",
        method=method,
        label=method,
        settings=RunSettings.of(METHODS[method](), wanted, len(steps), "fit", fit),
        steps=steps,
        reached=reached,
        attainable=None if possible is None else np.asarray(possible, float),
        v_star=None,
        evaluation_steps=None,
        evaluation_reached=None,
        target_digest=targets,
    )


def _level(*returns: float) -> Any:
    """A target for each return, which every episode earns."""
    return np.repeat(np.array(returns)[:, None], EPISODES, axis=1)


def _row(runs: list[ComparedRun], method: str, baseline: str = "zero", metric: Metric = "return") -> Row:
    [comparison] = compare(runs, baseline, metric)
    return next(row for row in comparison.rows if row.label == method)


ZERO = _run("zero", _level(0.125, 0.25, 0.25, 0.5))


def test_the_transfer_ratio_is_the_ratio_of_the_means() -> None:
    row = _row([ZERO, _run("mean", _level(0.5, 0.5, 1, 0.25))], "mean")
    assert row.ratio is not None
    assert row.ratio.value == pytest.approx(2.25 / 1.125)
    assert row.ratio.low < 2 < row.ratio.high


def test_twice_the_baseline_everywhere_is_a_ratio_of_two_without_width() -> None:
    ratio = _row([ZERO, _run("mean", _level(0.25, 0.5, 0.5, 1))], "mean").ratio
    assert ratio is not None
    assert [ratio.value, ratio.low, ratio.high] == pytest.approx([2, 2, 2])


def test_where_the_baselines_interval_touches_nothing_the_difference_stands_alone() -> None:
    row = _row([_run("zero", _level(0, 0, 0, 0.5)), _run("mean", _level(0.5, 0.5, 1, 1))], "mean")
    assert row.ratio is None
    assert row.difference is not None
    assert row.difference.value == pytest.approx(0.625)


def test_the_time_to_threshold_is_when_fifty_episodes_average_half_of_what_is_possible() -> None:
    late = _level(1, 1, 1, 1)
    late[0, :40] = 0  # 25 of 50 ones are half of 1: the window ends with episode 65
    late[1, :80] = 0  # never half
    row = _row([_run("zero", late, possible=[1, 1, 1, 0.5])], "zero")
    assert row.threshold is not None
    assert row.threshold.median.value == 50  # of 50, 50, 65 and never
    assert row.threshold.restricted_mean.value == (50 + 50 + 65 + 100) / 4
    assert row.threshold.censored == 0.25
    assert row.threshold.median.low == 50
    assert row.threshold.median.high == math.inf  # samples of the second target alone


def test_who_can_hope_for_nothing_never_reaches_half_of_it() -> None:
    row = _row([_run("zero", _level(1, 1, 0), possible=[1, 0, 0])], "zero")
    assert row.threshold is not None
    assert row.threshold.censored == pytest.approx(2 / 3)
    assert row.threshold.median.value == math.inf


def test_without_what_is_possible_there_is_no_threshold_and_optimal_gives_one() -> None:
    mean = _run("mean", _level(0.5, 0.5, 0.125, 0.125))
    assert _row([ZERO, mean], "mean").threshold is None
    optimal = _run("optimal", _level(1, 0.5, 0.5, 0.25))
    threshold = _row([ZERO, mean, optimal], "mean").threshold
    assert threshold is not None
    assert threshold.censored == 0.25  # the third alone earns less than half of optimal's


def _sets(shared: bool, sets: int = 5, targets: int = 9) -> list[ComparedRun]:
    rng = np.random.default_rng(3)
    return [
        _run(
            method,
            rng.choice([0, 0.125, 0.25, 0.5, 1], (targets, EPISODES)),
            sources=f"set{number}",
            targets="t" if shared else f"t{number}",
        )
        for number in range(sets)
        for method in ("zero", "mean")
    ]


def _averages(runs: list[ComparedRun], method: str) -> np.ndarray:
    return np.array([curve(run, "return").mean(axis=1) for run in runs if run.method == method])


@pytest.mark.parametrize("shared", [True, False])
def test_the_interquartile_mean_is_over_all_source_sets_and_targets(shared: bool) -> None:
    runs = _sets(shared)
    iqm = _row(runs, "mean").iqm
    assert iqm.value == pytest.approx(stats.trim_mean(_averages(runs, "mean"), 0.25, axis=None), rel=1e-12)
    assert iqm.low < iqm.value < iqm.high


def test_the_probability_of_improvement_is_the_mann_whitney_statistic_of_each_target() -> None:
    runs = _sets(shared=True)
    method, zero = _averages(runs, "mean"), _averages(runs, "zero")
    known = [
        stats.mannwhitneyu(x, y, alternative="greater").statistic / 25
        for x, y in zip(method.T, zero.T, strict=True)
    ]
    found = _row(runs, "mean").improvement
    assert found is not None
    assert found.value == pytest.approx(np.mean(known))
    assert found.low < found.value < found.high


def test_sets_with_targets_of_their_own_are_compared_in_pairs() -> None:
    runs = _sets(shared=False)
    found = _row(runs, "mean").improvement
    assert found is not None
    assert found.value == pytest.approx(np.mean(_averages(runs, "mean") > _averages(runs, "zero")))
    assert found.low < found.value < found.high


def test_one_source_set_improves_on_the_share_of_targets_where_it_is_better() -> None:
    row = _row([ZERO, _run("mean", _level(0.5, 0.25, 0.125, 1))], "mean")
    assert row.improvement is not None
    assert row.improvement.value == (2 + 0.5) / 4


def test_fewer_steps_are_the_improvement() -> None:
    better = _run("mean", _level(0.5, 0.5, 0.5, 1))
    row = _row([ZERO, better], "mean", metric="steps")
    assert row.improvement is not None
    assert row.difference is not None
    assert row.improvement.value == 1
    assert row.difference.value < 0
    assert row.negative_transfer is False


@pytest.mark.parametrize("metric", ["return", "steps"])
def test_worse_than_zero_with_the_whole_interval_is_negative_transfer(metric: Metric) -> None:
    worse = _run("maxqinit", _level(0.0625, 0.125, 0.125, 0.25))
    mixed = _run("mean", _level(0.0625, 0.5, 0.125, 1))
    [comparison] = compare([ZERO, worse, mixed], "zero", metric)
    assert [row.negative_transfer for row in comparison.rows] == [None, True, False]


def test_worse_than_another_baseline_is_no_negative_transfer() -> None:
    worse = _run("maxqinit", _level(0.0625, 0.125, 0.125, 0.25))
    [comparison] = compare([ZERO, worse], "maxqinit", "return")
    assert [row.negative_transfer for row in comparison.rows] == [None, None]
    [comparison] = compare([worse, ZERO], "", "return")
    assert [row.negative_transfer for row in comparison.rows] == [None, None]


def test_worse_than_any_method_that_transfers_nothing_is_negative_transfer(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(METHODS["mean"], "transfers", False)
    worse = _run("maxqinit", _level(0.0625, 0.125, 0.125, 0.25))
    [comparison] = compare([_run("mean", _level(0.125, 0.25, 0.25, 0.5)), worse], "mean", "return")
    assert [row.negative_transfer for row in comparison.rows] == [None, True]


def test_regret_is_counted_from_any_method_that_attains_what_is_possible(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(METHODS["maxqinit"], "attains", True)
    regret = _row([ZERO, _run("maxqinit", _level(0.25, 0.5, 0.5, 1))], "zero").regret
    assert regret is not None
    assert regret.value == pytest.approx((0.125 + 0.25 + 0.25 + 0.5) / 4)


def test_regret_is_not_counted_from_a_blend_of_what_is_attainable() -> None:
    optimal = _run("optimal", _level(0.25, 0.5, 0.5, 1))
    method = replace(optimal.settings.method, label="optimal blend=knownness", known_at=10)
    lower = _run("optimal", _level(0.125, 0.25, 0.25, 0.5), sources="other")
    blended = replace(
        lower, label=method.label, name="blended", settings=replace(lower.settings, method=method)
    )
    assert _row([ZERO, blended], "zero").regret is None
    regret = _row([ZERO, blended, optimal], "zero").regret
    assert regret is not None
    assert regret.value == pytest.approx((0.125 + 0.25 + 0.25 + 0.5) / 4)


def test_one_target_alone_tells_no_negative_transfer_and_no_ratio() -> None:
    row = _row([_run("zero", _level(1)), _run("mean", _level(0.5))], "mean")
    assert row.negative_transfer is None
    assert row.ratio is None
    assert row.improvement is not None
    assert (row.improvement.value, math.isnan(row.improvement.low)) == (0, True)
