from __future__ import annotations

import numpy as np
import pytest
from scipy import stats

from qinit_cli.analysis.aggregate import bootstrap, interquartile_mean, probability_of_improvement
from qinit_cli.analysis.intervals import nested, over_targets, pigeonhole


@pytest.mark.parametrize("shape", [(1, 1), (1, 7), (3, 5), (10, 200)])
def test_the_interquartile_mean_is_rliables(shape: tuple[int, int]) -> None:
    scores = np.random.default_rng(0).exponential(1, shape)
    assert interquartile_mean(scores) == pytest.approx(stats.trim_mean(scores, 0.25, axis=None), rel=1e-12)


def test_the_probability_of_improvement_is_rliables() -> None:
    rng = np.random.default_rng(1)
    method, baseline = rng.integers(0, 5, (6, 9)) * 1.0, rng.integers(0, 5, (4, 9)) * 1.0
    # rliable: the mean over tasks of the Mann-Whitney statistic over the number of pairs of runs
    known = [
        stats.mannwhitneyu(method[:, t], baseline[:, t], alternative="greater").statistic / 24
        for t in range(9)
    ]
    assert probability_of_improvement(method, baseline) == pytest.approx(np.mean(known), rel=1e-12)


def test_one_source_set_compares_in_pairs() -> None:
    assert probability_of_improvement(np.array([[1.0, 2, 3, 4]]), np.array([[0.0, 2, 9, 9]])) == 1.5 / 4


def test_the_bootstrap_of_a_mean_is_the_interval_of_the_mean() -> None:
    rng = np.random.default_rng(2)
    values = rng.exponential(1, (8, 30)) + rng.exponential(1, 30)  # targets differ for all sets

    def mean(scores: np.ndarray) -> float:
        return float(scores.mean())

    one = bootstrap(mean, (values[:1],), np.random.default_rng(3), shared_targets=True, resamples=4000)
    known = over_targets(values[0, :, None], np.random.default_rng(4))
    several = bootstrap(mean, (values,), np.random.default_rng(3), shared_targets=True, resamples=4000)
    crossed = pigeonhole(values[:, :, None], np.random.default_rng(4))
    own = bootstrap(mean, (values,), np.random.default_rng(3), shared_targets=False, resamples=4000)
    within = nested(values[:, :, None], np.random.default_rng(4))
    for found, expected in ((one, known), (several, crossed), (own, within)):
        width = expected.high[0] - expected.low[0]
        assert found.estimate == pytest.approx(expected.estimate[0])
        assert found.low == pytest.approx(expected.low[0], abs=0.06 * width)
        assert found.high == pytest.approx(expected.high[0], abs=0.06 * width)


def test_methods_are_resampled_together() -> None:
    rng = np.random.default_rng(5)
    baseline = rng.normal(0, 9, (3, 20))
    for shared in (True, False):
        found = bootstrap(
            probability_of_improvement,
            (baseline[:1] + 1e-3, baseline[:1]),
            rng,
            shared_targets=shared,
            resamples=200,
        )
        assert (found.estimate, found.low, found.high) == (1, 1, 1)


def test_one_target_has_no_interval() -> None:
    found = bootstrap(interquartile_mean, (np.ones((3, 1)),), np.random.default_rng(0), shared_targets=True)
    assert found.estimate == 1
    assert np.isnan([found.low, found.high]).all()
