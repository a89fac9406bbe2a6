from __future__ import annotations

import numpy as np
import pytest
from scipy import stats

from qinit_cli.analysis import permutation
from qinit_cli.analysis.permutation import (
    adjusted,
    can_be_small,
    fewest_units,
    least_p,
    paired_p,
    sign_flip_p,
)


@pytest.mark.parametrize("at_once", [1_000_000, 100])
def test_few_targets_give_scipys_exact_p(monkeypatch: pytest.MonkeyPatch, at_once: int) -> None:
    monkeypatch.setattr(permutation, "_VALUES_AT_ONCE", at_once)
    differences = np.random.default_rng(0).normal([0.5, 0.0, -2.0], 1, (11, 3))
    found = sign_flip_p(differences, np.random.default_rng(1))
    for metric in range(3):
        column = differences[:, metric]
        known = stats.permutation_test(
            (column, np.zeros(11)),
            lambda a, b, axis: np.mean(a - b, axis=axis),
            vectorized=True,
            permutation_type="samples",
        ).pvalue
        assert found[metric] == pytest.approx(known, abs=1e-12)


def test_three_targets_by_hand() -> None:
    p = sign_flip_p(np.array([[1.0, 1.0], [2.0, -1.0], [3.0, 0.0]]), np.random.default_rng(0))
    assert p[0] == 2 / 8  # only all signs alike are as extreme
    assert p[1] == 1.0


def test_random_patterns_approach_the_exact_p() -> None:
    differences = np.random.default_rng(2).normal(0.5, 1, (12, 1))
    exact = sign_flip_p(differences, np.random.default_rng(3))[0]
    drawn = sign_flip_p(differences, np.random.default_rng(3), resamples=4000)[0]
    assert exact != drawn
    assert drawn == pytest.approx(exact, abs=4 * np.sqrt(exact / 4000))


def test_p_is_uniform_where_the_methods_are_equal_and_never_nought() -> None:
    rng = np.random.default_rng(4)
    p = sign_flip_p(rng.normal(0, 1, (30, 500)), rng, resamples=999)
    assert stats.kstest(p, "uniform").pvalue > 0.01
    certain = sign_flip_p(np.ones((100, 1)), rng, resamples=999)
    assert certain[0] == 1 / 1000


def test_equal_methods_have_p_one() -> None:
    assert sign_flip_p(np.zeros((5, 1)), np.random.default_rng(0))[0] == 1
    assert sign_flip_p(np.zeros((200, 1)), np.random.default_rng(0), resamples=99)[0] == 1


def test_the_least_p_is_what_the_test_gives_where_all_differences_are_alike() -> None:
    for units in (1, 2, 6, 13, 20):
        alike = sign_flip_p(np.ones((units, 1)), np.random.default_rng(0))[0]
        assert least_p(units) == alike


def test_enough_units_are_those_that_holm_lets_come_to_the_level() -> None:
    assert fewest_units(1) == 6  # 2/64; of five units 2/32 is above
    assert fewest_units(4) == 8  # 4 * 2/256; of seven 4 * 2/128 is above
    assert fewest_units(500) == 14  # 500/10,001
    assert fewest_units(501) == 0
    assert can_be_small(np.array([8] * 4)).all()
    assert not can_be_small(np.array([7] * 4)).any()
    # five units of 1 test that comes last by Holm: 2/32 itself is above; six come to it behind the others
    assert can_be_small(np.array([14, 14, 6, 5])).tolist() == [True, True, False, False]
    assert can_be_small(np.array([14, 14, 6])).tolist() == [True, True, True]


def test_a_p_that_could_not_be_small_is_none() -> None:
    p = np.array([0.001, 0.01, 0.04])
    np.testing.assert_allclose(adjusted(p, np.array([14, 14, 14])), [0.003, 0.02, 0.04])
    # three units can come to 2/8 at best, the others to theirs beside it
    np.testing.assert_allclose(adjusted(p, np.array([14, 14, 3])), [0.003, 0.02, np.nan])


def test_targets_flip_of_one_source_set_and_whole_sets_of_several() -> None:
    rng = np.random.default_rng(0)
    assert paired_p(np.ones((1, 6)), rng) == 2 / 2**6
    assert paired_p(np.ones((2, 6)), rng) == 2 / 2**2
    assert paired_p(np.ones((4, 6)), rng) == 2 / 2**4
