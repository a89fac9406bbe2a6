"""The continuous gridworld: the unit square, steps of one length with noise, and a round goal that changes from task to task."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, ClassVar, Literal

from qinit_cli.environments.continuous import BINS
from qinit_cli.environments.square_goals import GOALS, MEAN, STD, SquareFamily
from qinit_cli.options import option
from qinit_cli.rewards import REWARD, Reward

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from qinit_cli.arrays import Tasks


@dataclass(frozen=True)
class ContinuousGridworld(SquareFamily):
    """The unit square with walls around it; steps to four sides have noise, and the goal, a disc, changes from task to task.

    Targets start at (0.1, 0.1).
    """

    goals: Literal["normal", "uniform"] = option("normal", GOALS)
    mean: float | None = option(None, MEAN, default_text="0.75", low=0, high=1)
    std: float | None = option(None, STD, default_text="0.1", above=0, high=10)
    radius: float = option(0.1, "Radius of the goal.", low=0.01, high=0.5)
    step: float = option(0.05, "Length of a step.", low=0.001, high=1)
    noise: float = option(0.01, "Standard deviation of what a step adds along either axis.", low=0, high=1)
    bins: str | None = option(None, BINS, default_text="20", metavar="N[,N...]")
    reward: Reward = option("goal", REWARD)

    name: ClassVar[str] = "continuous-gridworld"
    usual_mean: ClassVar[float] = 0.75
    usual_std: ClassVar[float] = 0.1
    start: ClassVar[tuple[float, float]] = (0.1, 0.1)

    def continuous_world(self, tasks: Tasks, rng_words: NDArray[np.uint64]) -> Any:
        """The tasks as the kernel's OpenSquare; its lanes are not yet allocated."""
        from qinit_cli.kernels.continuous_gridworld import OpenSquare

        return OpenSquare(**self._square(tasks))
