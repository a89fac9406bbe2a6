"""Average returns of methods on the same targets, and their differences in pairs, with intervals and Holm's p."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import numpy as np

from qinit_cli.analysis.intervals import Estimate, Resampling
from qinit_cli.analysis.permutation import LEVEL, adjusted, paired_p
from qinit_cli.analysis.resampling import units
from qinit_cli.arrays import Floats
from qinit_cli.claims.over_sets import OverSets
from qinit_cli.seeding import Stream, generator

Pair = tuple[str, str]  # of labels: the first minus the second


@dataclass(frozen=True)
class Arm:
    """A method's average return on each target from each source set."""

    averages: Floats  # (R, T)
    places: tuple[tuple[str, str], ...]  # (R,) the targets' digest and the source set of each row
    reads_sources: bool = True  # else one row serves every source set


@dataclass(frozen=True)
class Contrast(OverSets):
    """The mean difference of two methods, and its p adjusted by Holm over all that was asked at once."""

    p: float = math.nan  # NaN where it could not come to LEVEL, however large the difference

    @property
    def tested(self) -> bool:
        """Whether there were enough source sets, or targets, to tell the methods apart at all."""
        return not math.isnan(self.p)

    @property
    def above(self) -> bool:
        """Whether the first is better: its interval above 0, and so by its p."""
        return self.low > 0 and self.p <= LEVEL

    @property
    def below(self) -> bool:
        """Whether the first is worse."""
        return self.high < 0 and self.p <= LEVEL


@dataclass(frozen=True)
class Arms:
    """Methods that met the same targets."""

    arms: Mapping[str, Arm]  # by label: "ops-tl+logqinit-median rho=1.0"
    shared: bool  # whether the source sets met the same targets

    def contrasts(self, pairs: Iterable[Pair]) -> dict[Pair, Contrast]:
        """The contrasts of those pairs that are both there and met; Holm's correction is over them."""
        paired = {pair: self._differences(*pair) for pair in pairs}
        differences = {pair: values for pair, values in paired.items() if values is not None}
        if not differences:
            return {}
        raw = np.array([paired_p(values, _rng()) for values in differences.values()])
        told = adjusted(raw, np.array([units(*values.shape) for values in differences.values()]))
        found = self._estimates(differences)
        return {
            pair: Contrast(**vars(found[pair]), sets=self._sets(pair, values), p=p)
            for (pair, values), p in zip(differences.items(), told.tolist(), strict=True)
        }

    def mean(self, label: str) -> float:
        """A method's average over source sets and targets."""
        return float(self.arms[label].averages.mean())

    def _differences(self, first: str, second: str) -> Floats | None:
        """First minus second, (R, T), over the source sets of the first that the second has too."""
        if first not in self.arms or second not in self.arms:
            return None
        own, other = self.arms[first], self.arms[second]
        if not own.reads_sources and other.reads_sources:
            reversed_differences = self._differences(second, first)
            return None if reversed_differences is None else -reversed_differences
        rows = [(row, _beside(place, other)) for row, place in enumerate(own.places)]
        paired = [own.averages[row] - other.averages[at] for row, at in rows if at is not None]
        return np.stack(paired) if paired else None

    def _sets(self, pair: Pair, values: Floats) -> int:
        return len(values) if any(self.arms[label].reads_sources for label in pair) else 0

    def _estimates(self, differences: Mapping[Pair, Floats]) -> dict[Pair, Estimate]:
        """Mean and interval of each, those of one shape resampled together."""
        found: dict[Pair, Estimate] = {}
        for shape in {values.shape for values in differences.values()}:
            alike = {pair: values for pair, values in differences.items() if values.shape == shape}
            interval = Resampling(self.shared).interval(np.stack(list(alike.values()), axis=2), _rng())
            found |= {pair: interval.at(at) for at, pair in enumerate(alike)}
        return found


def _beside(place: tuple[str, str], other: Arm) -> int | None:
    """The other method's row for the same targets from the same source set; from any where it reads none."""
    if place in other.places:
        return other.places.index(place)
    if other.reads_sources:
        return None
    return next((row for row, met in enumerate(other.places) if met[0] == place[0]), None)


def _rng() -> np.random.Generator:
    return generator(0, Stream.BOOTSTRAP, 0)
