from __future__ import annotations

import numpy as np
import pytest
from scipy import stats

from qinit_cli.analysis.aggregate import (
    improvements,
    interquartile_mean,
    probability_of_improvement,
    resampled_interquartile_means,
)
from qinit_cli.analysis.resampling import Crossed, Nested, crossed, nested, of_targets


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


def test_the_interquartile_mean_by_hand() -> None:
    # ten scores: two are cut at either end, 2 3 4 5 6 7 are kept
    assert interquartile_mean(np.array([[9.0, 0, 2, 4, 6], [1, 3, 5, 7, 800]])) == 4.5
    assert interquartile_mean(np.array([[1.0, 2, 30]])) == 11  # a quarter of three is none


def test_the_probability_of_improvement_by_hand() -> None:
    # the first target: 3 > 1, 3 = 3, 0 < 1, 0 < 3; the second: 5 > 4 twice, 5 > 2 twice
    assert (
        probability_of_improvement(np.array([[3.0, 5], [0, 5]]), np.array([[1.0, 4], [3, 2]]))
        == (1.5 / 4 + 1) / 2
    )


SAMPLES = [("of one set", 1, True), ("crossed", 4, True), ("nested", 4, False)]


def _drawn(sets: int, shared: bool, targets: int = 9) -> Crossed | Nested:
    rng = np.random.default_rng(6)
    if sets == 1:
        return next(iter(of_targets(targets, rng, 40)))
    return next(iter((crossed if shared else nested)(sets, targets, rng, 40)))


@pytest.mark.parametrize(("name", "sets", "shared"), SAMPLES)
def test_resampled_interquartile_means_are_those_of_the_samples_written_out(
    name: str, sets: int, shared: bool
) -> None:
    values = np.random.default_rng(7).exponential(1, (sets, 9))
    counts = _drawn(sets, shared).counts()
    assert (counts.sum(axis=1) == values.size).all()
    expected = [stats.trim_mean(np.repeat(values.ravel(), held), 0.25) for held in counts]
    np.testing.assert_allclose(resampled_interquartile_means(values, counts), expected, rtol=1e-12)


def test_resampled_probabilities_are_those_of_the_samples_written_out() -> None:
    rng = np.random.default_rng(8)
    method, baseline = rng.integers(0, 5, (2, 4, 9)) * 1.0
    sample = _drawn(4, shared=True)
    assert isinstance(sample, Crossed)
    expected = []
    for chosen, met in zip(sample.chosen.astype(int), sample.met.astype(int), strict=True):
        at = np.ix_(np.repeat(np.arange(4), chosen), np.repeat(np.arange(9), met))
        expected.append(probability_of_improvement(method[at], baseline[at]))
    found = sample.pair_means(improvements(method[:, None], baseline[None]))
    np.testing.assert_allclose(found, expected, rtol=1e-12)


@pytest.mark.parametrize(("name", "sets", "shared"), SAMPLES)
def test_resampled_means_are_those_of_the_samples_written_out(name: str, sets: int, shared: bool) -> None:
    values = np.random.default_rng(9).normal(size=(sets, 9, 3))
    sample = _drawn(sets, shared)
    expected = [np.repeat(values.reshape(-1, 3), held, axis=0).mean(axis=0) for held in sample.counts()]
    np.testing.assert_allclose(sample.means(values), expected, atol=1e-14)
