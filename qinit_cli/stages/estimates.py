"""A method's numbers from the scores of its runs, with intervals that resample source sets and targets together."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import islice
from typing import TYPE_CHECKING

from qinit_cli.stages.scores import Metric, Scores

if TYPE_CHECKING:
    import numpy as np

    from qinit_cli.analysis.intervals import Interval
    from qinit_cli.analysis.resampling import Crossed, Nested
    from qinit_cli.arrays import Floats

RANK_RESAMPLES = 2_000  # of what must be counted through in order: their intervals move by 2 % of their width


@dataclass(frozen=True)
class Estimates:
    """A method over all its runs; each interval has the shape ()."""

    average: Interval
    jumpstart: Interval
    asymptotic: Interval
    iqm: Interval  # interquartile mean of the averages
    steps: float
    success: float
    regret: Interval | None
    threshold: Threshold | None
    against: Against | None


@dataclass(frozen=True)
class Threshold:
    """Episodes until the return comes to half of what can be hoped for."""

    median: Interval  # Kaplan-Meier; infinite where half never arrive
    restricted_mean: Interval
    censored: float  # share of targets that never arrive


@dataclass(frozen=True)
class Against:
    """A method beside the baseline, on the same targets and from the same source sets."""

    difference: Interval  # of averages
    ratio: Interval  # NaN where the baseline's interval touches 0
    improvement: Interval  # probability of improvement
    p: float  # of the difference; not corrected


@dataclass(frozen=True)
class Chance:
    """How samples are drawn: from a stream of its own each time, so that all methods meet the same."""

    shared: bool  # whether source sets met the same targets
    seed: int

    def samples(self, sets: int, targets: int) -> Iterator[Crossed] | Iterator[Nested] | None:
        """Samples of so many sets and targets; None of what cannot be resampled."""
        from qinit_cli.analysis import resampling

        if sets == 1:
            return resampling.of_targets(targets, self.stream()) if targets > 1 else None
        if self.shared:
            return resampling.crossed(sets, targets, self.stream()) if targets > 1 else None
        return resampling.nested(sets, targets, self.stream())

    def stream(self) -> np.random.Generator:
        """The stream that every method's samples come from."""
        from qinit_cli.seeding import Stream, generator

        return generator(self.seed, Stream.BOOTSTRAP, 0)
