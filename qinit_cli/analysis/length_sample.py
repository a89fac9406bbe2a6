"""Path lengths of one state over source tasks: their moments, a smooth density, a test against the rounded normal."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from qinit_cli.analysis.rounded_normal import rounded_normality
from qinit_cli.arrays import Floats
from qinit_cli.elementary import exp


@dataclass(frozen=True)
class LengthSample:
    """Lengths of the paths that arrive, ascending; those that never do are counted."""

    lengths: Floats  # (n,) whole numbers
    never: int

    @classmethod
    def of(cls, eopl: NDArray[np.integer]) -> LengthSample:
        """The sample in path lengths (N,), -1 where a path never arrives."""
        arrives = eopl >= 0
        return cls(np.sort(eopl[arrives].astype(np.float64)), int(np.count_nonzero(~arrives)))

    @property
    def mean(self) -> float:
        """NaN where no path arrives."""
        return float(self.lengths.mean()) if self.lengths.size else float("nan")

    @property
    def deviation(self) -> float:
        """Standard deviation (ddof 0); NaN where no path arrives."""
        return float(self.lengths.std()) if self.lengths.size else float("nan")

    def normal_density(self, at: Floats) -> Floats:
        """Of the normal with the sample's mean and deviation, which must not be 0."""
        z = (at - self.mean) / self.deviation
        density: Floats = exp(-(z**2) / 2) / (self.deviation * np.sqrt(2 * np.pi))
        return density

    def smooth_density(self, at: Floats) -> Floats:
        """A normal kernel at every length, Silverman's bandwidth, at least half a step; (P,) for `at` (P,)."""
        low, high = np.quantile(self.lengths, [0.25, 0.75])
        robust = (high - low) / 1.349
        spread = min(self.deviation, robust) if robust > 0 else self.deviation
        width = max(0.9 * spread * self.lengths.size**-0.2, 0.5)
        z = (at[:, None] - self.lengths) / width
        density: Floats = exp(-(z**2) / 2).mean(axis=1) / (width * np.sqrt(2 * np.pi))
        return density

    def rounded_normal(self, rng: np.random.Generator) -> tuple[float, float]:
        """W and its bootstrap p against the rounded normal; NaN where not testable."""
        if not self.lengths.size:
            return float("nan"), float("nan")
        column = self.lengths[:, None]
        tested = rounded_normality(column, np.ones(column.shape, np.bool_), rng)
        return float(tested.statistic[0]), float(tested.p[0])
