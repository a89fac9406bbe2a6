"""How a task is learned: learner, exploration and their settings, free of numpy so that help stays fast."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal, get_args

from qinit_cli.learners import Learner, QLearner
from qinit_cli.learners.exploration import EpsilonGreedy, Exploration
from qinit_cli.options import is_of
from qinit_cli.schedules import ByVisits, Schedule

CURVE_BINS = 100  # of a source's learning curve: enough to see it settle
KNOWNNESS = "knownness"  # the one blend that there is
KNOWN_AT = 10  # updates after which a blended value is the learned one; measured, see docs/continuous.md
MOST_STEPS = 2**63  # of a task, which are counted in 64 bits
Start = Literal["anywhere", "fixed"]
# in the place of a learner: solved for, or learned elsewhere, of which tables are known or curves
EXACT, IMPORTED, IMPORTED_CURVES = "exact", "imported", "imported curves"
Q_LEARNING, EPSILON_GREEDY = QLearner(), EpsilonGreedy()  # unless another is asked for


@dataclass(frozen=True)
class Learning:
    """Tabular learning: by default Q-learning, epsilon-greedy, with a constant step size."""

    alpha: float | Schedule  # step size
    gamma: float  # discount
    epsilon: float | Schedule  # probability that a step explores
    episodes: int
    horizon: int  # steps after which an episode is cut off
    start: Start  # where episodes start: anywhere in the family's states, or at the target start
    learner: Learner = Q_LEARNING
    explore: Exploration = EPSILON_GREEDY

    def __post_init__(self) -> None:
        for name in ("alpha", "gamma", "epsilon", "episodes", "horizon"):
            value, whole = getattr(self, name), name in ("episodes", "horizon")
            scheduled = name in ("alpha", "epsilon") and isinstance(value, Schedule)
            if not (scheduled or is_of(value, int if whole else float)):
                raise ValueError(f"{name} is {value!r}; it must be a {'whole ' * whole}number")
        for extreme in _extremes(self.alpha):
            _check("alpha", self.alpha, 0 < extreme <= 1, "above 0 and at most 1")
        _check("gamma", self.gamma, 0 < self.gamma <= 1, "above 0 and at most 1")
        if isinstance(self.epsilon, ByVisits):
            raise ValueError(f"epsilon is {self.epsilon}; {ByVisits.form} is a schedule of alpha alone")
        for extreme in _extremes(self.epsilon):
            _check("epsilon", self.epsilon, 0 <= extreme <= 1, "from 0 to 1")
        _check("episodes", self.episodes, self.episodes >= 1, "at least 1")
        _check("horizon", self.horizon, self.horizon >= 1, "at least 1")
        if self.episodes * self.horizon >= MOST_STEPS:
            raise ValueError(
                f"episodes is {self.episodes}; with a horizon of {self.horizon} the steps cannot be counted"
            )
        if self.start not in get_args(Start):
            raise ValueError(f"start is {self.start!r}; it is one of {', '.join(get_args(Start))}")
        if refusal := self.learner.refusal(self):
            raise ValueError(refusal)

    @property
    def last_epsilon(self) -> float:
        """Probability that a step of the last episode explores; 0 where the exploration is not epsilon-greedy."""
        if not isinstance(self.explore, EpsilonGreedy):
            return 0.0
        return (
            self.epsilon if not isinstance(self.epsilon, Schedule) else self.epsilon.values(self.episodes)[-1]
        )


def curve_bins(learner: str, learning: Learning) -> int:
    """Bins of a source's learning curve; 0 where no steps were taken here."""
    return 0 if learner in (EXACT, IMPORTED) else min(CURVE_BINS, learning.episodes)


def _extremes(value: float | Schedule) -> tuple[float, ...]:
    return value.extremes if isinstance(value, Schedule) else (value,)


def _check(name: str, value: float | Schedule, fits: bool, wanted: str) -> None:
    if not (fits and (isinstance(value, Schedule) or math.isfinite(value))):
        raise ValueError(f"{name} is {value}; it must be {wanted}")
