"""Mountain Car whose dynamics change from task to task: a push on the right hill; section 7.2 of the paper."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, ClassVar, Literal

from qinit_cli.environments.bases import DrawnFamily
from qinit_cli.errors import NotAllowed
from qinit_cli.learning import Learning
from qinit_cli.options import check, option
from qinit_cli.rewards import REWARD, Payment, Reward, in_label, payment

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from qinit_cli.arrays import Flags, Floats, Tasks
    from qinit_cli.kernels.batch import Worlds
    from qinit_store.schema import Axis, Column

POSITIONS = (-1.2, 0.6)
VELOCITIES = (-0.07, 0.07)
FARTHEST = 40.0  # standard deviations of a push: numpy draws no normal beyond 14
START = (-0.5, 0.0)  # the paper's s0, where it measures path lengths; at rest in the valley


@dataclass(frozen=True)
class MountainCar(DrawnFamily):
    """Gymnasium's MountainCar-v0 with a push on the right hill that changes from task to task (section 7.2)."""

    noise: float = option(
        0.01, "Spread of the push; the paper's are 0.0002, 0.005, 0.01, 0.015 and 0.02.", low=0, high=1
    )
    # Read as variances the paper's pushes exceed the car's top speed, and up to 42 % of tasks cannot be solved, while it
    # reports nearly equal mean path lengths.
    noise_is: Literal["std", "variance"] = option(
        "std", "Whether --noise is a standard deviation or a variance."
    )
    noise_per: Literal["task", "step"] = option(
        "task", "Whether a push belongs to a task, or is drawn anew every step: then all tasks are one."
    )
    hill: float = option(0.0, "The push acts where the car's position is at least this.", low=-1.2, high=0.6)
    bins: int = option(30, "Bins of the table along position and velocity.", low=2, high=1000)
    target_start: Literal["point", "valley"] = option(
        "point", "Where targets start: at rest at x = -0.5, or as Gymnasium has it at x ~ U(-0.6, -0.4)."
    )
    reward: Reward = option("goal", REWARD)

    name: ClassVar[str] = "mountain-car"
    actions: ClassVar[tuple[str, ...]] = ("left", "none", "right")
    tabular: ClassVar[bool] = False  # where a step leads depends on more than the bin
    source_tasks: ClassVar[int] = 100
    target_tasks: ClassVar[int] = 100
    # alpha, epsilon and the sources' episodes are the paper's; it gives no gamma and no horizon
    source_learning: ClassVar[Learning] = Learning(
        alpha=0.05, gamma=0.99, epsilon=0.5, episodes=500_000, horizon=1_000, start="anywhere"
    )
    target_learning: ClassVar[Learning] = Learning(
        alpha=0.05, gamma=0.99, epsilon=0.1, episodes=1_000, horizon=1_000, start="fixed"
    )

    def __post_init__(self) -> None:
        check(self)

    @property
    def label(self) -> str:
        """What tells this distribution from its neighbours, for names of artefacts."""
        step = "-per-step" if self.noise_per == "step" else ""
        variance = "-variance" if self.noise_is == "variance" else ""
        bins = "" if self.bins == 30 else f"-{self.bins}"
        hill = "" if self.hill == 0 else f"-hill-{self.hill:g}"
        start = "" if self.target_start == "point" else f"-from-the-{self.target_start}"
        reward = in_label(self.reward)
        return f"mountain-car{bins}-noise{variance}-{self.noise:g}{step}{hill}{start}{reward}"

    @property
    def warning(self) -> str:
        """What whoever uses this distribution should know; empty if nothing."""
        if self.noise_per == "step":
            return "with --noise-per step all tasks are the same: there is no distribution to transfer from"
        return ""

    @property
    def spread(self) -> float:
        """Standard deviation of the push."""
        return self.noise if self.noise_is == "std" else math.sqrt(self.noise)

    @property
    def shape(self) -> tuple[int, ...]:
        """The state axes' lengths."""
        return (self.bins, self.bins)

    def axes(self) -> tuple[Axis, ...]:
        """The state axes: position and velocity, by the bins' centres."""
        from qinit_store.schema import Axis

        return (
            Axis("position", self._centres(*POSITIONS), "1", "position at the bin's centre"),
            Axis(
                "velocity", self._centres(*VELOCITIES), "1", "velocity at the bin's centre, positions a step"
            ),
        )

    def box(self) -> tuple[tuple[str, float, float], ...]:
        """Name, low and high of each dimension of the continuous state."""
        return ("position", *POSITIONS), ("velocity", *VELOCITIES)

    def target_state(self) -> tuple[float, ...]:
        """Where targets start: at rest in the valley."""
        return START

    def shown_states(self) -> tuple[tuple[float, ...], ...]:
        """The start, a state on the way and one that arrives; Figure 10 of the paper."""
        return (-0.5, 0.0), (-0.3, 0.02), (0.2, 0.04)

    def goal_chances(self) -> Floats:
        """Zeros, (S,): all tasks share one goal."""
        import numpy as np

        return np.zeros(self.bins**2)

    def closed(self) -> Mapping[str, Flags]:
        """Nothing: all states are open."""
        return {}

    def parameters(self) -> tuple[Column, ...]:
        """What a task is made of: its push."""
        from qinit_store.schema import Column

        most = FARTHEST * self.spread if self.noise_per == "task" else 0.0
        told = "push on the right hill, added to the position"
        return (Column("eta", ("task",), "<f8", "1", told, low=-most, high=most),)

    def shifted(self, changes: dict[str, Any]) -> MountainCar:
        """The family with some fields changed."""
        if changes.get("bins", self.bins) != self.bins:
            raise ValueError(f"the tables have {self.bins} x {self.bins} bins: bins cannot be shifted")
        return dataclasses.replace(self, **changes)

    def draw(self, rng: np.random.Generator) -> tuple[float]:
        """One task: its push; 0 where pushes are drawn every step."""
        return (float(rng.normal(0.0, self.spread)) if self.noise_per == "task" else 0.0,)

    @property
    def untabled(self) -> str:
        """Why there are no exact tables."""
        return "mountain-car is not Markov in its table's states"

    def ends(self) -> dict[str, Any]:
        """Nothing: no setting decides which ends are the goal."""
        return {}

    def refusal(self, learning: Learning) -> str:
        """Why its tasks cannot be learned so: nothing."""
        return ""

    def payment(self, gamma: float) -> Payment | None:
        """What steps pay; None: 1 on reaching the goal."""
        return payment(self.reward, gamma)

    def worlds(self, tasks: Tasks, own: Sequence[np.random.SeedSequence]) -> Worlds:
        """The tasks as the compiled loop takes them; `own` are the streams of pushes that are drawn every step."""
        from qinit_cli.kernels.mountain_car import MountainCars
        from qinit_cli.kernels.random_streams import seeds

        gusty = self.noise_per == "step"
        return MountainCars(
            eta=tasks["eta"].copy(),
            hill=self.hill,
            bins=self.bins,
            start=self.target_start,
            noise=self.spread if gusty else 0.0,
            rng=seeds(own) if gusty else None,
        )

    def solve(self, tasks: Tasks, gamma: float) -> tuple[Floats, Floats]:
        """NotAllowed: Mountain Car is not Markov in its bins, so there are no exact tables."""
        raise NotAllowed(
            "mountain-car is not Markov in its bins: there are no exact tables; learn it by q-learning"
        )

    def exploring_value(self, tasks: Tasks, q: Floats, learning: Learning) -> Floats:
        """NotAllowed, as `solve`."""
        raise NotAllowed(
            "mountain-car is not Markov in its bins: the value of a policy on them is not defined"
        )

    def start_value(self, q: Floats) -> Floats:
        """max_a of `q` (B, S, A) at the target start, (B,)."""
        row, column = (
            int((at - low) / (high - low) * self.bins)
            for at, (low, high) in zip(START, (POSITIONS, VELOCITIES), strict=True)
        )
        values: Floats = q[:, row * self.bins + column].max(axis=1)
        return values

    def path_lengths(self, tasks: Tasks, q: Floats, horizon: int) -> NDArray[np.int32]:
        """Steps from each bin's centre, (B, S, A): the continuous dynamics, greedy in `q`; -1 if beyond the horizon."""
        import numpy as np

        from qinit_cli.kernels import mountain_car_paths

        eopl = np.empty(q.shape, np.int32)
        mountain_car_paths.path_lengths(tasks["eta"].copy(), self.hill, self.bins, q, horizon, eopl)
        return eopl

    def log_path(self, tasks: Tasks, lengths: NDArray[np.integer]) -> Floats:
        """0, (1, 1, 1): given the push every step is certain; NotAllowed where pushes are drawn every step."""
        import numpy as np

        if self.noise_per == "step":
            raise NotAllowed("with --noise-per step pushes have a density, and no path has a probability")
        return np.zeros((1, 1, 1))

    def solved(self, tasks: Tasks, q: Floats, horizon: int) -> Flags:
        """Whether the greedy path from the target start, at rest at x = -0.5, arrives within the horizon, (B,)."""
        import numpy as np

        from qinit_cli.kernels import mountain_car_paths

        lengths = np.empty(len(tasks), np.int64)
        eta = tasks["eta"].copy()
        mountain_car_paths.greedy_lengths(eta, self.hill, self.bins, q, horizon, *START, lengths)
        arrives: Flags = lengths > 0
        return arrives

    def visits(self, tasks: Tasks, q: Floats, horizon: int) -> NDArray[np.int32]:
        """How often the greedy path from the target start is in each bin, (B, S): the car's own state, step by step.

        Its start and where it arrives included; zeros where it does not arrive within the horizon.
        """
        import numpy as np

        from qinit_cli.kernels import mountain_car_paths

        visits = np.empty(q.shape[:2], np.int32)
        eta = tasks["eta"].copy()
        mountain_car_paths.greedy_visits(eta, self.hill, self.bins, q, horizon, *START, visits)
        return visits

    def solvable(self, tasks: Tasks, solved: Flags, horizon: int) -> Flags:
        """Whether a task's own greedy path or the energy pump, right if v >= 0 and else left, arrives from the start, (B,)."""
        import numpy as np

        from qinit_cli.kernels import mountain_car_paths

        lengths = np.empty(len(tasks), np.int64)
        mountain_car_paths.pumped_lengths(tasks["eta"].copy(), self.hill, horizon, *START, lengths)
        either: Flags = solved | (lengths > 0)
        return either

    def nearness(self, tasks: Tasks, gamma: float, *, linear: bool) -> Floats:
        """How near each state is to the goal, 0 to 1, (S,): the position from the left wall to the flag.

        The same for every task: the flag does not move. NotAllowed for `linear`, which the position is as it is.
        """
        import numpy as np

        if linear:
            raise NotAllowed("mountain-car's distance is the position, linear as it is; leave --distance out")
        position = np.repeat(self._centres(*POSITIONS), self.bins)
        near: Floats = np.clip((position + 1.2) / 1.7, 0.0, 1.0)
        return near

    def _centres(self, low: float, high: float) -> Floats:
        import numpy as np

        return low + (np.arange(self.bins, dtype=np.float64) + 0.5) * ((high - low) / self.bins)
