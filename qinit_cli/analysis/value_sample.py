"""One state-action's values over source tasks beside the log-normal that is fitted to them: what a histogram shows."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from qinit_cli.analysis.normality import is_testable
from qinit_cli.analysis.shapiro import shapiro_wilk
from qinit_cli.arrays import Floats
from qinit_cli.elementary import exp, ln

LEVEL = 0.95


@dataclass(frozen=True)
class ValueSample:
    """Positive values, ascending, and the moments of their logarithms; those that are not positive are masked and counted."""

    values: Floats  # (n,)
    masked: int

    @classmethod
    def of(cls, values: Floats) -> ValueSample:
        """The sample in values (N,) of any sign."""
        positive = values > 0
        return cls(np.sort(values[positive]), int(np.count_nonzero(~positive)))

    @property
    def logarithms(self) -> Floats:
        """ln Q, (n,), ascending."""
        return ln(self.values)

    @property
    def median(self) -> float:
        """NaN where nothing is positive."""
        return float(np.median(self.values)) if self.values.size else float("nan")

    @property
    def mu(self) -> float:
        """Mean of ln Q, as `qinit fit` has it; NaN where nothing is positive."""
        return float(self.logarithms.mean()) if self.values.size else float("nan")

    @property
    def sigma(self) -> float:
        """Standard deviation of ln Q (ddof 0), as `qinit fit` has it; NaN where nothing is positive."""
        return float(self.logarithms.std()) if self.values.size else float("nan")

    def density(self, at: Floats) -> Floats:
        """Of the fitted log-normal."""
        return self.log_density(ln(at)) / at

    def log_density(self, at: Floats) -> Floats:
        """Of the fitted normal at values of ln Q."""
        z = (at - self.mu) / self.sigma
        density: Floats = exp(-(z**2) / 2) / (self.sigma * np.sqrt(2 * np.pi))
        return density

    def normal_scores(self) -> Floats:
        """Where n ordered draws of a standard normal are expected, (n,); Blom, 1958."""
        from scipy.special import ndtri

        n = self.values.size
        return np.asarray(ndtri((np.arange(1, n + 1) - 0.375) / (n + 0.25)))

    def band(self, level: float = LEVEL) -> tuple[Floats, Floats]:
        """Where each of n ordered draws of the fitted normal falls with probability `level`, low and high, (n,) each.

        Pointwise, by the beta distribution of order statistics, as if mu and sigma were known.
        """
        from scipy.special import betaincinv, ndtri

        n = self.values.size
        rank = np.arange(1, n + 1)
        low, high = (
            self.mu + self.sigma * ndtri(betaincinv(rank, n + 1 - rank, tail))
            for tail in ((1 - level) / 2, (1 + level) / 2)
        )
        return low, high


def shapiro_wilk_of(ordered: Floats) -> tuple[float, float]:
    """W and p of one sample (n,), ascending; NaN where it is not testable: fewer than 8 values, or all of them equal."""
    if ordered.size == 0 or not is_testable(ordered[None])[0]:
        return float("nan"), float("nan")
    statistic, p = shapiro_wilk(ordered[None])
    return float(statistic[0]), float(p[0])
