"""Shares of variance: a balanced grid worked by hand, one with gaps, and factors that mean nothing to some."""

from __future__ import annotations

import math

import numpy as np
import pytest

from qinit_cli.analysis.variance_shares import variance_shares

# two rows, two columns, two of each: cell means 2, 6, 4, 12 about a grand mean of 6, each -1 and +1 about its own
GRID = np.array([1, 3, 5, 7, 3, 5, 11, 13], np.float64)
ROWS, COLUMNS = np.array([0, 0, 0, 0, 1, 1, 1, 1]), np.array([0, 0, 1, 1, 0, 0, 1, 1])


def test_a_balanced_grid_has_the_sums_of_squares_of_any_analysis_of_variance() -> None:
    # rows 4 and 8: 8 * 4 = 32; columns 3 and 9: 8 * 9 = 72; interaction 8 * 1; within 8 * 1; in all 120
    found = variance_shares(GRID, [ROWS, COLUMNS])
    assert found.main == pytest.approx([32 / 120, 72 / 120])
    assert (found.interactions, found.residual) == pytest.approx((8 / 120, 8 / 120))
    assert found.replicated


def test_a_factor_that_repeats_another_has_half_of_what_both_explain() -> None:
    found = variance_shares(GRID, [ROWS, COLUMNS, COLUMNS])
    assert found.main == pytest.approx([32 / 120, 36 / 120, 36 / 120])


def test_shares_of_a_grid_with_gaps_are_those_of_both_orders_averaged() -> None:
    values, a, b = np.array([0.0, 3.0, 9.0]), np.array([0, 0, 1]), np.array([0, 1, 1])
    # about the mean of 4: 16 + 1 + 25 = 42; a alone leaves 4.5, b alone 18, both nothing
    found = variance_shares(values, [a, b])
    assert found.main * 42 == pytest.approx([(37.5 + 18) / 2, (24 + 4.5) / 2])
    assert found.main.sum() == pytest.approx(1)
    assert not found.replicated


def test_a_factor_explains_nothing_of_the_difference_to_those_that_lack_it() -> None:
    values, method, option = np.array([0.0, 0.0, 9.0, 11.0]), np.array([0, 0, 1, 1]), np.array([-1, -1, 0, 1])
    found = variance_shares(values, [method, option])
    assert found.main == pytest.approx([100 / 102, 2 / 102])


def test_equal_values_have_no_shares() -> None:
    found = variance_shares(np.full(4, 0.1) + 0.2, [np.array([0, 0, 1, 1])])
    assert math.isnan(found.residual)
    assert np.isnan(found.main).all()
