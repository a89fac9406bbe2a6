from __future__ import annotations

import numpy as np

from qinit_cli.analysis.held_out import held_out_error

START = np.array([[0.5, 0.25]])


def test_errors_by_hand() -> None:
    q = np.array([[[0.5, 0.25]], [[0.25, 0.5]], [[1.0, 0.0]], [[0.0, 0.0]]])
    found = held_out_error(START, q)
    np.testing.assert_allclose(found.absolute, [0, 0.25, 0.375, 0.375])
    np.testing.assert_allclose(found.squared, np.sqrt([0, 0.0625, 0.3125 / 2, 0.3125 / 2]))
    np.testing.assert_allclose(found.bias, [0, 0, -0.125, 0.375])
    np.testing.assert_allclose(found.logarithmic, [0, np.log(2), np.log(2), np.nan])
    np.testing.assert_allclose(found.log_share, [1, 1, 0.5, 0])


def test_the_median_of_a_log_normal_errs_least_in_the_logarithm_and_the_mean_least_in_squares() -> None:
    q = np.exp(np.random.default_rng(0).normal(-3, 1, (20_000, 1, 1)))
    median = held_out_error(np.full((1, 1), np.exp(-3.0)), q)
    mean = held_out_error(np.full((1, 1), np.exp(-2.5)), q)
    assert median.logarithmic.mean() < mean.logarithmic.mean()
    assert (mean.squared**2).mean() < (median.squared**2).mean()
