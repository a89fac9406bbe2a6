from __future__ import annotations

import numpy as np
import pytest
from scipy import stats

from qinit_cli.analysis.intervals import tails
from qinit_cli.analysis.resampling import of_targets
from qinit_cli.analysis.transfer_ratio import transfer_ratio


def ratio(values: np.ndarray, zero: np.ndarray, seed: int = 1):
    """Of values on the same targets, (T,) each."""
    pairs = np.stack([values, zero], axis=1)[None]
    rng = np.random.default_rng(seed)
    means = np.concatenate([sample.means(pairs) for sample in of_targets(len(zero), rng)])
    return transfer_ratio(values.mean(), zero.mean(), means[:, 0], means[:, 1], len(zero))


def test_an_exact_multiple_has_that_ratio_and_no_width() -> None:
    zero = np.random.default_rng(0).uniform(1, 2, 40)
    found = ratio(3 * zero, zero)
    assert [found.estimate, found.low, found.high] == pytest.approx([3, 3, 3])


def test_the_interval_is_scipys_paired_bootstrap_of_the_ratio() -> None:
    rng = np.random.default_rng(2)
    zero = rng.exponential(1, 60)
    values = zero * rng.uniform(0.5, 2, 60) + 0.3
    known = stats.bootstrap(
        (values, zero),
        lambda x, y, axis: x.mean(axis=axis) / y.mean(axis=axis),
        paired=True,
        method="percentile",
        confidence_level=1 - 2 * tails(60)[0],
        n_resamples=10_000,
        rng=np.random.default_rng(3),
    ).confidence_interval
    found = ratio(values, zero)
    assert found.estimate == pytest.approx(values.mean() / zero.mean())
    width = known.high - known.low
    assert found.low == pytest.approx(known.low, abs=0.04 * width)
    assert found.high == pytest.approx(known.high, abs=0.04 * width)


def test_where_learning_from_zero_earns_nothing_there_is_no_ratio() -> None:
    rng = np.random.default_rng(4)
    zero = np.zeros(50)
    zero[0] = 1e-3  # one lucky target: the interval of the mean touches 0
    for baseline in (zero, np.zeros(50)):
        found = ratio(rng.uniform(1, 2, 50), baseline)
        assert np.isnan([found.estimate, found.low, found.high]).all()
