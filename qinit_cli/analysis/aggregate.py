"""Robust summaries over source sets and targets, as rliable defines them (Agarwal et al., 2021).

Its runs are our source sets R, its tasks our targets T. It resamples runs within each task and takes the tasks for given;
here targets are drawn from a distribution, so they are resampled too.
"""

from __future__ import annotations

import numpy as np

from qinit_cli.analysis.weighted_sums import weighted_sums
from qinit_cli.arrays import Floats, Integers


def interquartile_mean(values: Floats) -> float:
    """Mean of the middle half of all scores (R, T): a quarter of them, rounded down, is cut at either end."""
    ordered = np.sort(values, axis=None)
    cut = ordered.size // 4
    return float(ordered[cut : ordered.size - cut].mean())


def resampled_interquartile_means(values: Floats, counts: Integers) -> Floats:
    """The same of samples that hold each of the scores (R, T) as often as `counts` (B, R * T) says, (B,)."""
    order = np.argsort(values, axis=None)
    total, cut = order.size, order.size // 4
    upto = np.cumsum(np.take(counts, order, axis=1), axis=1, dtype=np.int32)
    ordered = values.ravel()[order]
    kept = np.clip(upto, cut, total - cut)  # of the scores up to each one, the lower quarter counted too
    # summed by parts: what each score adds is the rise of `kept` times the score
    means: Floats = (
        (total - cut) * ordered[-1]
        - cut * ordered[0]
        - weighted_sums(kept[:, :-1], np.diff(ordered)[:, None])[:, 0]
    )
    return means / (total - 2 * cut)


def improvements(method: Floats, baseline: Floats) -> Floats:
    """1 where `method` is above `baseline`, 1/2 where they are equal, else 0; in their common shape."""
    better: Floats = np.heaviside(method - baseline, 0.5)
    return better


def probability_of_improvement(method: Floats, baseline: Floats) -> float:
    """Probability that `method` (R, T) beats `baseline` (R', T) on a target drawn at random, over all pairs of runs.

    Ties count half. One run of each: the share of targets on which the method is better.
    """
    return float(improvements(method[:, None], baseline[None]).mean())
