from __future__ import annotations

import numpy as np
import pytest
from scipy import stats

from qinit_cli.analysis import permutation
from qinit_cli.analysis.permutation import sign_flip_p


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
