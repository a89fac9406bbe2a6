"""Ranks of methods: a published table, scipy's tests, and what few blocks cannot show."""

from __future__ import annotations

from itertools import combinations, product

import numpy as np
import pytest
from scipy import stats

from qinit_cli.analysis.multiplicity import holm
from qinit_cli.analysis.ranks import rank_comparison, signed_rank_p

# Demsar (2006), table 6: ranks of C4.5 and three variants on 14 data sets
PUBLISHED = np.array(
    [
        [4, 3, 2, 1], [1, 2, 3, 4], [4, 1, 2, 3], [4, 1, 3, 2], [4, 2, 3, 1], [1, 2.5, 4, 2.5], [3, 2, 4, 1],
        [2.5, 2.5, 4, 1], [4, 3, 2, 1], [2.5, 2.5, 2.5, 2.5], [4, 2.5, 1, 2.5], [3, 2, 4, 1], [4, 1, 2, 3],
        [3, 1, 4, 2],
    ]
)  # fmt: skip


def test_mean_ranks_and_the_statistic_are_those_that_demsar_published() -> None:
    found = rank_comparison(PUBLISHED, fewest=True)
    assert found.mean_ranks == pytest.approx([3.143, 2.000, 2.893, 1.964], abs=5e-4)
    # 9.28 there, without the correction for ties: of 14 * 4 * (16 - 1) their t^3 - t are 3 * 6 + 60
    assert found.friedman * (1 - 78 / 840) == pytest.approx(9.28, abs=0.01)


def test_the_largest_value_has_rank_one_unless_the_fewest_are_best() -> None:
    values = np.array([[3.0, 2.0, 1.0], [5.0, 5.0, 0.0]])
    assert rank_comparison(values).mean_ranks.tolist() == [1.25, 1.75, 3.0]
    assert rank_comparison(values, fewest=True).mean_ranks.tolist() == [2.75, 2.25, 1.0]


def test_tests_are_those_of_scipy_with_holm_over_all_pairs() -> None:
    values = np.random.default_rng(0).normal(size=(12, 4)) + np.array([0, 0.1, 1, 3])
    found = rank_comparison(values)
    statistic, p = stats.friedmanchisquare(*values.T)
    assert (found.friedman, found.friedman_p) == pytest.approx((statistic, p))
    pairs = list(combinations(range(4), 2))
    single = [stats.wilcoxon(values[:, one], values[:, other]).pvalue for one, other in pairs]
    assert [found.pairs[pair] for pair in pairs] == pytest.approx(holm(np.array(single)).tolist())


@pytest.mark.parametrize("blocks", [1, 2, 7, 30, 50])
def test_without_ties_the_p_of_a_pair_is_the_exact_one_of_scipy(blocks: int) -> None:
    apart = np.random.default_rng(blocks).normal(0.3, size=blocks)
    assert signed_rank_p(apart) == pytest.approx(stats.wilcoxon(apart, method="exact").pvalue, rel=1e-12)


def test_with_ties_the_p_of_a_pair_is_counted_over_all_signs() -> None:
    assert signed_rank_p(np.full(5, 0.25)) == 2 / 32  # 0.025 by the normal approximation
    apart = np.array([1.0, 1.0, -1.0, 2.0, 2.0, 3.0])
    ranks = stats.rankdata(np.abs(apart))
    sums = np.array(list(product((0, 1), repeat=6))) @ ranks
    assert signed_rank_p(apart) == pytest.approx(2 * np.mean(sums <= ranks[2]))
    many = np.repeat(np.random.default_rng(0).normal(0.3, size=30), 2)
    assert signed_rank_p(many) == pytest.approx(stats.wilcoxon(many, method="asymptotic").pvalue)


def test_groups_join_what_no_pair_of_is_distinguished() -> None:
    steps = np.arange(1, 11)[:, None] / 100
    clear = rank_comparison(np.array([0.0, 1, 2, 3]) * 10 + steps * np.array([1, 2, 3, 4]))
    assert clear.alike() == []
    noise = steps * np.where(np.arange(10) % 2, 1, -1)[:, None]
    paired = rank_comparison(np.concatenate([np.zeros((10, 1)), noise, 10 + 2 * steps], axis=1))
    assert [sorted(group) for group in paired.alike()] == [[0, 1]]


@pytest.mark.parametrize(("methods", "fewest"), [(2, 6), (3, 7), (4, 8), (5, 9)])
def test_fewer_blocks_than_that_cannot_distinguish_the_clearest_methods(methods: int, fewest: int) -> None:
    for blocks in (fewest - 1, fewest):
        steps = np.arange(1, blocks + 1)[:, None] / 100
        found = rank_comparison(np.arange(methods) * 10 + steps * np.arange(1, methods + 1))
        assert found.fewest_blocks == fewest
        assert found.tested == (blocks == fewest)
        assert (found.pairs[0, 1] < 0.05) == found.tested
        assert found.distinguished(0, methods - 1) == found.tested


def test_equal_values_are_all_alike() -> None:
    found = rank_comparison(np.ones((8, 3)))
    assert (found.friedman, found.friedman_p) == (0.0, 1.0)
    assert found.alike() == [[0, 1, 2]]


def test_one_method_has_no_rank() -> None:
    with pytest.raises(ValueError, match="two methods"):
        rank_comparison(np.ones((3, 1)))
