"""Robust summaries over source sets and targets, as rliable defines them (Agarwal et al., 2021).

Its runs are our source sets R, its tasks our targets T; one source set is R = 1, and then the probability of
improvement is the paired share of targets on which a method is better.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from qinit_cli.analysis.intervals import RESAMPLES, Interval, percentiles
from qinit_cli.arrays import Floats, Integers

Statistic = Callable[..., float]


def interquartile_mean(values: Floats) -> float:
    """Mean of the middle half of all scores (R, T): a quarter of them, rounded down, is cut at either end."""
    ordered = np.sort(values, axis=None)
    cut = ordered.size // 4
    return float(ordered[cut : ordered.size - cut].mean())


def probability_of_improvement(method: Floats, baseline: Floats) -> float:
    """Chance that `method` (R, T) beats `baseline` (R', T) on a target drawn at random; ties count half."""
    pairs = method[:, None] - baseline[None, :]
    return float(np.mean((pairs > 0) + 0.5 * (pairs == 0)))


def bootstrap(
    statistic: Statistic,
    scores: tuple[Floats, ...],
    rng: np.random.Generator,
    *,
    shared_targets: bool,
    resamples: int = RESAMPLES,
) -> Interval:
    """A `statistic` of the `scores`, each (R, T), and its percentile interval, each ().

    All scores are resampled alike, for they are of the same source sets and targets. With one source set
    the interval is conditional on it. Several sets are resampled too, and their targets with them
    (pigeonhole) where they are shared, else anew within each set drawn (nested).
    """
    sets, targets = scores[0].shape
    estimate = np.asarray(statistic(*scores))
    if targets < 2:
        return Interval(estimate, np.asarray(np.nan), np.asarray(np.nan))
    drawn = (_drawn(sets, targets, shared_targets, rng) for _ in range(resamples))
    return percentiles(
        estimate, np.array([statistic(*(score[index] for score in scores)) for index in drawn])
    )


def _drawn(
    sets: int, targets: int, shared_targets: bool, rng: np.random.Generator
) -> tuple[Integers, Integers]:
    rows = rng.integers(0, sets, (sets, 1))
    return rows, rng.integers(0, targets, (1 if shared_targets else sets, targets))
