"""The gridworld whose goal changes from task to task; section 7.1 of the paper."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, ClassVar, Literal

from qinit_cli.fields import check, option
from qinit_cli.learning import Learning

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from qinit_cli.arrays import Flags, Floats, Integers, Tasks
    from qinit_cli.kernels.batch import Worlds
    from store.schema import Axis, Column

LEAST_MASS = 0.01  # of the goal distribution that must lie on the grid: below it, redrawing would change the distribution
EXACT_TOLERANCE = 1e-12  # on V
START = 0  # where target tasks start: the cell (0, 0)


@dataclass(frozen=True)
class Gridworld:
    """A square grid with slippery moves; the goal and the slip change from task to task (section 7.1)."""

    size: int = option(30, "Cells along each side.", low=2, high=1000)
    goals: Literal["normal", "uniform"] = option(
        "normal", "How goals are drawn: around a mean, or uniformly over the cells but the target start."
    )
    mean: float | None = option(
        None, "Mean of the goal's row and column.", default_text="2/3 of the size", low=0
    )
    variance: float | None = option(
        None,
        "Variance of the goal's row and column; the paper's are 1, 3, 5, 7, 10.",
        default_text="7",
        low=0,
    )
    p_low: float = option(0.6, "Lowest chance that a move goes where it was meant to.", low=0.25, high=1)
    p_high: float = option(0.9, "Highest such chance; each task draws its own.", low=0.25, high=1)

    name: ClassVar[str] = "gridworld"
    actions: ClassVar[tuple[str, ...]] = ("up", "down", "left", "right")
    tabular: ClassVar[bool] = True
    source_tasks: ClassVar[int] = 100
    target_tasks: ClassVar[int] = 200
    # The paper gives no alpha, gamma, epsilon, horizon or start for the gridworld: our choice.
    source_learning: ClassVar[Learning] = Learning(
        alpha=0.1, gamma=0.95, epsilon=0.5, episodes=100_000, horizon=1_000, start="anywhere"
    )
    target_learning: ClassVar[Learning] = Learning(
        alpha=0.1, gamma=0.95, epsilon=0.1, episodes=1_000, horizon=1_000, start="fixed"
    )

    def __post_init__(self) -> None:
        if self.goals == "uniform":
            for name in ("mean", "variance"):
                if getattr(self, name) is not None:
                    raise ValueError(f"--{name} belongs to normal goals; with --goals uniform leave it out")
        elif self.goals == "normal":
            if self.mean is None:
                object.__setattr__(self, "mean", 2 * self.size / 3)
            if self.variance is None:
                object.__setattr__(self, "variance", 7.0)
        check(self)
        if self.p_low > self.p_high:
            raise ValueError(f"--p-low {self.p_low} is above --p-high {self.p_high}")
        if self.goals == "normal" and self._mass_on_grid() < LEAST_MASS:
            raise ValueError(
                f"goals with mean {self.mean:g} and variance {self.variance:g} fall on the {self.size} x {self.size} grid, "
                f"start apart, less than once in 100 draws; choose a mean on the grid"
            )

    @property
    def label(self) -> str:
        """What tells this distribution from its neighbours, for names of artefacts."""
        size = "" if self.size == 30 else f"-{self.size}"
        goals = "uniform" if self.goals == "uniform" else f"variance-{self.variance:g}"
        mean = "" if self.mean is None or self.mean == 2 * self.size / 3 else f"-mean-{self.mean:g}"
        p = "" if (self.p_low, self.p_high) == (0.6, 0.9) else f"-p-{self.p_low:g}-{self.p_high:g}"
        return f"gridworld{size}-{goals}{mean}{p}"

    @property
    def shape(self) -> tuple[int, ...]:
        """The state axes' lengths."""
        return (self.size, self.size)

    def axes(self) -> tuple[Axis, ...]:
        """The state axes: row and column."""
        import numpy as np

        from store.schema import Axis

        cells = np.arange(self.size, dtype=np.int32)
        return (Axis("row", cells, "1", "grid row"), Axis("col", cells, "1", "grid column"))

    def shown_states(self) -> tuple[tuple[float, ...], ...]:
        """The target start, the middle of the goals and the far corner; Figure 5 of the paper."""
        far = self.size - 1.0
        middle = min(float(round(2 * self.size / 3 if self.mean is None else self.mean)), far)
        return (0.0, 0.0), (middle, middle), (far, far)

    def goal_chances(self) -> Floats:
        """How likely each cell is to be a task's goal, (S,): rounded to cells, redrawn off the grid and at the start."""
        import numpy as np

        line = np.array(
            [
                1.0 if self.goals == "uniform" else self._within(cell - 0.5, cell + 0.5)
                for cell in range(self.size)
            ]
        )
        chances: Floats = np.outer(line, line).ravel()
        chances[START] = 0.0
        chances /= chances.sum()
        return chances

    def parameters(self) -> tuple[Column, ...]:
        """What a task is made of: its goal and the chance that a move goes where it was meant to."""
        from store.schema import Column

        return (
            Column("goal_row", ("task",), "<i4", "1", "row of the goal"),
            Column("goal_col", ("task",), "<i4", "1", "column of the goal"),
            Column("p", ("task",), "<f8", "1", "probability of the intended move"),
        )

    def shifted(self, changes: dict[str, Any]) -> Gridworld:
        """The family with some fields changed; what belongs to the old kind of goals alone is dropped with it."""
        if changes.get("size", self.size) != self.size:
            raise ValueError(f"the tables are of a {self.size} x {self.size} grid: size cannot be shifted")
        kept = {} if changes.get("goals", self.goals) == self.goals else {"mean": None, "variance": None}
        return dataclasses.replace(self, **(kept | changes))

    def draw(self, chance: np.random.Generator) -> tuple[int, int, float]:
        """One task: goal row, goal column and p. The target start (0, 0) is never a goal."""
        row, column = 0, 0
        while (row, column) == (0, 0) or not (0 <= row < self.size and 0 <= column < self.size):
            if self.goals == "uniform":
                row, column = (int(cell) for cell in chance.integers(self.size, size=2))
            else:
                place = chance.normal(self.mean or 0.0, math.sqrt(self.variance or 0.0), size=2)
                row, column = (round(float(coordinate)) for coordinate in place)
        return row, column, float(chance.uniform(self.p_low, self.p_high))

    @property
    def warning(self) -> str:
        """What whoever uses this distribution should know; nothing."""
        return ""

    def worlds(self, tasks: Tasks, own: Sequence[np.random.SeedSequence]) -> Worlds:
        """The tasks as the compiled loop takes them; all their chance is in the steps' dice, `own` is not used."""
        from qinit_cli.kernels.gridworld import Gridworlds

        return Gridworlds(self.size, self._goals(tasks), tasks["p"].copy(), START)

    def solve(self, tasks: Tasks, gamma: float) -> tuple[Floats, Floats]:
        """Exact Q* and the variance of a step's target under it, (B, S, A) each; Gauss-Seidel value iteration."""
        import numpy as np

        from qinit_cli.kernels import gridworld_exact

        q = np.empty((len(tasks), self.size**2, len(self.actions)))
        td_var = np.empty_like(q)
        gridworld_exact.solve(
            self._goals(tasks), tasks["p"].copy(), self.size, gamma, EXACT_TOLERANCE, q, td_var
        )
        return q, td_var

    def exploring_value(self, tasks: Tasks, q: Floats, learning: Learning) -> Floats:
        """What acting epsilon-greedily on `q` (B, S, A) is worth from the target start, (B,)."""
        import numpy as np

        from qinit_cli.kernels import gridworld_exact

        value = np.empty(q.shape[:2])
        gridworld_exact.exploring_value(
            self._goals(tasks),
            tasks["p"].copy(),
            self.size,
            learning.gamma,
            learning.epsilon,
            EXACT_TOLERANCE,
            q,
            value,
        )
        at_start: Floats = value[:, START]
        return at_start

    def start_value(self, q: Floats) -> Floats:
        """max_a of `q` (B, S, A) at the cell (0, 0), (B,)."""
        values: Floats = q[:, START].max(axis=1)
        return values

    def path_lengths(self, tasks: Tasks, q: Floats, horizon: int) -> NDArray[np.int32]:
        """Expected optimal path lengths, (B, S, A); definition 1 of the paper, -1 where a path never arrives.

        A cell revisited never arrives, so the horizon has no say here.
        """
        import numpy as np

        from qinit_cli.kernels import gridworld_exact

        eopl = np.empty(q.shape, np.int32)
        gridworld_exact.path_lengths(self._goals(tasks), tasks["p"].copy(), self.size, q, eopl)
        return eopl

    def log_path(self, tasks: Tasks, lengths: NDArray[np.integer]) -> Floats:
        """ln of the chance of the path, (B, S, 4): every step after the first moves, and does so with chance p."""
        import numpy as np

        p = tasks["p"][:, None, None]
        slip = (1 - p) / 3
        # the first step may be meant for a wall, and stays as often as any of the cell's walls is met
        wall = self._walls()
        walls = wall.sum(axis=1, keepdims=True)
        first = np.maximum(np.where(wall, p + (walls - 1) * slip, p), walls * slip)
        ways: Floats = np.log(first) + (lengths - 1) * np.log(p)
        return ways

    def _walls(self) -> Flags:
        """Whether each action of each cell is stopped by a wall, (S, 4)."""
        import numpy as np

        row, column = np.divmod(np.arange(self.size**2), self.size)
        last = self.size - 1
        return np.stack([row == 0, row == last, column == 0, column == last], axis=1)

    def solved(self, tasks: Tasks, q: Floats, horizon: int) -> Flags:
        """Whether the greedy path from the target start reaches the goal within the horizon, (B,)."""
        import numpy as np

        greedy = q[:, START].argmax(axis=1)
        length = self.path_lengths(tasks, q, horizon)[np.arange(len(q)), START, greedy]
        arrives: Flags = (length > 0) & (length <= horizon)
        return arrives

    def visits(self, tasks: Tasks, q: Floats, horizon: int) -> NDArray[np.int32]:
        """The cells of the greedy path from the target start, (B, S), 1 on it: each step leads where it most likely does.

        The start and the goal included; zeros where it does not arrive within the horizon.
        """
        import numpy as np

        from qinit_cli.kernels import gridworld_exact

        visits = np.empty(q.shape[:2], np.int32)
        goals, p = self._goals(tasks), tasks["p"].copy()
        gridworld_exact.greedy_visits(goals, p, self.size, q, horizon, START, visits)
        return visits

    def solvable(self, tasks: Tasks, solved: Flags, horizon: int) -> Flags:
        """Whether a task can be solved at all, (B,): always, as every cell can be reached."""
        import numpy as np

        return np.ones(len(tasks), np.bool_)

    def nearness(self, tasks: Tasks, gamma: float, *, linear: bool) -> Floats:
        """How near each cell is to the task's goal, 0 to 1, (B, S): gamma^d, or 1 - d/d_max, d the Manhattan distance."""
        import numpy as np

        row, column = np.divmod(np.arange(self.size**2), self.size)
        down = np.abs(row - tasks["goal_row"][:, None].astype(np.int64))
        across = np.abs(column - tasks["goal_col"][:, None].astype(np.int64))
        distance = down + across
        near: Floats = 1 - distance / (2 * (self.size - 1)) if linear else np.power(gamma, distance)
        return near

    def _goals(self, tasks: Tasks) -> Integers:
        import numpy as np

        goals: Integers = tasks["goal_row"].astype(np.int64) * self.size + tasks["goal_col"]
        return goals

    def _mass_on_grid(self) -> float:
        """The chance that one normal draw is on the grid and not the target start."""
        on_grid = self._within(-0.5, self.size - 0.5) ** 2
        return on_grid - self._within(-0.5, 0.5) ** 2

    def _within(self, low: float, high: float) -> float:
        mean, deviation = self.mean or 0.0, math.sqrt(self.variance or 0.0)
        if mean + deviation == mean:  # every draw is the mean, rounded as draws are
            return float(low < round(mean) < high)
        near, far = sorted((high - mean, low - mean), key=abs)
        if near * far > 0:  # on one side of the mean, where differences of erf would lose the tails
            tails = [math.erfc(abs(edge) / deviation / math.sqrt(2)) for edge in (near, far)]
            return (tails[0] - tails[1]) / 2
        return (
            math.erf((high - mean) / deviation / math.sqrt(2))
            - math.erf((low - mean) / deviation / math.sqrt(2))
        ) / 2
