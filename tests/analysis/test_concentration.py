from __future__ import annotations

import numpy as np
import pytest
from scipy import stats

from qinit_cli.analysis.concentration import effective_number, largest_share


def test_equal_weights_count_in_full_and_one_alone_counts_as_one() -> None:
    assert effective_number(np.full(8, 0.125)) == pytest.approx(8)
    assert effective_number(np.array([0.0, 1.0, 0.0])) == 1


def test_the_effective_number_is_the_exponential_of_renyis_entropy_of_order_two() -> None:
    weights = np.random.default_rng(0).dirichlet(np.ones(6), size=(4, 3))
    # differential_entropy has no order two; the entropy of order two is minus the log of the probability that two draws agree
    probability = np.array([[sum(each * each for each in row) for row in block] for block in weights])
    np.testing.assert_allclose(effective_number(weights), np.exp(-np.log(probability)))
    assert (effective_number(weights) <= np.exp(stats.entropy(weights, axis=-1))).all()


def test_weights_need_not_sum_to_one() -> None:
    weights = np.array([1.0, 2.0, 5.0])
    assert effective_number(weights) == effective_number(weights / 8)
    assert largest_share(weights) == 5 / 8
