from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from scipy import stats

from qinit_cli.analysis.intervals import tails
from qinit_cli.artefacts.settings import FitSettings, RunSettings, SourceSet, SourcesSettings, StoredFamily
from qinit_cli.comparison.rows import compare
from qinit_cli.comparison.runs import ComparedRun
from qinit_cli.comparison.score_matrices import score_matrices
from qinit_cli.comparison.scores import curve
from qinit_cli.environments.gridworld import Gridworld
from qinit_cli.errors import NotAllowed, UsageError
from qinit_cli.fitted import FitOptions
from qinit_cli.methods import METHODS
from qinit_cli.seeding import Stream, generator
from qinit_cli.tasks import SourceTasks, TargetTasks

EPISODES = 20
GAMMA = 0.5


def _run(
    method: str, steps: Any, reached: Any, *, name: str = "", targets: str = "t", sources: str = "set"
) -> ComparedRun:
    """A run whose returns are 0.5^(steps - 1) where the goal was reached."""
    family = Gridworld(size=6, variance=2)
    learning = replace(family.target_learning, gamma=GAMMA, horizon=100, episodes=EPISODES)
    fit = FitSettings.of(
        SourcesSettings.of(SourceTasks(family, "q-learning", learning, 0), 4), sources, FitOptions()
    )
    wanted = TargetTasks(family, learning, 0, keep_q=False)
    settings = RunSettings.of(METHODS[method](), wanted, len(steps), "fit", fit)
    return ComparedRun(
        name=name or f"{method}-run",
        method=method,
        label=method,
        settings=settings,
        steps=np.asarray(steps, np.int32),
        reached=np.asarray(reached, bool),
        attainable=None,
        v_star=None,
        evaluation_steps=None,
        evaluation_reached=None,
        target_digest=targets,
    )


def _filled(*values: Any) -> Any:
    """(targets, EPISODES), a constant or the values themselves for each target."""
    return np.array([np.broadcast_to(value, EPISODES) for value in values])


ALWAYS = _filled(True, True)
# target 0: return 1/4 always; target 1: nothing in the first ten episodes, then 1
ZERO = _run("zero", _filled(3, [100] * 10 + [1] * 10), _filled(True, [False] * 10 + [True] * 10))
# target 0: return 1/2; target 1: 1/8, but 1 in the last two episodes
OTHER = _run("maxqinit", _filled(2, [4] * 18 + [1] * 2), ALWAYS)


def test_averages_are_those_worked_by_hand() -> None:
    [comparison] = compare([ZERO, OTHER], "zero", "return")
    zero, other = comparison.rows
    assert zero.average.value == pytest.approx((0.25 + 0.5) / 2)
    assert zero.jumpstart.value == pytest.approx((0.25 + 0.0) / 2)
    assert zero.asymptotic.value == pytest.approx((0.25 + 1.0) / 2)
    assert other.average.value == pytest.approx((0.5 + (18 / 8 + 2) / 20) / 2)
    assert other.jumpstart.value == pytest.approx((0.5 + 0.125) / 2)
    assert other.asymptotic.value == pytest.approx((0.5 + 1.0) / 2)


def test_success_and_restricted_steps_are_those_worked_by_hand() -> None:
    [comparison] = compare([ZERO, OTHER], "zero", "return")
    zero, other = comparison.rows
    assert (zero.success, other.success) == (0.75, 1.0)
    assert zero.steps == pytest.approx((3 + (100 + 1) / 2) / 2)
    assert other.steps == pytest.approx((2 + (18 * 4 + 2) / 20) / 2)


def test_differences_are_paired_to_the_baseline_which_has_none() -> None:
    [comparison] = compare([ZERO, OTHER], "zero", "return")
    zero, other = comparison.rows
    assert zero.difference is None
    assert other.difference is not None
    by_target = np.array([0.5 - 0.25, (18 / 8 + 2) / 20 - 0.5])
    assert other.difference.value == pytest.approx(by_target.mean())
    assert (other.difference.low, other.difference.high) == (
        pytest.approx(by_target.min()),
        pytest.approx(by_target.max()),
    )


@pytest.mark.parametrize(("metric", "expected"), [("return", 0.25), ("success", 1.0), ("steps", 3.0)])
def test_each_metric_says_its_own_of_an_episode(metric: Any, expected: float) -> None:
    assert curve(ZERO, metric)[0, 0] == expected


def test_an_episode_without_the_goal_counts_its_steps_but_no_return() -> None:
    assert curve(ZERO, "return")[1, 0] == 0
    assert curve(ZERO, "success")[1, 0] == 0
    assert curve(ZERO, "steps")[1, 0] == 100


def test_the_metric_changes_averages_and_differences() -> None:
    [comparison] = compare([ZERO, OTHER], "zero", "success")
    zero, other = comparison.rows
    assert (zero.average.value, zero.jumpstart.value, zero.asymptotic.value) == (0.75, 0.5, 1.0)
    assert other.difference is not None
    assert other.difference.value == pytest.approx(0.25)


def _random_runs(targets: int) -> tuple[ComparedRun, ComparedRun]:
    probability = np.random.default_rng(1)
    runs = [
        _run(
            method,
            probability.integers(1, 12, (targets, EPISODES)),
            probability.random((targets, EPISODES)) < 0.8,
        )
        for method in ("zero", "maxqinit")
    ]
    return runs[0], runs[1]


def test_intervals_are_scipys_percentile_bootstrap_of_the_same_targets() -> None:
    zero, other = _random_runs(40)
    [comparison] = compare([zero, other], "zero", "return")
    difference = (curve(other, "return") - curve(zero, "return")).mean(axis=1)
    expected = stats.bootstrap(
        (difference,),
        np.mean,
        n_resamples=10_000,
        method="percentile",
        confidence_level=1 - 2 * tails(40)[0],
        rng=np.random.default_rng(99),  # of its own: equal up to the bootstrap's own noise
    )
    found = comparison.rows[1].difference
    assert found is not None
    assert found.value == pytest.approx(difference.mean())
    width = expected.confidence_interval.high - expected.confidence_interval.low
    assert found.low == pytest.approx(expected.confidence_interval.low, abs=0.05 * width)
    assert found.high == pytest.approx(expected.confidence_interval.high, abs=0.05 * width)


def test_intervals_are_scipys_to_the_last_digit_on_the_same_stream() -> None:
    zero, other = _random_runs(15)
    [comparison] = compare([zero, other], "zero", "return")
    values = curve(other, "return").mean(axis=1)
    expected = stats.bootstrap(
        (values,),
        np.mean,
        n_resamples=10_000,
        method="percentile",
        confidence_level=1 - 2 * tails(15)[0],
        rng=generator(0, Stream.BOOTSTRAP, 0),
    ).confidence_interval
    found = comparison.rows[1].average
    assert (found.low, found.high) == (pytest.approx(expected.low), pytest.approx(expected.high))


def test_a_row_does_not_depend_on_what_stands_beside_it() -> None:
    zero, other = _random_runs(10)
    [alone] = compare([other], "zero", "return")
    [together] = compare([zero, other], "zero", "return")
    assert alone.rows[0].average == together.rows[1].average


def test_one_target_alone_has_no_interval() -> None:
    run = _run("zero", _filled(3), _filled(True))
    [comparison] = compare([run], "zero", "return")
    average = comparison.rows[0].average
    assert average.value == 0.25
    assert np.isnan([average.low, average.high]).all()


def test_runs_of_one_distribution_that_met_other_targets_are_not_compared() -> None:
    elsewhere = _run("maxqinit", _filled(2, 2), ALWAYS, targets="u", name="elsewhere")
    with pytest.raises(NotAllowed, match="did not meet the targets of zero's run"):
        compare([ZERO, elsewhere, OTHER], "zero", "return")


def test_runs_of_another_distribution_are_grouped_apart() -> None:
    elsewhere = _run("maxqinit", _filled(2, 2), ALWAYS, targets="u", name="elsewhere")
    family = StoredFamily.of(Gridworld(size=6, variance=3))
    elsewhere = replace(elsewhere, settings=replace(elsewhere.settings, family=family))
    first, second = compare([ZERO, elsewhere, OTHER], "zero", "return")
    assert [row.label for row in first.rows] == ["zero", "maxqinit"]
    assert [row.label for row in second.rows] == ["maxqinit"]
    assert (first.baseline, second.baseline) == ("zero", None)
    assert second.rows[0].difference is None


def test_a_baseline_that_nobody_has_is_refused_with_the_nearest_name() -> None:
    with pytest.raises(UsageError, match="did you mean maxqinit"):
        compare([ZERO, OTHER], "maxqinti", "return")


def _fitted(run: ComparedRun, estimator: Any) -> SourceSet:
    return replace(run.settings.source_set, fitted=FitOptions(estimator=estimator))


def test_fits_of_the_same_sources_are_options_not_replicates() -> None:
    twice = [
        replace(
            OTHER,
            name=f"run-{estimator}",
            settings=replace(OTHER.settings, source_set=_fitted(OTHER, estimator)),
        )
        for estimator in ("mle", "umvue")
    ]
    [comparison] = compare([ZERO, *twice], "zero", "return")
    assert comparison.sets == 1
    assert [row.label for row in comparison.rows] == ["zero", "maxqinit, mle", "maxqinit, umvue"]


def test_a_method_that_reads_its_sources_is_no_baseline_for_other_sets() -> None:
    runs = _source_sets(shared=True, sets=2)
    mean = _run("mean", OTHER.steps[[0] * 9], OTHER.reached[[0] * 9], name="mean-0", sources="set0")
    [comparison] = compare([*runs, mean], "mean", "return")
    assert [row.difference for row in comparison.rows] == [None, None, None]


def test_a_baseline_that_could_be_several_runs_is_refused_with_their_names() -> None:
    twice = [_run("zero", ZERO.steps, ZERO.reached, name=name) for name in ("zero-1a2b", "zero-3c4d")]
    with pytest.raises(NotAllowed, match="baseline zero could be any of zero ero-1a2b, zero ero-3c4d"):
        compare([*twice, OTHER], "zero", "return")
    [comparison] = compare([*twice, OTHER], "zero-3c4d", "return")
    assert comparison.rows[1].difference is None
    assert comparison.rows[0].difference is not None


def test_a_run_that_kept_no_steps_of_its_evaluations_is_refused_not_rebuilt() -> None:
    earlier = replace(OTHER, settings=replace(OTHER.settings, evaluate_every=5))
    with pytest.raises(NotAllowed, match=r"not their steps.*--force"):
        earlier.greedy()
    with pytest.raises(NotAllowed, match="no greedy evaluations"):
        OTHER.greedy()


def test_the_same_run_named_twice_counts_once() -> None:
    [comparison] = compare([ZERO, OTHER, ZERO], "zero", "return")
    assert [row.label for row in comparison.rows] == ["zero", "maxqinit"]


def test_a_method_that_stands_there_twice_is_told_apart_by_its_name() -> None:
    twice = [
        _run("maxqinit", ZERO.steps, ZERO.reached, name=f"run-{end}") for end in ("11111111", "22222222")
    ]
    [comparison] = compare([*twice, ZERO], "zero", "return")
    assert [row.label for row in comparison.rows] == ["maxqinit 11111111", "maxqinit 22222222", "zero"]


def test_the_title_says_what_the_targets_are() -> None:
    [comparison] = compare([ZERO], "zero", "return")
    assert comparison.title == "gridworld-6-variance-2, 2 targets of seed 0, 20 episodes"


def _source_sets(shared: bool, sets: int = 6, targets: int = 9) -> list[ComparedRun]:
    probability = np.random.default_rng(3)
    return [
        _run(
            method,
            probability.integers(1, 12, (targets, EPISODES)),
            probability.random((targets, EPISODES)) < 0.8,
            name=f"{method}-{number}",
            targets="t" if shared else f"t{number}",
            sources=f"set{number}",
        )
        for number in range(sets)
        for method in ("zero", "maxqinit")
    ]


@pytest.mark.parametrize("shared", [True, False])
def test_source_sets_are_averaged_and_paired_set_by_set(shared: bool) -> None:
    runs = _source_sets(shared)
    [comparison] = compare(runs, "zero", "return")
    zero, other = comparison.rows
    averages = {run.name: curve(run, "return").mean() for run in runs}
    by_set = np.array([averages[f"maxqinit-{n}"] - averages[f"zero-{n}"] for n in range(6)])
    assert (comparison.sets, zero.sets, other.sets) == (6, 6, 6)
    assert other.difference is not None
    assert other.difference.value == pytest.approx(by_set.mean())
    flips = np.array(np.meshgrid(*[[-1, 1]] * 6)).reshape(6, -1)
    means = np.abs(flips.T @ by_set)
    assert other.p == pytest.approx(np.mean(means >= abs(by_set.sum()) * (1 - 1e-12)))
    assert ("which the sets share" in comparison.intervals) == shared


def test_one_baseline_serves_every_source_set_that_met_its_targets() -> None:
    runs = _source_sets(shared=True)
    zero = next(run for run in runs if run.label == "zero")
    [comparison] = compare([zero, *(run for run in runs if run.label != "zero")], "zero", "return")
    expected = np.mean(
        [curve(run, "return").mean() - curve(zero, "return").mean() for run in runs if run.label != "zero"]
    )
    assert comparison.rows[1].difference is not None
    assert comparison.rows[1].difference.value == pytest.approx(expected)


def test_one_source_set_on_two_sets_of_targets_is_not_two_source_sets() -> None:
    runs = [
        replace(
            run, settings=replace(run.settings, source_set=replace(run.settings.source_set, content="set"))
        )
        for run in _source_sets(shared=False, sets=2)
    ]
    assert [comparison.sets for comparison in compare(runs, "zero", "return")] == [1, 1]


def _on_targets(count: int, *others: str) -> Any:
    """A comparison of as many targets, on each of which every other method is ahead of zero by the same."""
    zero = _run("zero", _filled(*[3] * count), _filled(*[True] * count))
    ahead = [_run(name, _filled(*[2] * count), _filled(*[True] * count)) for name in others]
    [comparison] = compare([zero, *ahead], "zero", "return")
    return comparison


def test_p_is_left_out_where_no_difference_could_make_it_small() -> None:
    few, enough = _on_targets(5, "mean"), _on_targets(6, "mean")
    assert [row.p for row in few.rows] == [None, None]
    assert (
        few.untested == "p: at least 6 targets are needed for the sign-flip test over 1 method to reach 0.05"
    )
    assert [row.p for row in enough.rows] == [None, 2 / 64]
    assert enough.untested == ""


def test_the_more_methods_there_are_the_more_targets_p_needs() -> None:
    few, enough = _on_targets(6, "mean", "ucoi"), _on_targets(7, "mean", "ucoi")
    assert [row.p for row in few.rows] == [None] * 3
    assert "at least 7 targets are needed for the sign-flip test over 2 methods" in few.untested
    assert [row.p for row in enough.rows] == [None, 4 / 128, 4 / 128]


def test_two_source_sets_have_an_interval_and_no_p() -> None:
    sets = [
        _run(method, _filled(*[steps] * 9), _filled(*[True] * 9), name=f"{method}-{source}", sources=source)
        for method, steps in (("zero", 3), ("mean", 2))
        for source in ("a", "b")
    ]
    [comparison] = compare(sets, "zero", "return")
    assert comparison.rows[1].p is None
    assert "at least 6 source sets are needed" in comparison.untested


def test_score_matrices_have_a_row_for_each_source_set_and_a_column_for_each_target() -> None:
    first = _run("mean", _filled(2, 1), _filled(True, True), name="a", sources="set")
    second = _run("mean", _filled(4, 1), _filled(True, False), name="b", sources="tes")
    found = score_matrices([ZERO, second, first], "return")
    assert list(found) == ["zero", "mean"]
    np.testing.assert_array_equal(found["zero"], [[0.25, 0.5]])
    np.testing.assert_array_equal(found["mean"], [[0.5, 1], [0.125, 0]])  # sets in the order of their hashes
    np.testing.assert_array_equal(score_matrices([first, second], "steps")["mean"], [[2, 1], [4, 1]])


def test_there_is_no_score_matrix_of_other_targets() -> None:
    mine = _run("mean", _filled(2, 1), _filled(True, True), name="a")
    other = _run("mean", _filled(2, 1), _filled(True, True), name="b", targets="u", sources="tes")
    with pytest.raises(NotAllowed, match="targets of its own"):
        score_matrices([mine, other], "return")
    with pytest.raises(NotAllowed, match="2 sets of targets"):
        score_matrices([mine, replace(other, settings=mine.settings)], "return")
