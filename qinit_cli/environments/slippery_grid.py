"""The grid with slippery moves whose goals change from task to task, however they are drawn: what its families share."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, Self

from qinit_cli.environments.bases import DrawnFamily
from qinit_cli.errors import NotAllowed
from qinit_cli.grid_map import MOVES, GridMap, open_map, read_map
from qinit_cli.learning import Learning
from qinit_cli.rewards import Payment, exact_returns, exact_variances, in_label, payment

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from qinit_cli.arrays import Flags, Floats, Integers, Tasks
    from qinit_cli.kernels.batch import Worlds
    from qinit_store.schema import Axis, Column

EXACT_TOLERANCE = 1e-12  # on V
LIKELY = 0.5  # a policy has solved a task whose goal it reaches from at least so many of the starts
SEEDS = 2**53  # of slips drawn for each cell: as many as every format holds exactly


class SlipperyGrid(DrawnFamily):
    """A grid; a task is its goals and the probability that a move goes where it was meant to.

    A subclass is a frozen dataclass with these fields, a name, a label, the states it shows, and its way of drawing goals.
    """

    name: ClassVar[str]
    size: int | None  # of an open square; None where there is a map
    p_low: float
    p_high: float
    reward: str
    map: str | Path | None = None  # a path only until it is read
    slip_per: str = "task"
    goals_per_task: int = 1

    actions: ClassVar[tuple[str, ...]] = MOVES
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
        size = "" if self.size == 30 else f"-{self.size or self.grid.label}"
        several = "" if self.goals_per_task == 1 else f"-{self.goals_per_task}-goals"
        p = "" if (self.p_low, self.p_high) == (0.6, 0.9) else f"-p-{self.p_low:g}-{self.p_high:g}"
        per_cell = "" if self.slip_per == "task" else "-slip-per-cell"
        return f"{self.name}{size}-{goals}{several}{p}{per_cell}{in_label(self.reward)}"

    def _slip(self, rng: np.random.Generator) -> float:
        """The task's p; where each cell has its own, what they are drawn from."""
        if self.slip_per == "cell":
            return int(rng.integers(SEEDS))
        return float(rng.uniform(self.p_low, self.p_high))

    @property
    def grid(self) -> GridMap:
        """The cells: those of the map, or an open square's."""
        return read_map(str(self.map)) if self.size is None else open_map(self.size)

    @property
    def shape(self) -> tuple[int, ...]:
        """The state axes' lengths."""
        return self.grid.shape

    def axes(self) -> tuple[Axis, ...]:
        """The state axes: row and column."""
        import numpy as np

        from qinit_store.schema import Axis

        rows, columns = (np.arange(cells, dtype=np.int32) for cells in self.shape)
        return (Axis("row", rows, "1", "grid row"), Axis("col", columns, "1", "grid column"))

    def parameters(self) -> tuple[Column, ...]:
        """What a task is made of: its goals and the probability that a move goes where it was meant to."""
        from qinit_store.schema import Column

        task, (rows, columns) = ("task",), self.shape
        found = []
        for number in self._numbers():
            of = f"of goal {number.removeprefix('_')}" if number else "of the goal"
            found += [
                Column(f"goal_row{number}", task, "<i4", "1", f"row {of}", low=0, high=rows - 1),
                Column(f"goal_col{number}", task, "<i4", "1", f"column {of}", low=0, high=columns - 1),
            ]
        if self.slip_per == "cell":
            named = "seed of the probabilities of the intended move in each cell"
            return (*found, Column("p_seed", task, "<i8", "1", named, low=0, high=SEEDS - 1))
        named = "probability of the intended move"
        return (*found, Column("p", task, "<f8", "1", named, low=self.p_low, high=self.p_high))

    def shifted(self, changes: dict[str, Any]) -> Self:
        """The family with some fields changed; ValueError for another size, which these tables would not fit."""
        rows, columns = self.shape
        if changes.get("size", self.size) != self.size:
            raise ValueError(f"the tables are of a {rows} x {columns} grid: size cannot be shifted")
        if "map" in changes:
            changes = {"size": None} | changes
        changed = dataclasses.replace(self, **changes)  # type: ignore[type-var]  # every subclass is a dataclass
        if changed.shape != self.shape:
            down, across = changed.shape
            raise ValueError(
                f"the tables are of a {rows} x {columns} grid, the map has {down} x {across} cells"
            )
        return changed

    def closed(self) -> Mapping[str, Flags]:
        """The cells that no episode is in, (S,), by what stands there: walls and holes of a map."""
        there = {"wall": self.grid.walls, "hole": self.grid.holes}
        return {name: cells for name, cells in there.items() if cells.any()}

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

        goals, p = self._goals(tasks), self._p(tasks)
        return Gridworlds(
            self.grid.moves,
            goals[:, 0] if self.goals_per_task == 1 else goals,
            p[:, 0] if self.slip_per == "task" else p,
            self.grid.starts,
        )

    def solve(self, tasks: Tasks, gamma: float) -> tuple[Floats, Floats]:
        """Exact Q* and the variance of a step's target under it, (B, S, A) each; Gauss-Seidel value iteration."""
        import numpy as np

        from qinit_cli.kernels import gridworld_exact

        moves = self.grid.moves
        q = np.empty((len(tasks), *moves.shape))
        td_var = np.empty_like(q)
        gridworld_exact.solve(moves, self._goals(tasks), self._p(tasks), gamma, EXACT_TOLERANCE, q, td_var)
        paid = self.payment(gamma)
        return exact_returns(paid, gamma, q), exact_variances(paid, gamma, td_var)

    def exploring_value(self, tasks: Tasks, q: Floats, learning: Learning) -> Floats:
        """What acting epsilon-greedily on `q` (B, S, A) is worth from the target start, (B,)."""
        import numpy as np

        from qinit_cli.kernels import gridworld_exact

        value = np.empty(q.shape[:2])
        gridworld_exact.exploring_value(
            self.grid.moves,
            self._goals(tasks),
            self._p(tasks),
            learning.gamma,
            learning.last_epsilon,
            EXACT_TOLERANCE,
            q,
            value,
        )
        at_start: Floats = value[:, self.grid.starts].mean(axis=1)
        return exact_returns(self.payment(learning.gamma), learning.gamma, at_start)

    def start_value(self, q: Floats) -> Floats:
        """max_a of `q` (B, S, A) at the target start, (B,); its mean where that is drawn."""
        values: Floats = q[:, self.grid.starts].max(axis=2).mean(axis=1)
        return values

    def path_lengths(self, tasks: Tasks, q: Floats, horizon: int) -> NDArray[np.int32]:
        """Expected optimal path lengths, (B, S, A); definition 1 of the paper, -1 where a path never arrives.

        A cell revisited never arrives, so the horizon has no say here.
        """
        import numpy as np

        from qinit_cli.kernels import gridworld_exact

        eopl = np.empty(q.shape, np.int32)
        gridworld_exact.path_lengths(self.grid.moves, self._goals(tasks), self._p(tasks), q, eopl)
        return eopl

    def log_path(self, tasks: Tasks, lengths: NDArray[np.integer]) -> Floats:
        """ln of the probability of the path, (B, S, 4): every step after the first moves, and does so with probability p.

        NotAllowed where p differs from cell to cell.
        """
        import numpy as np

        from qinit_cli.elementary import ln

        if self.slip_per == "cell":
            raise NotAllowed(
                "with --slip-per cell the probability of a path does not follow from its length; no theory to check"
            )

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

        moves = self.grid.moves
        stopped: Flags = moves == np.arange(len(moves))[:, None]
        return stopped

    def solved(self, tasks: Tasks, q: Floats, horizon: int) -> Flags:
        """Whether the greedy path from the target start reaches a goal within the horizon, (B,); at least every other drawn."""
        import numpy as np

        starts = self.grid.starts
        greedy = q[:, starts].argmax(axis=2)[..., None]
        length = np.take_along_axis(self.path_lengths(tasks, q, horizon)[:, starts], greedy, axis=2)[..., 0]
        likely: Flags = ((length > 0) & (length <= horizon)).mean(axis=1) >= LIKELY
        return likely

    def visits(self, tasks: Tasks, q: Floats, horizon: int) -> NDArray[np.int32]:
        """The cells of the greedy path from the likeliest start, (B, S), 1 on it: each step leads where it most likely does.

        The start and the goal included; zeros where it does not arrive within the horizon.
        """
        import numpy as np

        from qinit_cli.kernels import gridworld_exact

        visits = np.empty(q.shape[:2], np.int32)
        goals, p = self._goals(tasks), self._p(tasks)
        gridworld_exact.greedy_visits(self.grid.moves, goals, p, q, horizon, self.grid.start, visits)
        return visits

    def solvable(self, tasks: Tasks, solved: Flags, horizon: int) -> Flags:
        """Whether a task can be solved at all, (B,): always, as every cell can be reached."""
        import numpy as np

        return np.ones(len(tasks), np.bool_)

    def nearness(self, tasks: Tasks, gamma: float, *, linear: bool) -> Floats:
        """How near each cell is to a goal, 0 to 1, (B, S): gamma^d, or 1 - d/d_max, d the steps of the shortest way.

        d_max is the longest way of an open grid, on a map that to the task's goals; walls and holes are not near at all.
        """
        import numpy as np

        from qinit_cli.elementary import power
        from qinit_cli.kernels import gridworld_exact

        distance = np.empty((len(tasks), len(self.grid.moves)), np.int64)
        gridworld_exact.distances(self.grid.moves, self._goals(tasks), distance)
        farthest = distance.max(axis=1, keepdims=True) if self.size is None else sum(self.shape) - 2
        near: Floats = 1 - distance / farthest if linear else power(gamma, np.maximum(distance, 0))
        return np.where(distance < 0, 0.0, near)

    def _numbers(self) -> list[str]:
        """What stands after the names of each goal's parameters."""
        return ["", *(f"_{number}" for number in range(2, self.goals_per_task + 1))]

    def _goals(self, tasks: Tasks) -> Integers:
        """The cells of the goals, (B, K)."""
        import numpy as np

        columns = self.shape[1]
        return np.stack(
            [
                tasks[f"goal_row{at}"].astype(np.int64) * columns + tasks[f"goal_col{at}"]
                for at in self._numbers()
            ],
            axis=1,
        )

    def _p(self, tasks: Tasks) -> Floats:
        """The probability of the intended move in each cell, (B, S); (B, 1) where it is the same in all."""
        import numpy as np

        if self.slip_per == "task":
            whole: Floats = tasks["p"][:, None].copy()
            return whole
        cells = len(self.grid.moves)
        streams = [np.random.Generator(np.random.PCG64(int(seed))) for seed in tasks["p_seed"]]
        return np.array([own.uniform(self.p_low, self.p_high, cells) for own in streams]).reshape(-1, cells)
