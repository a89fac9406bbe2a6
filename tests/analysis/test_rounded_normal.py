from __future__ import annotations

import numpy as np
import pytest
from scipy import stats

from qinit_cli.analysis.normality import normality
from qinit_cli.analysis.rounded_normal import dithered, rounded_normality, rounded_parameters


def rounded(deviation: float, cells: int, seed: int = 0) -> np.ndarray:
    rng = np.random.default_rng(seed)
    return np.rint(rng.normal(rng.uniform(10, 40, cells), deviation, (100, cells)))


def everywhere(values: np.ndarray) -> np.ndarray:
    return np.ones(values.shape, dtype=bool)


@pytest.mark.parametrize("deviation", [0.4, 1.0, 2.0, 6.0])
def test_rounded_normals_are_seldom_rejected_where_the_plain_test_rejects_for_the_rounding(
    deviation: float,
) -> None:
    lengths = rounded(deviation, 600)
    found = rounded_normality(lengths, everywhere(lengths), np.random.default_rng(1), resamples=199)
    assert np.nanmean(found.p < 0.05) < 0.08
    if deviation <= 1:
        assert np.nanmean(normality(lengths, everywhere(lengths)).p < 0.05) > 0.9


@pytest.mark.parametrize("centre", [0.0, 5.0])
def test_lengths_that_are_not_normal_are_found_out(centre: float) -> None:
    rng = np.random.default_rng(2)
    lengths = np.rint(centre + rng.exponential(6.0, (100, 50)))
    found = rounded_normality(lengths, everywhere(lengths), rng, resamples=199)
    assert (found.p < 0.01).all()
    np.testing.assert_allclose(found.statistic[0], stats.shapiro(lengths[:, 0]).statistic, atol=1e-8)


WIDE = np.rint(np.random.default_rng(3).gamma(9.0, 1.0, 60))
NARROW = np.array([11.0] + [12.0] * 58 + [13.0])  # an eighth of its null's samples have no spread


@pytest.mark.parametrize("lengths", [WIDE, NARROW])
def test_p_is_the_share_of_a_plain_parametric_bootstrap(lengths: np.ndarray) -> None:
    rng = np.random.default_rng(4)
    found = rounded_normality(lengths[:, None], everywhere(lengths[:, None]), rng, resamples=3000)
    centre, deviation = rounded_parameters(lengths.mean(keepdims=True), lengths.var(keepdims=True))
    statistics = []
    for _ in range(1500):
        sample = np.rint(rng.normal(centre[0], deviation[0], 60))
        statistics.append(stats.shapiro(sample).statistic if np.ptp(sample) > 0 else 1.0)
    share = np.mean(np.array(statistics) <= found.statistic[0] + 1e-8)
    assert found.p[0] == pytest.approx(share, abs=0.05)


@pytest.mark.parametrize("deviation", [0.2, 0.35, 0.6, 0.72, 1.5, 9.0])
def test_the_null_has_the_samples_mean_and_variance(deviation: float) -> None:
    fractions = np.linspace(0, 0.99, 12)
    levels = np.arange(-80, 81)[:, None]
    edges = stats.norm.cdf((np.arange(-80.5, 81.5)[:, None] - fractions) / deviation)
    mean = np.sum(levels * np.diff(edges, axis=0), axis=0)
    variance = np.sum((levels - mean) ** 2 * np.diff(edges, axis=0), axis=0)
    centre, found = rounded_parameters(mean + 30, variance)
    recoverable = variance > 1e-4  # a certain length says nothing of where its normal lay
    tolerance = 0.004 if deviation > 0.7 else 1e-3
    two_valued = deviation < 0.3  # many normals round to the same two values
    if not two_valued:
        np.testing.assert_allclose(found[recoverable], deviation, rtol=tolerance)
        np.testing.assert_allclose(centre[recoverable] - 30, fractions[recoverable], atol=tolerance)
    again = stats.norm.cdf((np.arange(-80.5, 81.5)[:, None] - (centre - 30)) / found)
    np.testing.assert_allclose(np.sum(levels * np.diff(again, axis=0), axis=0), mean, atol=2e-3)


def test_masked_short_and_constant_cells_are_treated_as_by_the_plain_test() -> None:
    lengths = rounded(3.0, 3)
    lengths[:, 1] = 12
    counted = everywhere(lengths)
    counted[7:, 0] = False
    found = rounded_normality(lengths, counted, np.random.default_rng(0), resamples=99)
    np.testing.assert_array_equal(np.isnan(found.p), [True, True, False])
    np.testing.assert_array_equal(found.n, [7, 100, 100])


def test_dither_makes_wide_lengths_continuous_and_normal() -> None:
    lengths = rounded(3.0, 500)
    noisy = dithered(lengths, np.random.default_rng(4))
    assert np.abs(noisy - lengths).max() <= 0.5
    assert np.mean(normality(noisy, everywhere(noisy)).p < 0.05) < 0.08
