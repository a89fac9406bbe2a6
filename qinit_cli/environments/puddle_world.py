"""The puddle world of Sutton (1996) with a goal that changes from task to task."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, ClassVar, Literal

from qinit_cli.environments.continuous import BINS
from qinit_cli.environments.square_goals import GOALS, MEAN, STD, SquareFamily
from qinit_cli.kernels.puddles import puddle_depth
from qinit_cli.options import option
from qinit_cli.rewards import REWARD, Reward

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from qinit_cli.arrays import Tasks


@dataclass(frozen=True)
class PuddleWorld(SquareFamily):
    """The unit square with the two puddles of Sutton (1996), and a goal, a disc, that changes from task to task.

    Sutton's puddles cost 400 times their depth a step, besides the 1 that every step costs. A reward at the goal alone knows no
    costs but time: with `--puddles slow` a step that begins at depth d goes 1 / (1 + 400 d) as far, noise included, so that a
    way through costs as much; with `--puddles lost` an episode that enters a puddle is lost. Targets start at (0.2, 0.4), as in
    Degris, White and Sutton (2012).
    """

    puddles: Literal["slow", "lost"] = option(
        "slow", "slow: a step at depth d goes 1 / (1 + 400 d) as far; lost: whoever enters one is lost."
    )
    goals: Literal["normal", "uniform"] = option("normal", GOALS)
    mean: float | None = option(None, MEAN, default_text="0.85", low=0, high=1)
    std: float | None = option(None, STD, default_text="0.1", above=0, high=10)
    radius: float = option(0.1, "Radius of the goal.", low=0.01, high=0.5)
    step: float = option(0.05, "Length of a step.", low=0.001, high=1)
    noise: float = option(0.01, "Standard deviation of what a step adds along either axis.", low=0, high=1)
    bins: str | None = option(None, BINS, default_text="20", metavar="N[,N...]")
    reward: Reward = option("goal", REWARD)

    name: ClassVar[str] = "puddle-world"
    usual_mean: ClassVar[float] = 0.85
    usual_std: ClassVar[float] = 0.1
    start: ClassVar[tuple[float, float]] = (0.2, 0.4)
    detour: ClassVar[float] = 1.0  # around both puddles to a goal beyond them

    def continuous_world(self, tasks: Tasks, rng_words: NDArray[np.uint64]) -> Any:
        """The tasks as the kernel's PuddleSquare; its lanes are not yet allocated."""
        from qinit_cli.kernels.puddle_world import PuddleSquare

        return PuddleSquare(**self._square(tasks), drowns=self.puddles == "lost")

    def ends(self) -> dict[str, Any]:
        """Which end is the goal, in words, where others are lost."""
        return {"goal": "its disc; a puddle is lost"} if self.puddles == "lost" else {}

    def _is_place(self, x: float, y: float) -> bool:
        """Whether a goal may be there: in the square, in no puddle, and not at the target start."""
        return super()._is_place(x, y) and puddle_depth(x, y) == 0
