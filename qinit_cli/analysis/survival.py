"""When learning reaches a threshold, where some targets never do within their episodes (Kaplan-Meier)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from qinit_cli.arrays import Flags, Floats, Integers

WINDOW = 50


@dataclass(frozen=True)
class Survival:
    """The share of targets still below the threshold, and its summaries."""

    times: Integers  # (J,) episodes at which at least one target reached it, ascending
    below: Floats  # (J,) Kaplan-Meier estimate just after each of `times`
    median: float  # first episode at which at most half are below; infinity if half never reach it
    restricted_mean: float  # mean episode, those above `until` counted as `until`
    until: int
    censored: float  # share of targets that were not seen to reach it


def time_to_threshold(curves: Floats, threshold: Floats, window: int = WINDOW) -> tuple[Integers, Flags]:
    """Episode, counted from 1, that ends the first `window` with a mean of at least `threshold`; and
    whether any did.

    `curves` is (T, E), `threshold` (T,); both results are (T,). A target that never does is censored at E.
    """
    targets, episodes = curves.shape
    if episodes < window:
        return np.full(targets, episodes), np.zeros(targets, dtype=np.bool_)
    sums = np.cumsum(np.pad(curves, ((0, 0), (1, 0))), axis=1)
    means = (sums[:, window:] - sums[:, :-window]) / window
    over = means >= threshold[:, None] * (1 - 1e-9)  # sums of equal returns fall short by rounding
    reached = np.asarray(over.any(axis=1))
    return np.where(reached, over.argmax(axis=1) + window, episodes), reached


def kaplan_meier(times: Integers, reached: Flags, until: int) -> Survival:
    """Estimate from the (T,) `times` at which targets reached the threshold or, where not `reached`, were
    last seen.

    `until` bounds the restricted mean: the number of episodes.
    """
    events = np.unique(times[reached])
    at_risk = np.array([np.count_nonzero(times >= time) for time in events])
    happened = np.array([np.count_nonzero(times[reached] == time) for time in events])
    below = np.cumprod(1 - happened / at_risk)
    edges = np.minimum(np.concatenate(([0], events, [until])), until)
    half = np.flatnonzero(below <= 0.5 + 1e-12)
    return Survival(
        times=events,
        below=below,
        median=float(events[half[0]]) if half.size else float("inf"),
        restricted_mean=float(np.sum(np.diff(edges) * np.concatenate(([1.0], below)))),
        until=until,
        censored=float(np.mean(~reached)),
    )


def resampled_medians(times: Integers, reached: Flags, counts: Integers) -> Floats:
    """Kaplan-Meier medians of samples that hold each of the (T,) `times` as often as `counts` (B, T) says, (B,).

    Infinite where half never reach it. For times that are censored at the last episode alone, as those of
    `time_to_threshold` are: then the estimate is the share seen.
    """
    ends = np.where(reached, times, np.inf)
    order = np.argsort(ends)
    upto = np.cumsum(np.take(counts, order, axis=1), axis=1, dtype=np.int32)
    half = 2 * upto >= upto[:, -1:]
    medians: Floats = ends[order][half.argmax(axis=1)]
    return medians
