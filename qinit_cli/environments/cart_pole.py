"""The cart-pole whose pole, cart and push change from task to task: Gymnasium's CartPole-v1, or a pole to be swung up."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, ClassVar, Literal

from qinit_cli.environments.continuous import BINS, PhysicalFamily
from qinit_cli.environments.physical_parameters import METAVAR, PhysicalParameter
from qinit_cli.errors import NotAllowed
from qinit_cli.learning import Learning
from qinit_cli.options import option
from qinit_cli.rewards import REWARD, Reward

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from qinit_cli.arrays import Floats, Tasks

# as the kernel has them, which help texts must not import
TRACK = 2.4
UPRIGHT = 12 * 2 * math.pi / 360


@dataclass(frozen=True)
class CartPole(PhysicalFamily):
    """Gymnasium's CartPole-v1, to balance or to swing up, whose pole, cart, gravity and push change from task to task.

    With `--goal survived` the pole starts upright and the goal is the horizon: an episode is lost once the pole leans more than
    12 degrees or the cart leaves the track, 2.4 m to either side. With `--goal up` the pole starts hanging and may turn freely;
    the goal is a pole within 12 degrees of upright with an angular velocity below 1 radian a second, and only leaving the track
    is lost.
    """

    goal: Literal["survived", "up"] = option(
        "survived",
        "survived: the pole stands until the horizon; up: it hangs, and is swung up to within 12 degrees and 1 radian a second.",
    )
    length: str = option("uniform:0.4,1", "Half the pole's length, m.", metavar=METAVAR)
    masspole: str = option("0.1", "Mass of the pole, kg.", metavar=METAVAR)
    masscart: str = option("1.0", "Mass of the cart, kg.", metavar=METAVAR)
    gravity: str = option("9.8", "Gravity, m/s^2.", metavar=METAVAR)
    force_mag: str = option("10.0", "Force of a push, N.", metavar=METAVAR)
    bins: str | None = option(
        None, BINS, default_text="1,6,12,8; with --goal up 6,6,12,8", metavar="N[,N...]"
    )
    reward: Reward = option("goal", REWARD)

    name: ClassVar[str] = "cart-pole"
    actions: ClassVar[tuple[str, ...]] = ("left", "right")
    start_spread: ClassVar[float] = 0.05
    physical: ClassVar[tuple[PhysicalParameter, ...]] = (
        PhysicalParameter("length", "half the pole's length", "m", 0.01, 100),
        PhysicalParameter("masspole", "mass of the pole", "kg", 0.001, 1000),
        PhysicalParameter("masscart", "mass of the cart", "kg", 0.001, 1000),
        PhysicalParameter("gravity", "gravity", "m/s^2", 0.01, 1000),
        PhysicalParameter("force_mag", "force of a push", "N", 0.001, 10000),
    )
    source_learning: ClassVar[Learning] = Learning(
        alpha=0.1, gamma=0.99, epsilon=0.1, episodes=50_000, horizon=100, start="fixed"
    )
    target_learning: ClassVar[Learning] = Learning(
        alpha=0.1, gamma=0.99, epsilon=0.1, episodes=1_000, horizon=100, start="fixed"
    )

    @property
    def usual_bins(self) -> str:  # type: ignore[override]  # a matter of the goal here
        """The bins unless others are asked for: a pole that stands may be anywhere on the track."""
        return "6,6,12,8" if self.goal == "up" else "1,6,12,8"

    def box(self) -> tuple[tuple[str, float, float], ...]:
        """Position, velocity, angle and angular velocity; a pole that is swung up has any angle, from 0 to 2 pi."""
        if self.goal == "up":
            return (
                ("x", -TRACK, TRACK),
                ("x_dot", -4.0, 4.0),
                ("theta", 0.0, 2 * math.pi),
                ("theta_dot", -8.0, 8.0),
            )
        return (
            ("x", -TRACK, TRACK),
            ("x_dot", -3.0, 3.0),
            ("theta", -UPRIGHT, UPRIGHT),
            ("theta_dot", -3.0, 3.0),
        )

    def target_state(self) -> tuple[float, ...]:
        """At rest in the middle, upright or hanging; targets start within 0.05 of each number."""
        return (0.0, 0.0, math.pi if self.goal == "up" else 0.0, 0.0)

    def ends(self) -> dict[str, Any]:
        """Which end is the goal, in words."""
        up = "a pole that is up and slow; the track's end is lost"
        return {"goal": up if self.goal == "up" else "the horizon; every end is lost"}

    def continuous_world(self, tasks: Tasks, rng_words: NDArray[np.uint64]) -> Any:
        """The tasks as the kernel's CartPoleWorld; its lanes are not yet allocated."""
        import numpy as np

        from qinit_cli.kernels.cart_pole import CartPoleWorld

        return CartPoleWorld(
            **self._parameters(tasks),
            up=self.goal == "up",
            **self._corners(),
            limit=0,
            time=np.zeros(1, np.int64),
            observed=np.zeros((1, 4)),
        )

    def log_path(self, tasks: Tasks, lengths: NDArray[np.integer]) -> Floats:
        """0, (1, 1, 1): given the task every step is certain; NotAllowed where the goal is the horizon, as no path is shorter."""
        if self.goal == "survived":
            raise NotAllowed(
                "with --goal survived every path that arrives is as long as the horizon; no theory to check"
            )
        return super().log_path(tasks, lengths)
