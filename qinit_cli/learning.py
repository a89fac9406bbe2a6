"""How a task is learned: the settings of tabular Q-learning, free of numpy so that help stays fast."""

from __future__ import annotations

import math
from dataclasses import dataclass, fields
from typing import Literal, get_args

from qinit_cli.options import is_of

CURVE_BINS = 100  # of a source's learning curve: enough to see it settle
MOST_STEPS = 2**63  # of a task, which are counted in 64 bits
Start = Literal["anywhere", "fixed"]


@dataclass(frozen=True)
class QLearning:
    """Epsilon-greedy tabular Q-learning with a constant step size."""

    alpha: float  # step size
    gamma: float  # discount
    epsilon: float  # probability that a step explores
    episodes: int
    horizon: int  # steps after which an episode is cut off
    start: Start  # where episodes start: anywhere in the family's states, or at the target start

    def __post_init__(self) -> None:
        for field in fields(self):
            whole = field.name in ("episodes", "horizon")
            if field.name != "start" and not is_of(
                value := getattr(self, field.name), int if whole else float
            ):
                raise ValueError(f"{field.name} is {value!r}; it must be a {'whole ' * whole}number")
        _check("alpha", self.alpha, 0 < self.alpha <= 1, "above 0 and at most 1")
        _check("gamma", self.gamma, 0 < self.gamma <= 1, "above 0 and at most 1")
        _check("epsilon", self.epsilon, 0 <= self.epsilon <= 1, "from 0 to 1")
        _check("episodes", self.episodes, self.episodes >= 1, "at least 1")
        _check("horizon", self.horizon, self.horizon >= 1, "at least 1")
        if self.episodes * self.horizon >= MOST_STEPS:
            raise ValueError(
                f"episodes is {self.episodes}; with a horizon of {self.horizon} the steps cannot be counted"
            )
        if self.start not in get_args(Start):
            raise ValueError(f"start is {self.start!r}; it is one of {', '.join(get_args(Start))}")


def curve_bins(learner: str, learning: QLearning) -> int:
    """Bins of a source's learning curve; 0 for the exact learner, which has none."""
    return 0 if learner == "exact" else min(CURVE_BINS, learning.episodes)


def _check(name: str, value: float, fits: bool, wanted: str) -> None:
    if not (math.isfinite(value) and fits):
        raise ValueError(f"{name} is {value}; it must be {wanted}")
