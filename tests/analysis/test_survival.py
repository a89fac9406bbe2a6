from __future__ import annotations

import numpy as np
import pytest
from statsmodels.duration.survfunc import SurvfuncRight

from qinit_cli.analysis.survival import kaplan_meier, resampled_medians, time_to_threshold


def test_the_time_is_the_end_of_the_first_window_that_is_good_enough() -> None:
    curves = np.zeros((4, 100))
    curves[0, 10:] = 1.0  # a 50-episode mean of a half needs 25 ones
    curves[1, 99] = 1.0
    curves[2] = 0.1
    times, reached = time_to_threshold(curves, np.array([0.5, 0.5, 0.1, 0.2]))
    np.testing.assert_array_equal(times, [50, 100, 50, 100])
    np.testing.assert_array_equal(reached, [True, False, True, False])
    late = np.zeros((1, 100))
    late[0, 60:] = 1.0
    assert time_to_threshold(late, np.array([0.5]))[0][0] == 85


def test_a_run_shorter_than_the_window_never_reaches() -> None:
    times, reached = time_to_threshold(np.ones((2, 20)), np.array([0.5, 0.5]))
    assert not reached.any()
    np.testing.assert_array_equal(times, [20, 20])


def test_windows_equal_a_plain_loop() -> None:
    curves = np.random.default_rng(0).random((30, 120))
    threshold = np.full(30, 0.55)
    times, reached = time_to_threshold(curves, threshold, window=10)
    for target in range(30):
        ends = [e for e in range(10, 121) if curves[target, e - 10 : e].mean() >= 0.55]
        assert times[target] == (ends[0] if ends else 120)
        assert reached[target] == bool(ends)


@pytest.mark.parametrize("seed", range(5))
def test_survival_equals_statsmodels(seed: int) -> None:
    rng = np.random.default_rng(seed)
    event, cut = rng.integers(1, 40, 80), rng.integers(1, 60, 80)
    times, reached = np.minimum(event, cut), event <= cut
    found = kaplan_meier(times, reached, 60)
    known = SurvfuncRight(times, reached.astype(int))
    happened = known.n_events > 0
    np.testing.assert_array_equal(found.times, known.surv_times[happened])
    np.testing.assert_allclose(found.below, known.surv_prob[happened], atol=1e-12)
    assert found.median == known.quantile(0.5)
    assert found.censored == pytest.approx(1 - reached.mean())


def test_three_targets_by_hand() -> None:
    found = kaplan_meier(np.array([50, 80, 100]), np.array([True, True, False]), 100)
    np.testing.assert_allclose(found.below, [2 / 3, 1 / 3])
    assert found.median == 80
    assert found.restricted_mean == pytest.approx((50 + 80 + 100) / 3)
    assert found.censored == pytest.approx(1 / 3)


def test_where_none_arrives_the_median_is_infinite_and_the_mean_the_limit() -> None:
    found = kaplan_meier(np.array([100, 100]), np.array([False, False]), 100)
    assert found.median == np.inf
    assert found.restricted_mean == 100
    assert found.censored == 1


def test_without_censoring_the_restricted_mean_is_the_mean() -> None:
    times = np.random.default_rng(1).integers(1, 90, 40)
    assert kaplan_meier(times, np.ones(40, dtype=bool), 100).restricted_mean == pytest.approx(times.mean())


def test_resampled_medians_are_kaplan_meiers_of_the_samples_written_out() -> None:
    rng = np.random.default_rng(2)
    times, reached = time_to_threshold(rng.random((30, 120)), np.full(30, 0.71), window=10)
    assert 0.2 < reached.mean() < 0.8
    counts = rng.multinomial(30, np.full(30, 1 / 30), 200)
    expected = [kaplan_meier(np.repeat(times, held), np.repeat(reached, held), 120).median for held in counts]
    assert np.isinf(expected).any()
    assert np.isfinite(expected).any()
    np.testing.assert_array_equal(resampled_medians(times, reached, counts), expected)
