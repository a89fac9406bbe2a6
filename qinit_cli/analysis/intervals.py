"""95 % bootstrap intervals of means: over targets, over source sets and targets, or nested.

How each resamples stands in `resampling`. The percentiles are expanded for how few units there are (Hesterberg, 2015): samples
of n units spread less than the units do, by (n-1)/n, and do not know that the spread itself is a guess, so that plain percentiles
of ten source sets cover 90 %, not 95. The units are the source sets, of which there are fewest, or the targets of one.
Intervals are not corrected for how many there are.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from scipy.special import ndtr, stdtrit

from qinit_cli.analysis import resampling
from qinit_cli.analysis.resampling import RESAMPLES, Crossed, Nested
from qinit_cli.arrays import Floats

LEVEL = 0.95
FEW_SOURCE_SETS = 5  # below, coverage is under nominal: no sample of three or four reaches beyond them


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
    return _of_means(values[None], len(values), resampling.of_targets(len(values), rng, resamples))


def pigeonhole(values: Floats, rng: np.random.Generator, resamples: int = RESAMPLES) -> Interval:
    """Mean of `values` (R, T, M): R source sets that met the same T targets, both resampled independently."""
    sets, targets, _ = values.shape
    if sets < 2 or targets < 2:
        return unknown(values.mean(axis=(0, 1)))
    return _of_means(values, sets, resampling.crossed(sets, targets, rng, resamples))


def nested(values: Floats, rng: np.random.Generator, resamples: int = RESAMPLES) -> Interval:
    """Mean of `values` (R, T, M): R source sets with T targets of their own; sets, then targets in them."""
    sets, targets, _ = values.shape
    if sets < 2:
        return unknown(values.mean(axis=(0, 1)))
    return _of_means(values, sets, resampling.nested(sets, targets, rng, resamples))


def percentiles(estimate: Floats, resampled: Floats, units: float = math.inf) -> Interval:
    """The interval between the `tails` of the `resampled` (resamples, M)."""
    low, high = np.quantile(resampled, tails(units), axis=0)
    return Interval(estimate=np.asarray(estimate), low=low, high=high)


def tails(units: float = math.inf) -> tuple[float, float]:
    """The probabilities of an interval's ends: (1 - LEVEL)/2 from either side, less where the units are few."""
    low = (1 - LEVEL) / 2
    if math.isfinite(units):
        low = float(ndtr(math.sqrt(units / (units - 1)) * stdtrit(units - 1, low)))
    return low, 1 - low


def unknown(estimate: Floats) -> Interval:
    """Estimates that have no interval."""
    return Interval(
        estimate=estimate, low=np.full_like(estimate, np.nan), high=np.full_like(estimate, np.nan)
    )


def _of_means(values: Floats, units: int, samples: Iterable[Crossed] | Iterable[Nested]) -> Interval:
    means = np.concatenate([sample.means(values) for sample in samples])
    return percentiles(values.mean(axis=(0, 1)), means, units)
