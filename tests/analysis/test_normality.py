from __future__ import annotations

import time

import numpy as np
import pytest
from scipy import stats
from statsmodels.stats.diagnostic import lilliefors as statsmodels_lilliefors
from statsmodels.stats.diagnostic import normal_ad

from qinit_cli.analysis.empirical_tests import lilliefors
from qinit_cli.analysis.normality import named_tests, normality, tasks_tested
from qinit_cli.analysis.shapiro import shapiro_wilk, weights


def mixed(tasks: int, cells: tuple[int, ...], seed: int = 0) -> np.ndarray:
    """Samples from normal to badly skewed, cell by cell."""
    rng = np.random.default_rng(seed)
    return np.sinh(rng.normal(0, 1, (tasks, *cells)) * rng.uniform(0.01, 3, cells)) * 1e-3


@pytest.mark.parametrize("tasks", [8, 11, 12, 30, 100, 1000, 5000])
def test_shapiro_wilk_equals_scipys_cell_by_cell(tasks: int) -> None:
    values = mixed(tasks, (30,))
    found = normality(values, np.ones(values.shape, dtype=bool))
    for cell in range(30):
        known = stats.shapiro(values[:, cell])
        assert found.statistic[cell] == pytest.approx(known.statistic, abs=1e-8)
        assert found.p[cell] == pytest.approx(known.pvalue, rel=1e-5, abs=1e-8)
        assert found.skewness[cell] == pytest.approx(stats.skew(values[:, cell]), rel=1e-9)
        assert found.kurtosis[cell] == pytest.approx(stats.kurtosis(values[:, cell]), rel=1e-9)


@pytest.mark.parametrize("n", [4, 5, 6, 100])
def test_shapiros_weights_have_unit_length_and_no_sum(n: int) -> None:
    assert np.sum(weights(n) ** 2) == pytest.approx(1, rel=1e-12)
    assert np.sum(weights(n)) == pytest.approx(0, abs=1e-12)


@pytest.mark.parametrize("n", [4, 5, 6, 7, 11])
def test_the_smallest_samples_equal_scipys_however_far_from_normal(n: int) -> None:
    lopsided = np.array([0.0] * (n - 1) + [1.0])
    for sample in (lopsided, np.arange(n) * 1.0, np.arange(n) ** 3.0):
        found, known = shapiro_wilk(sample[None]), stats.shapiro(sample)
        assert found[0][0] == pytest.approx(known.statistic, abs=1e-8)
        assert found[1][0] == pytest.approx(known.pvalue, rel=1e-5)


def test_anderson_darling_equals_statsmodels() -> None:
    values = mixed(60, (200,))
    found = normality(
        values, np.ones(values.shape, dtype=bool), named_tests(np.random.default_rng(0))["anderson-darling"]
    )
    statistic, p = normal_ad(values, axis=0)
    tame = np.abs(values - values.mean(axis=0)).max(axis=0) < 4 * values.std(
        axis=0
    )  # else theirs loses digits
    np.testing.assert_allclose(found.statistic[tame], statistic[tame], rtol=1e-8)
    np.testing.assert_allclose(found.p[tame], p[tame], rtol=1e-7)
    assert tame.sum() > 50
    assert (found.p[~tame] < 0.05).mean() > 0.9


def test_lilliefors_equals_statsmodels_statistic_and_its_table_within_simulation_error() -> None:
    values = mixed(100, (100,))  # a size their table holds: between sizes it is a quarter off
    found = normality(
        values, np.ones(values.shape, dtype=bool), named_tests(np.random.default_rng(0))["lilliefors"]
    )
    for cell in range(100):
        statistic, p = statsmodels_lilliefors(values[:, cell])
        assert found.statistic[cell] == pytest.approx(statistic, rel=1e-9)
        if 0.001 < p < 0.99:  # their table ends there, and is linear between few points
            assert found.p[cell] == pytest.approx(p, abs=0.03 if p > 0.1 else 0.008)


@pytest.mark.parametrize("name", ["shapiro-wilk", "anderson-darling", "lilliefors"])
def test_one_in_twenty_normal_cells_is_rejected_at_five_percent(name: str) -> None:
    rng = np.random.default_rng(5)
    values = rng.normal(rng.uniform(-9, 9, 4000), rng.uniform(0.1, 9, 4000), (40, 4000))
    p = normality(values, np.ones(values.shape, dtype=bool), named_tests(rng)[name]).p
    assert np.mean(p < 0.05) == pytest.approx(0.05, abs=0.012)


def test_masked_entries_have_no_say() -> None:
    values = mixed(50, (20,))
    counted = np.random.default_rng(1).random(values.shape) < 0.6
    found = normality(np.where(counted, values, 1e9), counted)
    np.testing.assert_array_equal(found.n, counted.sum(axis=0))
    for cell in range(20):
        assert found.p[cell] == pytest.approx(stats.shapiro(values[counted[:, cell], cell]).pvalue, rel=1e-6)


def test_too_few_tasks_or_equal_ones_are_not_testable() -> None:
    values = np.random.default_rng(0).normal(size=(20, 3))
    values[:, 1] = 7.0
    counted = np.ones(values.shape, dtype=bool)
    counted[7:, 0] = False
    found = normality(values, counted)
    for statistic in (found.statistic, found.p, found.skewness, found.kurtosis):
        np.testing.assert_array_equal(np.isnan(statistic), [True, True, False])
    np.testing.assert_array_equal(found.n, [7, 20, 20])


@pytest.mark.parametrize("tasks", range(1, 8))
@pytest.mark.parametrize("name", ["shapiro-wilk", "anderson-darling", "lilliefors"])
def test_samples_of_any_small_size_are_not_testable(tasks: int, name: str) -> None:
    values = np.random.default_rng(0).normal(size=(tasks, 2))
    found = normality(values, np.ones(values.shape, dtype=bool), named_tests(np.random.default_rng(0))[name])
    assert np.isnan(found.p).all()
    assert (found.n == tasks).all()


def test_the_papers_grid_takes_less_than_a_second_of_processor_time() -> None:
    values = mixed(100, (30, 30, 4))
    normality(values[:, :2], np.ones((100, 2, 30, 4), dtype=bool))  # the imports are not what is measured
    start = time.process_time()
    assert normality(values, np.ones(values.shape, dtype=bool)).p.shape == (30, 30, 4)
    assert time.process_time() - start < 1


def test_at_most_the_given_number_of_tasks_is_drawn_without_repetition() -> None:
    rng = np.random.default_rng(0)
    np.testing.assert_array_equal(tasks_tested(5, rng), np.arange(5))
    drawn = tasks_tested(20_000, rng)
    assert len(drawn) == 5_000
    assert (np.diff(drawn) > 0).all()
    assert drawn.mean() == pytest.approx(10_000, rel=0.05)


def test_a_sample_farther_off_than_every_simulated_one_has_the_least_p() -> None:
    """The sample itself counts among the simulated ones, so that p is never 0."""
    far = np.sort(np.append(np.random.default_rng(0).normal(0, 1, 29), 1e6))[None]
    statistic, p = lilliefors(far, np.random.default_rng(1), resamples=99)
    assert statistic[0] > 0.4  # of 30 normal values, one in 10^9 at most
    assert p[0] == 1 / 100
