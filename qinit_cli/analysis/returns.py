"""What a run's steps and goals say: returns, success, and the three summaries of a learning curve."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from qinit_cli.arrays import Flags, Floats
from qinit_cli.elementary import power
from qinit_cli.rewards import Payment, exact_returns

JUMPSTART_EPISODES = 10
ASYMPTOTIC_SHARE = 0.1


def discounted_returns(steps: NDArray[np.integer], reached: Flags, gamma: float) -> Floats:
    """gamma^(steps - 1) where the goal was reached, else 0, (T, E): the reward is 1 on entering the goal."""
    return np.where(reached, power(gamma, steps - 1.0), 0.0)


def earned(rows: Mapping[str, Any], paid: Payment | None, gamma: float) -> Floats:
    """The discounted return of each episode, (T, E), of rows of a run.

    Where every step pays -1 until the goal, an episode without the goal counts as if it never came. Where the world told its
    rewards the returns stand in the rows.
    """
    if "return" in rows:
        return np.asarray(rows["return"])
    reached = np.asarray(rows["reached"], dtype=np.bool_)
    return exact_returns(paid, gamma, discounted_returns(rows["steps"], reached, gamma))


def restricted_steps(steps: NDArray[np.integer], horizon: int) -> Floats:
    """min(steps, horizon), (T, E): an episode without the goal counts the steps it was allowed."""
    return np.asarray(np.minimum(steps, horizon), dtype=np.float64)


def average(curves: Floats) -> Floats:
    """Mean over all episodes per target, (T,) from (T, E): the area under the learning curve."""
    return _mean(curves)


def jumpstart(curves: Floats, episodes: int = JUMPSTART_EPISODES) -> Floats:
    """Mean over the first `episodes` per target, (T,); over all where there are fewer."""
    return _mean(curves[..., :episodes])


def asymptotic(curves: Floats, share: float = ASYMPTOTIC_SHARE) -> Floats:
    """Mean over the last `share` of the episodes per target, (T,), rounded up to whole episodes."""
    last = int(np.ceil(share * curves.shape[-1]))
    return _mean(curves[..., -last:])


def smoothed(curves: Floats, window: int) -> Floats:
    """Mean over the last `window` episodes up to each one, (T, E), over fewer at the beginning; for figures.

    Looking back only, so that nothing of what a method learned later shows in its first episodes.
    """
    # cumulated from the curve's mean: sums of small differences lose no digits
    offset = _mean(curves)[..., None]
    sums = np.cumsum(curves - offset, axis=-1)
    sums[..., window:] = sums[..., window:] - sums[..., :-window]
    return offset + sums / np.minimum(np.arange(1, curves.shape[-1] + 1), window)


def _mean(curves: Floats) -> Floats:
    means: Floats = curves.mean(axis=-1)
    return means
