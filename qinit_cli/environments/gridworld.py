"""The gridworld whose goals change from task to task; section 7.1 of the paper."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, Literal

from qinit_cli.environments.normal_goals import NormalGoals
from qinit_cli.environments.slippery_grid import SlipperyGrid
from qinit_cli.grid_map import LEAST, MOST, map_text, read_map
from qinit_cli.options import check, option
from qinit_cli.rewards import REWARD, Reward

if TYPE_CHECKING:
    import numpy as np

    from qinit_cli.arrays import Floats


@dataclass(frozen=True)
class Gridworld(SlipperyGrid):
    """A grid with slippery moves; the goal and the slip change from task to task (section 7.1)."""

    size: int | None = option(
        None, "Cells along each side.", default_text="30, or the map's", low=LEAST, high=MOST
    )
    map: str | Path | None = option(
        None,
        "A text file of walls, starts and goals, a letter a cell (docs/maps.md).",
        default_text="an open square",
        metavar="FILE",
    )
    goals: Literal["normal", "uniform"] | None = option(
        None,
        "How goals are drawn, from the map's G or else all free cells but the start: around a mean, or uniformly.",
        default_text="normal; uniform where the map has G",
    )
    goals_per_task: int = option(1, "Goals of each task, which ends in any of them.", low=1, high=9)
    mean: float | None = option(
        None, "Mean of the goal's row and column.", default_text="2/3 of the size", low=0
    )
    variance: float | None = option(
        None,
        "Variance of the goal's row and column; the paper's are 1, 3, 5, 7, 10.",
        default_text="7",
        low=0,
    )
    p_low: float = option(0.6, "Lowest probability that a move goes where it was meant to.", low=0.25, high=1)
    p_high: float = option(0.9, "Highest such probability; each task draws its own.", low=0.25, high=1)
    slip_per: Literal["task", "cell"] = option(
        "task", "task: each task draws one such probability; cell: one for each of its cells."
    )
    reward: Reward = option("goal", REWARD)

    name: ClassVar[str] = "gridworld"

    def __post_init__(self) -> None:
        if self.map is None and self.size is None:
            object.__setattr__(self, "size", 30)
        check(self)
        self._check_slip()
        if self.map is not None:
            if self.size is not None:
                raise ValueError(
                    f"--size {self.size}: the map has a size of its own; leave out --size or --map"
                )
            text = map_text(self.map) if isinstance(self.map, Path) else self.map
            object.__setattr__(self, "map", read_map(text).text)
        if self.goals is None:
            object.__setattr__(self, "goals", "uniform" if self.grid.has_goals else "normal")
        if self.goals == "uniform":
            for name in ("mean", "variance"):
                if getattr(self, name) is not None:
                    raise ValueError(f"--{name} belongs to normal goals; with --goals uniform leave it out")
            places = len(self.grid.goal_places)
            if self.goals_per_task > places:
                raise ValueError(
                    f"--goals-per-task {self.goals_per_task}: there are {places} places for goals; ask for fewer"
                )
        else:
            rows, columns = self.shape
            if self.mean is None and rows == columns:
                object.__setattr__(self, "mean", 2 * rows / 3)
            if self.variance is None:
                object.__setattr__(self, "variance", 7.0)
            self._normal()

    @property
    def label(self) -> str:
        """What tells this distribution from its neighbours, for names of artefacts."""
        goals = "uniform" if self.goals == "uniform" else f"variance-{self.variance:g}"
        mean = "" if self.mean is None or self.mean == 2 * self.shape[0] / 3 else f"-mean-{self.mean:g}"
        return self._label(f"{goals}{mean}")

    def shown_states(self) -> tuple[tuple[float, ...], ...]:
        """The target start, the middle of the goals and the far corner; Figure 5 of the paper.

        On a map the likeliest start, the likeliest goal, and the cell farthest from that start.
        """
        if self.size is None:
            return self._shown_on_map()
        far = self.size - 1.0
        middle = min(float(round(2 * self.size / 3 if self.mean is None else self.mean)), far)
        return (0.0, 0.0), (middle, middle), (far, far)

    def goal_chances(self) -> Floats:
        """How likely each cell is to be a task's goal, (S,); of several its first."""
        import numpy as np

        if self.goals == "normal":
            return self._normal().probabilities()
        places = list(self.grid.goal_places)
        probabilities = np.zeros(len(self.grid.moves))
        probabilities[places] = 1 / len(places)
        return probabilities

    def shifted(self, changes: dict[str, Any]) -> Gridworld:
        """The family with some fields changed; what belongs to the old kind of goals alone is dropped with it."""
        kept = {} if changes.get("goals", self.goals) == self.goals else {"mean": None, "variance": None}
        return super().shifted(kept | changes)

    def draw(self, rng: np.random.Generator) -> tuple[float, ...]:
        """One task: row and column of each goal, and p or the seed of the cells' p. A target start is never a goal."""
        goals: list[tuple[int, int]] = []
        while len(goals) < self.goals_per_task:
            goal = self._normal().draw(rng) if self.goals == "normal" else self._uniform(rng)
            if goal not in goals:
                goals.append(goal)
        return *(coordinate for goal in goals for coordinate in goal), self._slip(rng)

    def _normal(self) -> NormalGoals:
        row, column = (2 * cells / 3 if self.mean is None else self.mean for cells in self.shape)
        return NormalGoals(self.grid, row, column, self.variance or 0.0, self.goals_per_task)

    def _uniform(self, rng: np.random.Generator) -> tuple[int, int]:
        if self.size is None:  # where few cells are places for goals, redrawing would not end soon
            return self.grid.place(self.grid.goal_places[int(rng.integers(len(self.grid.goal_places)))])
        row, column = 0, 0
        while (row, column) == (0, 0):
            row, column = (int(cell) for cell in rng.integers(self.size, size=2))
        return row, column

    def _shown_on_map(self) -> tuple[tuple[float, ...], ...]:
        import numpy as np

        from qinit_cli.kernels import gridworld_exact

        start = self.grid.start
        distance = np.empty((1, len(self.grid.moves)), np.int64)
        gridworld_exact.distances(self.grid.moves, np.array([[start]]), distance)
        cells = (start, int(self.goal_chances().argmax()), int(distance[0].argmax()))
        places = dict.fromkeys(self.grid.place(cell) for cell in cells)
        return tuple((float(row), float(column)) for row, column in places)
