"""How many times the return of learning from zero a method earns, where that has a meaning."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from qinit_cli.analysis.intervals import RESAMPLES, Interval, percentiles, resampled_means
from qinit_cli.arrays import Flags, Floats


@dataclass(frozen=True)
class TransferRatio:
    """Ratio of means, difference of means, and whether the ratio may be shown; one entry per metric (M,)."""

    ratio: Interval  # NaN where not `defined`: show the difference there
    difference: Interval
    defined: Flags


def transfer_ratio(
    values: Floats, zero: Floats, rng: np.random.Generator, resamples: int = RESAMPLES
) -> TransferRatio:
    """Mean of `values` over mean of `zero`, both (T, M) on the same targets, resampled in pairs.

    Undefined where the interval of the zero run's mean touches 0: dividing by next to nothing tells nothing.
    """
    metrics = values.shape[1]
    means = resampled_means(np.concatenate([values, zero], axis=1), rng, resamples)
    mean, mean_zero = values.mean(axis=0), zero.mean(axis=0)
    against = percentiles(mean_zero, means[:, metrics:])
    defined = np.asarray((against.low > 0) | (against.high < 0))
    with np.errstate(divide="ignore", invalid="ignore"):
        ratio = percentiles(
            np.where(defined, mean / mean_zero, np.nan),
            np.where(defined, means[:, :metrics] / means[:, metrics:], np.nan),
        )
    return TransferRatio(
        ratio=ratio,
        difference=percentiles(mean - mean_zero, means[:, :metrics] - means[:, metrics:]),
        defined=defined,
    )
