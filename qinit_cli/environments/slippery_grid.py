"""The grid with slippery moves whose goal changes from task to task, however it is drawn: what its families share."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, ClassVar, Self

from qinit_cli.learning import Learning
from qinit_cli.rewards import Payment, exact_returns, exact_variances, in_label, payment

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from qinit_cli.arrays import Flags, Floats, Integers, Tasks
    from qinit_cli.kernels.batch import Worlds
    from qinit_store.schema import Axis, Column

EXACT_TOLERANCE = 1e-12  # on V
START = 0  # where target tasks start: the cell (0, 0)


class SlipperyGrid:
    """A square grid; a task is a goal and the probability that a move goes where it was meant to.

    A subclass is a frozen dataclass with these fields, a name, a label, the states it shows, and its way of drawing goals.
    """

    name: ClassVar[str]
    size: int
    p_low: float
    p_high: float
    reward: str

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

    def _check_slip(self) -> None:
        if self.p_low > self.p_high:
            raise ValueError(f"--p-low {self.p_low} is above --p-high {self.p_high}")

    def _label(self, goals: str) -> str:
        """The family's name, with how it draws goals and what else is not as usual."""
        size = "" if self.size == 30 else f"-{self.size}"
        p = "" if (self.p_low, self.p_high) == (0.6, 0.9) else f"-p-{self.p_low:g}-{self.p_high:g}"
        return f"{self.name}{size}-{goals}{p}{in_label(self.reward)}"

    def _slip(self, rng: np.random.Generator) -> float:
        return float(rng.uniform(self.p_low, self.p_high))

    @property
    def shape(self) -> tuple[int, ...]:
        """The state axes' lengths."""
        return (self.size, self.size)

    def axes(self) -> tuple[Axis, ...]:
        """The state axes: row and column."""
        import numpy as np

        from qinit_store.schema import Axis

        cells = np.arange(self.size, dtype=np.int32)
        return (Axis("row", cells, "1", "grid row"), Axis("col", cells, "1", "grid column"))

    def parameters(self) -> tuple[Column, ...]:
        """What a task is made of: its goal and the probability that a move goes where it was meant to."""
        from qinit_store.schema import Column

        return (
            Column("goal_row", ("task",), "<i4", "1", "row of the goal", low=0, high=self.size - 1),
            Column("goal_col", ("task",), "<i4", "1", "column of the goal", low=0, high=self.size - 1),
            Column(
                "p",
                ("task",),
                "<f8",
                "1",
                "probability of the intended move",
                low=self.p_low,
                high=self.p_high,
            ),
        )

    def shifted(self, changes: dict[str, Any]) -> Self:
        """The family with some fields changed; ValueError for another size, which these tables would not fit."""
        if changes.get("size", self.size) != self.size:
            raise ValueError(f"the tables are of a {self.size} x {self.size} grid: size cannot be shifted")
        return dataclasses.replace(self, **changes)  # type: ignore[type-var]  # every subclass is a dataclass

    @property
    def warning(self) -> str:
        """What whoever uses this distribution should know; nothing."""
        return ""

    @property
    def untabled(self) -> str:
        """Why there are no exact tables: there are."""
        return ""

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
        """The tasks as the compiled loop takes them; all that is random is in the steps' draws, `own` is not used."""
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
        paid = self.payment(gamma)
        return exact_returns(paid, gamma, q), exact_variances(paid, gamma, td_var)

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
            learning.last_epsilon,
            EXACT_TOLERANCE,
            q,
            value,
        )
        at_start: Floats = value[:, START]
        return exact_returns(self.payment(learning.gamma), learning.gamma, at_start)

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
        """ln of the probability of the path, (B, S, 4): every step after the first moves, and does so with probability p."""
        import numpy as np

        from qinit_cli.elementary import ln

        p = tasks["p"][:, None, None]
        slip = (1 - p) / 3
        # the first step may be meant for a wall, and stays as often as any of the cell's walls is met
        wall = self._walls()
        walls = wall.sum(axis=1, keepdims=True)
        first = np.maximum(np.where(wall, p + (walls - 1) * slip, p), walls * slip)
        ways: Floats = ln(first) + (lengths - 1) * ln(p)
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

        from qinit_cli.elementary import power

        row, column = np.divmod(np.arange(self.size**2), self.size)
        down = np.abs(row - tasks["goal_row"][:, None].astype(np.int64))
        across = np.abs(column - tasks["goal_col"][:, None].astype(np.int64))
        distance = down + across
        near: Floats = 1 - distance / (2 * (self.size - 1)) if linear else power(gamma, distance)
        return near

    def _goals(self, tasks: Tasks) -> Integers:
        import numpy as np

        goals: Integers = tasks["goal_row"].astype(np.int64) * self.size + tasks["goal_col"]
        return goals
