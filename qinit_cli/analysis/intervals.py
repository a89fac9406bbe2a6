"""95 % percentile bootstrap intervals of means: over targets, over source sets and targets, or nested.

One source set resamples its targets, and the interval is conditional on that set. Several sets that share
their targets resample both independently (pigeonhole; Owen, 2007); sets with targets of their own are
resampled, and the targets within each. Intervals are not corrected for how many there are.

Each resample enters as counts, how often it holds a value, so that all metrics of a table cost one product.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np

from qinit_cli.arrays import Floats, Integers

RESAMPLES = 10_000
LEVEL = 0.95
FEW_SOURCE_SETS = 5  # below, coverage is under nominal: the bootstrap knows a spread of n - 1 degrees poorly

_VALUES_AT_ONCE = 1_000_000  # of one block of resamples: what bounds the memory


@dataclass(frozen=True)
class Interval:
    """Estimates and their intervals, one per metric (M,); low and high are NaN where there is one unit."""

    estimate: Floats
    low: Floats
    high: Floats


def over_targets(values: Floats, rng: np.random.Generator, resamples: int = RESAMPLES) -> Interval:
    """Mean of `values` (T, M) over the targets, conditional on one source set.

    For a paired difference pass the differences on the same targets. One target alone has no interval.
    """
    if len(values) < 2:
        return _unknown(values.mean(axis=0))
    return percentiles(values.mean(axis=0), resampled_means(values, rng, resamples))


def pigeonhole(values: Floats, rng: np.random.Generator, resamples: int = RESAMPLES) -> Interval:
    """Mean of `values` (R, T, M): R source sets that met the same T targets, both resampled independently."""
    sets, targets, _ = values.shape
    if sets < 2 or targets < 2:
        return _unknown(values.mean(axis=(0, 1)))

    def counts(block: int) -> Floats:
        chosen = _counts(rng.integers(0, sets, (block, sets)), sets)
        met = _counts(rng.integers(0, targets, (block, targets)), targets)
        return (chosen[:, :, None] * met[:, None, :]).reshape(block, sets * targets)

    return _of_counts(values, counts, resamples)


def nested(values: Floats, rng: np.random.Generator, resamples: int = RESAMPLES) -> Interval:
    """Mean of `values` (R, T, M): R source sets with T targets of their own; sets, then targets in them."""
    sets, targets, _ = values.shape
    if sets < 2:
        return _unknown(values.mean(axis=(0, 1)))

    def counts(block: int) -> Floats:
        chosen = rng.integers(0, sets, (block, sets, 1))
        met = rng.integers(0, targets, (block, sets, targets))
        return _counts((chosen * targets + met).reshape(block, sets * targets), sets * targets)

    return _of_counts(values, counts, resamples)


def resampled_means(values: Floats, rng: np.random.Generator, resamples: int = RESAMPLES) -> Floats:
    """Means of `resamples` samples with replacement of the rows of `values` (T, M), (resamples, M).

    The same draws as scipy.stats.bootstrap makes from the same generator.
    """
    targets = len(values)
    flat = values.reshape(targets, -1)
    means = np.concatenate(
        [
            _counts(rng.integers(0, targets, (block, targets)), targets) @ flat / targets
            for block in _blocks(resamples, targets)
        ]
    )
    return means.reshape(resamples, *values.shape[1:])


def percentiles(estimate: Floats, resampled: Floats, level: float = LEVEL) -> Interval:
    """The interval that leaves out (1 - level)/2 of the `resampled` (resamples, M) on either side."""
    low, high = np.quantile(resampled, [(1 - level) / 2, (1 + level) / 2], axis=0)
    return Interval(estimate=np.asarray(estimate), low=low, high=high)


def _of_counts(values: Floats, counts: Callable[[int], Floats], resamples: int) -> Interval:
    sets, targets, metrics = values.shape
    flat = values.reshape(sets * targets, metrics)
    means = [counts(block) @ flat / (sets * targets) for block in _blocks(resamples, sets * targets)]
    return percentiles(flat.mean(axis=0), np.concatenate(means))


def _counts(drawn: Integers, values: int) -> Floats:
    """How often each of `values` stands in each row of `drawn`, (rows, values)."""
    rows = len(drawn)
    places = drawn + values * np.arange(rows)[:, None]
    return np.bincount(places.ravel(), minlength=rows * values).reshape(rows, values).astype(np.float64)


def _blocks(resamples: int, values: int) -> Iterator[int]:
    most = max(1, _VALUES_AT_ONCE // values)
    for done in range(0, resamples, most):
        yield min(most, resamples - done)


def _unknown(estimate: Floats) -> Interval:
    return Interval(
        estimate=estimate, low=np.full_like(estimate, np.nan), high=np.full_like(estimate, np.nan)
    )
