"""The unit square with a round goal that changes from task to task: how goals are drawn, and what its families share."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any, ClassVar

from qinit_cli.environments.continuous import ContinuousFamily
from qinit_cli.errors import NotAllowed
from qinit_cli.learning import Learning

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from qinit_cli.arrays import Flags, Floats, Tasks
    from qinit_store.schema import Column

LEAST_MASS = 0.01  # of draws that must be places for goals: below it, redrawing would change the distribution
POINTS = 160  # along each side of the square, at least, at which places for goals are looked for

GOALS = "How goals are drawn: normal, around a mean, or uniform in the square; anew where none may be."
MEAN = "Mean of the goal's x and y."
STD = "Standard deviation of the goal's x and y."


class SquareFamily(ContinuousFamily):
    """A world in the unit square whose tasks are goals; subclasses have these options, a target start and `continuous_world`."""

    goals: str
    mean: float | None
    std: float | None
    radius: float
    step: float
    noise: float
    usual_mean: ClassVar[float]
    usual_std: ClassVar[float]
    start: ClassVar[tuple[float, float]]  # where targets start
    detour: ClassVar[float] = 0.0  # by which a way to a goal may be longer than one straight along the axes

    actions: ClassVar[tuple[str, ...]] = ("up", "down", "left", "right")
    usual_bins: ClassVar[str] = "20"
    source_learning: ClassVar[Learning] = Learning(
        alpha=0.1, gamma=0.95, epsilon=0.5, episodes=50_000, horizon=500, start="anywhere"
    )
    target_learning: ClassVar[Learning] = Learning(
        alpha=0.1, gamma=0.95, epsilon=0.1, episodes=1_000, horizon=500, start="fixed"
    )

    def __post_init__(self) -> None:
        given = {"mean": self.mean, "std": self.std}
        if self.goals == "uniform":
            for name, value in given.items():
                if value is not None:
                    raise ValueError(f"--{name} belongs to normal goals; with --goals uniform leave it out")
        else:
            for name, usual in {"mean": self.usual_mean, "std": self.usual_std}.items():
                if given[name] is None:
                    object.__setattr__(self, name, usual)
        super().__post_init__()
        self._check_goals()

    def _usual(self) -> dict[str, Any]:
        normal = self.goals == "normal"
        return super()._usual() | ({"mean": self.usual_mean, "std": self.usual_std} if normal else {})

    def box(self) -> tuple[tuple[str, float, float], ...]:
        """x and y."""
        return (("x", 0.0, 1.0), ("y", 0.0, 1.0))

    def target_state(self) -> tuple[float, ...]:
        """Where targets start."""
        return self.start

    def parameters(self) -> tuple[Column, ...]:
        """What a task is made of: its goal."""
        from qinit_store.schema import Column

        return tuple(
            Column(f"goal_{axis}", ("task",), "<f8", "1", f"{axis} of the goal's middle", low=0, high=1)
            for axis in ("x", "y")
        )

    def draw(self, rng: np.random.Generator) -> tuple[float, float]:
        """One task: its goal's middle."""
        while True:
            x, y = self._drawn(rng)
            if self._is_place(x, y):
                return x, y

    def goal_chances(self) -> Floats:
        """How likely the goal's middle is in each bin, (S,); bins that hold places of both kinds to a few hundredths."""
        import numpy as np

        columns, rows = self.bin_counts
        across, along = (max(1, POINTS // count) for count in self.bin_counts)
        fine = np.array(self._chances(columns * across, rows * along))
        chances: Floats = fine.reshape(columns, across, rows, along).sum(axis=(1, 3)).ravel()
        chances /= chances.sum()
        return chances

    def solvable(self, tasks: Tasks, solved: Flags, horizon: int) -> Flags:
        """Whether a way along the axes to the goal fits into the horizon, (B,), noise apart; nothing cuts the square in two."""
        import numpy as np

        x, y = tasks["goal_x"] - self.start[0], tasks["goal_y"] - self.start[1]
        sides = np.abs(x) + np.abs(y)
        possible: Flags = sides + self.detour <= self.step * horizon
        return possible | solved

    def log_path(self, tasks: Tasks, lengths: NDArray[np.integer]) -> Floats:
        """0, (1, 1, 1), without noise; NotAllowed with it: then steps have a density, and no path has a probability."""
        import numpy as np

        if self.noise > 0:
            raise NotAllowed(f"the noise of {self.name} has a density, and no path has a probability")
        return np.zeros((1, 1, 1))

    def nearness(self, tasks: Tasks, gamma: float, *, linear: bool) -> Floats:
        """How near each bin's centre is to the task's goal, 0 to 1, (B, S): gamma^d, d in steps, or linear 1 - d / d_max.

        d is the way along the axes, as steps go; puddles do not count.
        """
        import numpy as np

        from qinit_cli.elementary import power

        x, y = self._centres().T
        distance = np.abs(x - tasks["goal_x"][:, None]) + np.abs(y - tasks["goal_y"][:, None])
        near: Floats = 1 - distance / 2 if linear else power(gamma, distance / self.step)
        return near

    def _square(self, tasks: Tasks) -> dict[str, Any]:
        """The fields of a world in the square that all such worlds have."""
        import numpy as np

        return {
            "goal_x": tasks["goal_x"].copy(),
            "goal_y": tasks["goal_y"].copy(),
            "radius": self.radius,
            "start_x": self.start[0],
            "start_y": self.start[1],
            "step": self.step,
            "noise": self.noise,
            **self._corners(),
            "observed": np.zeros((1, 2)),
        }

    def _drawn(self, rng: np.random.Generator) -> tuple[float, float]:
        """A goal that may be anywhere."""
        if self.mean is None or self.std is None:  # uniform
            return float(rng.random()), float(rng.random())
        return float(rng.normal(self.mean, self.std)), float(rng.normal(self.mean, self.std))

    def _is_place(self, x: float, y: float) -> bool:
        """Whether a goal may be there: in the square, and not at the target start."""
        inside = 0 <= x <= 1 and 0 <= y <= 1
        return inside and math.hypot(x - self.start[0], y - self.start[1]) > self.radius

    def _mass(self, low: float, high: float) -> float:
        """The probability that a coordinate of a goal that may be anywhere is from low to high."""
        if self.mean is None or self.std is None:
            return high - low
        below = [math.erf((edge - self.mean) / (self.std * math.sqrt(2))) for edge in (low, high)]
        return (below[1] - below[0]) / 2

    def _chances(self, across: int, along: int) -> list[list[float]]:
        """The probability of goals in cells of the square, by their middles; not yet divided by its sum. Free of numpy."""
        columns, rows = (
            [((cell + 0.5) / cells, self._mass(cell / cells, (cell + 1) / cells)) for cell in range(cells)]
            for cells in (across, along)
        )
        return [[mass * other if self._is_place(x, y) else 0.0 for y, other in rows] for x, mass in columns]

    def _check_goals(self) -> None:
        """ValueError where hardly a draw is a place for a goal."""
        if math.fsum(map(math.fsum, self._chances(POINTS, POINTS))) < LEAST_MASS:
            where = (
                "uniform goals"
                if self.goals == "uniform"
                else f"goals with mean {self.mean:g} and std {self.std:g}"
            )
            raise ValueError(
                f"{where} and a radius of {self.radius:g} are where no goal may be, off the square or at the start, 99 times in "
                "100; give a mean in the square, or a smaller --radius"
            )
