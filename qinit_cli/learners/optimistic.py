"""Learners that are greedy on optimistic values: MaxQInit was made for them (Abel et al., 2018)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, ClassVar

from qinit_cli.learners.learner import Learner
from qinit_cli.options import option

if TYPE_CHECKING:
    from qinit_cli.kernels.learner import Batch
    from qinit_cli.learning import Learning


@dataclass(frozen=True)
class Optimistic(Learner):
    """A learner without a step size that explores by values which are too large."""

    steps: ClassVar[bool] = False
    weighs: ClassVar[bool] = False
    shapes: ClassVar[bool] = False
    optimism: ClassVar[float] = 1.0
    explores: ClassVar[bool] = False


@dataclass(frozen=True)
class DelayedQ(Optimistic):
    """Delayed Q-learning: after m steps from (s, a), Q(s, a) becomes the mean of their r + gamma max_b Q(s', b), plus epsilon1.

    It does if that lowers it by epsilon1 at least; else (s, a) learns no more until some value has changed since. The method's
    start takes the place of 1 / (1 - gamma). Strehl et al. (2006), algorithm 1.
    """

    name: ClassVar[str] = "delayed-q"
    m: int = option(5, "Steps from a state-action that make one update.", low=1, high=1_000_000)
    epsilon1: float = option(0.001, "What an update adds to its mean, and lowers a value by at least.", low=0)

    def kernel(self, learning: Learning, batch: Batch) -> Any:
        """What each lane has met since the last update of a state-action."""
        from qinit_cli.kernels.delayed_q import new_delayed

        return new_delayed(batch, self.m, self.epsilon1)


@dataclass(frozen=True)
class RMax(Optimistic):
    """R-Max: plans in the model of the state-actions that it has met `known` times; the others hold the method's start.

    A known Q(s, a) is the mean of r + gamma max_b Q(s', b) over the first `known` steps from it; a change of a state's value by
    more than `tolerance` is handed on to those before it. Brafman & Tennenholtz (2002).
    """

    name: ClassVar[str] = "r-max"
    known: int = option(10, "Steps from a state-action after which it is known.", low=1, high=1_000)
    tolerance: float = option(
        1e-6, "Change of a state's value up to which those before it are left alone.", low=1e-12
    )

    def refusal(self, learning: Learning) -> str:
        """Plans without a discount need not come to an end."""
        if learning.gamma == 1:
            return f"gamma is 1; {self.name} plans with a gamma below 1"
        return super().refusal(learning)

    def kernel(self, learning: Learning, batch: Batch) -> Any:
        """The model of each lane."""
        from qinit_cli.kernels.r_max import new_model

        return new_model(batch, self.known, self.tolerance)
