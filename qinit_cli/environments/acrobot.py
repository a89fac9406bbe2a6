"""The acrobot whose links and gravity change from task to task: Gymnasium's Acrobot-v1."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, ClassVar

from qinit_cli.environments.continuous import BINS, PhysicalFamily
from qinit_cli.environments.physical_parameters import METAVAR, PhysicalParameter
from qinit_cli.learning import Learning
from qinit_cli.options import option
from qinit_cli.rewards import REWARD, Reward

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from qinit_cli.arrays import Tasks


@dataclass(frozen=True)
class Acrobot(PhysicalFamily):
    """Gymnasium's Acrobot-v1, two links swung up by the joint between them, whose links and gravity change from task to task.

    A link's centre of mass is its middle and its moment of inertia 1, as Gymnasium has them. The goal is Gymnasium's as well,
    -cos(theta1) - cos(theta1 + theta2) > 1, whatever the lengths.
    """

    length_1: str = option("uniform:0.8,1.2", "Length of the first link, m.", metavar=METAVAR)
    length_2: str = option("1.0", "Length of the second link, m.", metavar=METAVAR)
    mass_1: str = option("1.0", "Mass of the first link, kg.", metavar=METAVAR)
    mass_2: str = option("uniform:0.8,1.2", "Mass of the second link, kg.", metavar=METAVAR)
    gravity: str = option("9.8", "Gravity, m/s^2.", metavar=METAVAR)
    bins: str | None = option(None, BINS, default_text="6", metavar="N[,N...]")
    reward: Reward = option("goal", REWARD)

    name: ClassVar[str] = "acrobot"
    actions: ClassVar[tuple[str, ...]] = ("negative", "none", "positive")
    usual_bins: ClassVar[str] = "6"
    start_spread: ClassVar[float] = 0.1
    physical: ClassVar[tuple[PhysicalParameter, ...]] = (
        PhysicalParameter("length_1", "length of the first link", "m", 0.01, 10),
        PhysicalParameter("length_2", "length of the second link", "m", 0.01, 10),
        PhysicalParameter("mass_1", "mass of the first link", "kg", 0.01, 10),
        PhysicalParameter("mass_2", "mass of the second link", "kg", 0.01, 10),
        PhysicalParameter("gravity", "gravity", "m/s^2", 0.01, 100),
    )
    source_learning: ClassVar[Learning] = Learning(
        alpha=0.1, gamma=0.99, epsilon=0.1, episodes=10_000, horizon=500, start="fixed"
    )
    target_learning: ClassVar[Learning] = Learning(
        alpha=0.1, gamma=0.99, epsilon=0.1, episodes=1_000, horizon=500, start="fixed"
    )

    def box(self) -> tuple[tuple[str, float, float], ...]:
        """Both angles and both angular velocities."""
        return (
            ("theta1", -math.pi, math.pi),
            ("theta2", -math.pi, math.pi),
            ("dtheta1", -2 * math.pi, 2 * math.pi),
            ("dtheta2", -4 * math.pi, 4 * math.pi),
        )

    def target_state(self) -> tuple[float, ...]:
        """Hanging at rest; targets start within 0.1 of each number."""
        return (0.0, 0.0, 0.0, 0.0)

    def continuous_world(self, tasks: Tasks, rng_words: NDArray[np.uint64]) -> Any:
        """The tasks as the kernel's AcrobotWorld; its lanes are not yet allocated."""
        import numpy as np

        from qinit_cli.kernels.acrobot import AcrobotWorld

        return AcrobotWorld(**self._parameters(tasks), **self._corners(), observed=np.zeros((1, 4)))
