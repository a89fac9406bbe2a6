"""Anderson-Darling's and Lilliefors' tests of normality, mean and deviation estimated, many samples at once.

Not plain Kolmogorov-Smirnov: with estimated parameters its p-values are far too large.
"""

from __future__ import annotations

import numpy as np

from qinit_cli.arrays import Floats
from qinit_cli.elementary import exp


def anderson_darling(ordered: Floats) -> tuple[Floats, Floats]:
    """A^2 and p (Stephens' case 3, formulas of D'Agostino and Stephens, 1986) of samples (C, n) in order."""
    from scipy.special import log_ndtr

    n = ordered.shape[1]
    standard = _standardised(ordered)
    odd = 2 * np.arange(1, n + 1) - 1.0
    statistic = -n - np.sum((log_ndtr(standard) + log_ndtr(-standard[:, ::-1])) * odd, axis=1) / n
    return statistic, _anderson_p(statistic * (1 + 0.75 / n + 2.25 / n**2))


def lilliefors(ordered: Floats, rng: np.random.Generator, resamples: int = 10_000) -> tuple[Floats, Floats]:
    """D and p of samples (C, n) in ascending order; p is the share of `resamples` normal samples as far off.

    D does not depend on mean and deviation, so one null distribution serves all samples of a size.
    """
    statistic = _largest_gap(ordered)
    null = np.sort(
        np.concatenate(
            [
                _largest_gap(np.sort(rng.standard_normal((block, ordered.shape[1])), axis=1))
                for block in np.diff(np.append(np.arange(0, resamples, 1_000), resamples))
            ]
        )
    )
    as_large = resamples - np.searchsorted(null, statistic, side="left")
    return statistic, (as_large + 1) / (resamples + 1)


def _standardised(ordered: Floats) -> Floats:
    deviations = ordered - ordered.mean(axis=1, keepdims=True)
    return np.asarray(deviations / deviations.std(axis=1, ddof=1, keepdims=True))


def _largest_gap(ordered: Floats) -> Floats:
    from scipy.special import ndtr

    n = ordered.shape[1]
    below = ndtr(_standardised(ordered))
    steps = np.arange(n + 1) / n
    gaps: Floats = np.maximum((steps[1:] - below).max(axis=1), (below - steps[:-1]).max(axis=1))
    return gaps


def _anderson_p(adjusted: Floats) -> Floats:
    at = np.minimum(adjusted, 13.0)  # the last parabola turns up again far beyond, where p is below 1e-30
    return np.select(
        [at < 0.2, at < 0.34, at < 0.6],
        [
            1 - exp(-13.436 + 101.14 * at - 223.73 * at**2),
            1 - exp(-8.318 + 42.796 * at - 59.938 * at**2),
            exp(0.9177 - 4.279 * at - 1.38 * at**2),
        ],
        exp(1.2937 - 5.709 * at + 0.0186 * at**2),
    )
