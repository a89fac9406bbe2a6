"""95 % percentile bootstrap intervals of means: over targets, over source sets and targets, or nested.

How each resamples stands in `resampling`. Intervals are not corrected for how many there are.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from qinit_cli.analysis import resampling
from qinit_cli.analysis.resampling import RESAMPLES, Crossed, Nested
from qinit_cli.arrays import Floats

LEVEL = 0.95
TAILS = ((1 - LEVEL) / 2, (1 + LEVEL) / 2)
FEW_SOURCE_SETS = 5  # below, coverage is under nominal: the bootstrap knows a spread of n - 1 degrees poorly


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
        return unknown(values.mean(axis=0))
    return _of_means(values[None], resampling.of_targets(len(values), rng, resamples))


def pigeonhole(values: Floats, rng: np.random.Generator, resamples: int = RESAMPLES) -> Interval:
    """Mean of `values` (R, T, M): R source sets that met the same T targets, both resampled independently."""
    sets, targets, _ = values.shape
    if sets < 2 or targets < 2:
        return unknown(values.mean(axis=(0, 1)))
    return _of_means(values, resampling.crossed(sets, targets, rng, resamples))


def nested(values: Floats, rng: np.random.Generator, resamples: int = RESAMPLES) -> Interval:
    """Mean of `values` (R, T, M): R source sets with T targets of their own; sets, then targets in them."""
    sets, targets, _ = values.shape
    if sets < 2:
        return unknown(values.mean(axis=(0, 1)))
    return _of_means(values, resampling.nested(sets, targets, rng, resamples))


def percentiles(estimate: Floats, resampled: Floats) -> Interval:
    """The interval that leaves out (1 - LEVEL)/2 of the `resampled` (resamples, M) on either side."""
    low, high = np.quantile(resampled, TAILS, axis=0)
    return Interval(estimate=np.asarray(estimate), low=low, high=high)


def unknown(estimate: Floats) -> Interval:
    """Estimates that have no interval."""
    return Interval(
        estimate=estimate, low=np.full_like(estimate, np.nan), high=np.full_like(estimate, np.nan)
    )


def _of_means(values: Floats, samples: Iterable[Crossed] | Iterable[Nested]) -> Interval:
    return percentiles(values.mean(axis=(0, 1)), np.concatenate([sample.means(values) for sample in samples]))
