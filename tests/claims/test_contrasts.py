"""Differences in pairs against scipy and statsmodels."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from scipy import stats
from statsmodels.stats.multitest import multipletests

from qinit_cli.claims import over_sets
from qinit_cli.claims.initialisations import pair_findings
from qinit_cli.claims.scores import Arm, Arms
from qinit_cli.claims.setting import Setting

PAIRS = [("logqinit-median", "ucoi"), ("logqinit-median", "zero"), ("ucoi", "zero")]
MEANS = {"logqinit-median": 0.0302, "ucoi": 0.03, "zero": 0.02}


def test_a_contrast_is_the_mean_of_paired_differences(scores: Callable[..., Arms]) -> None:
    made = scores(MEANS)
    found = made.contrasts(PAIRS)
    median, ucoi, zero = (made.arms[label].averages for label in MEANS)
    assert found[PAIRS[0]].value == pytest.approx((median - ucoi).mean())
    assert found[PAIRS[1]].value == pytest.approx((median - zero).mean())
    assert [found[pair].sets for pair in PAIRS] == [10, 10, 10]


def test_p_is_scipys_sign_flip_over_source_sets_adjusted_as_statsmodels_does(
    scores: Callable[..., Arms],
) -> None:
    made = scores(MEANS, spread=0.002)
    median, ucoi, zero = (made.arms[label].averages.mean(axis=1) for label in MEANS)
    raw = [
        stats.permutation_test(
            (difference,), np.mean, permutation_type="samples", n_resamples=np.inf, vectorized=True
        ).pvalue
        for difference in (median - ucoi, median - zero, ucoi - zero)
    ]
    found = made.contrasts(PAIRS)
    assert [found[pair].p for pair in PAIRS] == pytest.approx(multipletests(raw, method="holm")[1])


def test_methods_that_read_no_sources_are_paired_with_every_set_and_count_none(
    scores: Callable[..., Arms],
) -> None:
    made = scores({"drs": 0.03, "zero": 0.01, "ucoi": 0.02})
    found = made.contrasts([("drs", "zero"), ("drs", "ucoi")])
    assert (found["drs", "zero"].sets, found["drs", "ucoi"].sets) == (0, 10)
    expected = (made.arms["drs"].averages - made.arms["ucoi"].averages).mean()
    assert found["drs", "ucoi"].value == pytest.approx(expected)


def test_pairs_of_which_one_is_not_there_are_left_out(scores: Callable[..., Arms]) -> None:
    assert scores(MEANS).contrasts([("ucoi", "maxqinit")]) == {}


def test_source_sets_that_one_of_the_two_lacks_are_left_out() -> None:
    first = Arm(np.array([[1.0, 2.0], [5.0, 5.0]]), (("t", "a"), ("t", "b")))
    second = Arm(np.array([[0.0, 0.0]]), (("t", "a"),))
    found = Arms({"x": first, "y": second}, shared=True).contrasts([("x", "y")])["x", "y"]
    assert (found.value, found.sets) == (1.5, 1)


def test_shares_of_rejections_have_scipys_exact_interval_and_test() -> None:
    for rejected in range(11):
        p = np.array([0.01] * rejected + [0.5] * (10 - rejected))
        test = stats.binomtest(rejected, 10, 0.05, alternative="greater")
        known = stats.binomtest(rejected, 10).proportion_ci(0.95, method="exact")
        found = over_sets.share_rejected(p)
        assert (found.value, found.low, found.high) == pytest.approx((rejected / 10, known.low, known.high))
        assert over_sets.beyond_chance(p, 1) == (test.pvalue <= 0.05)
        assert over_sets.beyond_chance(p, 15) == (test.pvalue <= 0.05 / 15)


def test_two_rejections_of_ten_are_chance_and_three_are_not() -> None:
    assert not over_sets.beyond_chance(np.array([0.01] * 2 + [0.5] * 8), 1)
    assert over_sets.beyond_chance(np.array([0.01] * 3 + [0.5] * 7), 1)


def test_a_mean_above_a_bound_is_scipys_one_sided_t_test_by_bonferroni() -> None:
    values = np.array([0.06, 0.09, 0.04, 0.08, 0.07])
    p = stats.ttest_1samp(values, 0.05, alternative="greater").pvalue
    for rows in (1, 2, 5, 10):
        assert over_sets.above(values, 0.05, rows) == (p <= 0.05 / rows)
    assert not over_sets.above(values, 0.08, 1)
    assert over_sets.above(np.array([1.0, 1.0]), 0.05, 10)


def test_what_is_not_testable_does_not_count() -> None:
    found = over_sets.share_rejected(np.array([0.01, np.nan, 0.5]))
    assert (found.value, found.sets) == (0.5, 2)
    assert over_sets.mean(np.array([np.nan])).sets == 0


def test_what_too_few_source_sets_could_tell_apart_is_not_tested(
    scores: Callable[..., Arms], setting: Callable[..., Setting]
) -> None:
    few = scores(MEANS, sets=6)  # three pairs: 3 * 2/64 is above .05
    assert [found.tested for found in few.contrasts(PAIRS).values()] == [False] * 3
    assert few.contrasts(PAIRS[1:2])[PAIRS[1]].p == 2 / 64
    assert [row.holds for row in pair_findings(setting("variance 7"), few, PAIRS)] == [None] * 3
    assert [row.holds for row in pair_findings(setting("variance 7"), scores(MEANS, sets=7), PAIRS[1:])] == [
        True
    ] * 2
