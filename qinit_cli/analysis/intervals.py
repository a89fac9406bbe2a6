"""95 % bootstrap intervals of means: over targets, over source sets and targets, or nested.

How each resamples stands in `resampling`. The percentiles are expanded for how few units there are (Hesterberg, 2015): samples
of n units spread less than the units do, by (n-1)/n, and do not know that the spread itself is a guess, so that plain percentiles
of ten source sets cover 90 %, not 95. The units are the source sets, of which there are fewest, or the targets of one.
Intervals are not corrected for how many there are.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from scipy.special import ndtr, stdtrit

from qinit_cli.analysis import resampling
from qinit_cli.analysis.resampling import RESAMPLES, Crossed, Nested, units
from qinit_cli.arrays import Floats

LEVEL = 0.95
FEW_SOURCE_SETS = 5  # below, coverage is under nominal: no sample of three or four reaches beyond them


@dataclass(frozen=True)
class Estimate:
    """A number and its 95 % interval; the bounds are NaN where there is none."""

    value: float
    low: float = math.nan
    high: float = math.nan


@dataclass(frozen=True)
class Interval:
    """Estimates and their intervals, one per metric (M,); low and high are NaN where there is one unit."""

    estimate: Floats
    low: Floats
    high: Floats

    def at(self, place: int | tuple[()] = ()) -> Estimate:
        """The estimate of one metric, of the only one where arrays are ()."""
        return Estimate(float(self.estimate[place]), float(self.low[place]), float(self.high[place]))


@dataclass(frozen=True)
class Resampling:
    """What is drawn with replacement: the targets of one source set, or several sets and their targets."""

    shared: bool = True  # whether several sets met the same targets; else each has its own
    resamples: int = RESAMPLES

    def samples(
        self, sets: int, targets: int, rng: np.random.Generator
    ) -> Iterator[Crossed] | Iterator[Nested]:
        """Samples of so many sets and targets; none where there is one unit."""
        if sets > 1 and not self.shared:
            return resampling.nested(sets, targets, rng, self.resamples)
        if targets < 2:
            return iter(())
        if sets == 1:
            return resampling.of_targets(targets, rng, self.resamples)
        return resampling.crossed(sets, targets, rng, self.resamples)

    def interval(self, values: Floats, rng: np.random.Generator) -> Interval:
        """Mean of `values` (R, T, M) over R source sets and T targets; conditional on the source set where R is 1."""
        sets, targets, _ = values.shape
        estimate = values.mean(axis=(0, 1))
        means = [sample.means(values) for sample in self.samples(sets, targets, rng)]
        return (
            percentiles(estimate, np.concatenate(means), units(sets, targets)) if means else unknown(estimate)
        )


def over_targets(values: Floats, rng: np.random.Generator, resamples: int = RESAMPLES) -> Interval:
    """Mean of `values` (T, M) over the targets; for a paired difference pass the differences on the same targets."""
    return Resampling(resamples=resamples).interval(values[None], rng)


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
