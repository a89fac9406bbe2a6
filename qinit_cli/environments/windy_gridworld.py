"""The gridworld whose wind changes from task to task: the paper's example of a drone, with Weibull wind (its reference 17).

The goal and the slip stay, so that the wind alone makes the distribution. A wind of strength w, in cells a step, drifts the agent
after each move: by floor(w) cells and, with probability w - floor(w), by one more, so by w on the average. A wall stops it.
"""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, ClassVar, Literal, Self

from qinit_cli.environments.bases import TableFamily
from qinit_cli.grid_map import open_map
from qinit_cli.learning import Learning
from qinit_cli.options import check, option
from qinit_cli.rewards import REWARD, Reward, in_label

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from qinit_cli.arrays import Floats, Integers, Tasks
    from qinit_cli.kernels.tables import Tables
    from qinit_store.schema import Axis, Column

FARTHEST = 45.0  # standard Weibull of shape 1: numpy draws none beyond 44.5
DIRECTIONS = ("up", "down", "left", "right")


@dataclass(frozen=True)
class WindyGridworld(TableFamily):
    """A grid with one goal and a wind that drifts the agent; its strength, a Weibull, changes from task to task."""

    size: int = option(30, "Cells along each side.", low=2, high=100)
    goal_row: int | None = option(None, "Row of the goal.", default_text="2/3 of the size", low=0)
    goal_col: int | None = option(None, "Column of the goal.", default_text="2/3 of the size", low=0)
    p: float = option(0.75, "Probability that a move goes where it was meant to.", low=0.25, high=1)
    wind: Literal["up", "down", "left", "right", "any"] = option(
        "up", "Where it blows to; any: each task draws one of the four."
    )
    wind_shape: float = option(
        2.0, "Shape of the Weibull; 2, Rayleigh's, is usual for wind.", low=0.1, high=100
    )
    wind_scale: float = option(0.3, "Scale of the Weibull, in cells a step.", low=0, high=100)
    reward: Reward = option("goal", REWARD)

    name: ClassVar[str] = "windy-gridworld"
    actions: ClassVar[tuple[str, ...]] = DIRECTIONS
    source_tasks: ClassVar[int] = 100
    target_tasks: ClassVar[int] = 200
    source_learning: ClassVar[Learning] = Learning(
        alpha=0.1, gamma=0.95, epsilon=0.5, episodes=100_000, horizon=1_000, start="anywhere"
    )
    target_learning: ClassVar[Learning] = Learning(
        alpha=0.1, gamma=0.95, epsilon=0.1, episodes=1_000, horizon=1_000, start="fixed"
    )

    def __post_init__(self) -> None:
        for name in ("goal_row", "goal_col"):
            if getattr(self, name) is None:
                object.__setattr__(self, name, round(2 * self.size / 3))
        check(self)
        if not (0 < self._goal < self.size**2 and max(self._place) < self.size):
            raise ValueError(
                f"the goal {self._place} must be on the {self.size} x {self.size} grid, and not the start (0, 0)"
            )

    @property
    def label(self) -> str:
        """What tells this distribution from its neighbours, for names of artefacts."""
        usual = WindyGridworld(size=self.size)
        size = "" if self.size == 30 else f"-{self.size}"
        goal = "" if self._place == usual._place else "-goal-{}-{}".format(*self._place)
        p = "" if self.p == usual.p else f"-p-{self.p:g}"
        shape = "" if self.wind_shape == usual.wind_shape else f"-shape-{self.wind_shape:g}"
        return (
            f"{self.name}{size}-{self.wind}{shape}-scale-{self.wind_scale:g}{goal}{p}{in_label(self.reward)}"
        )

    def axes(self) -> tuple[Axis, ...]:
        """The state axes: row and column."""
        import numpy as np

        from qinit_store.schema import Axis

        cells = np.arange(self.size, dtype=np.int32)
        return (Axis("row", cells, "1", "grid row"), Axis("col", cells, "1", "grid column"))

    def parameters(self) -> tuple[Column, ...]:
        """What a task is made of: the strength of its wind, and where it blows to."""
        from qinit_store.schema import Column

        return (
            Column(
                "wind",
                ("task",),
                "<f8",
                "1",
                "cells that the wind drifts the agent after each move",
                low=0,
                high=self.wind_scale * FARTHEST ** (1 / self.wind_shape),
            ),
            Column(
                "direction",
                ("task",),
                "<i4",
                "1",
                "where it blows to: 0 up, 1 down, 2 left, 3 right",
                low=0 if self.wind == "any" else DIRECTIONS.index(self.wind),
                high=3 if self.wind == "any" else DIRECTIONS.index(self.wind),
            ),
        )

    @property
    def warning(self) -> str:
        """What whoever uses this distribution should know; empty if nothing."""
        if self.wind_scale == 0:
            return "with --wind-scale 0 all tasks are the same: there is no distribution to transfer from"
        return ""

    def draw(self, rng: np.random.Generator) -> tuple[float, int]:
        """One task: its wind, scale times a standard Weibull, and where that blows to."""
        wind = self.wind_scale * float(rng.weibull(self.wind_shape))
        return wind, int(rng.integers(4)) if self.wind == "any" else DIRECTIONS.index(self.wind)

    def shifted(self, changes: dict[str, Any]) -> Self:
        """The family with some fields changed; ValueError for another size, which these tables would not fit."""
        if changes.get("size", self.size) != self.size:
            raise ValueError(f"the tables are of a {self.size} x {self.size} grid: size cannot be shifted")
        return dataclasses.replace(self, **changes)

    def tables(self, tasks: Tasks) -> Tables:
        """Where steps lead: eight outcomes, each way of moving with the wind's lesser and greater drift.

        Cells are entered one by one, the move first: whoever comes to the goal on the way is there.
        """
        import numpy as np

        from qinit_cli.kernels.tables import Tables
        from qinit_cli.kernels.worlds import GOAL

        moves = self._moves()
        drift = np.minimum(np.floor(tasks["wind"]), self.size).astype(np.int64)
        drifted = self._drifted(moves, int(drift.max(initial=0)) + 1)
        after = np.stack(
            [drifted[tasks["direction"], drift + more][:, moves] for more in (0, 1)], axis=-1
        )  # (B, S, 4, 2)
        greater = tasks["wind"] - np.floor(tasks["wind"])
        ways = np.where(np.eye(4, dtype=bool), self.p, (1 - self.p) / 3)
        probability = (
            ways[..., None] * np.stack([1 - greater, greater], axis=-1)[:, None, None, :]
        )  # (B, 4, 4, 2)
        shape = len(tasks), self.size**2, 4, 8
        after = np.where(after == self._goal, GOAL, after).astype(np.int32).reshape(*shape[:2], 1, 8)
        open = np.broadcast_to(np.arange(shape[1]) != self._goal, shape[:2])
        return Tables(
            np.ascontiguousarray(np.broadcast_to(after, shape)),
            np.ascontiguousarray(np.broadcast_to(probability.reshape(-1, 1, 4, 8), shape)),
            np.tile(self.starts(), (len(tasks), 1)),
            open.copy(),
        )

    def path_lengths(self, tasks: Tasks, q: Floats, horizon: int) -> NDArray[np.int32]:
        """Expected optimal path lengths, (B, S, A); definition 1 of the paper: 0 at the goal, -1 where a path never arrives.

        The likeliest step hardly feels a wind below half a cell; against one beyond it no path advances.
        """
        lengths = super().path_lengths(tasks, q, horizon)
        lengths[:, self._goal] = 0
        return lengths

    def nearness(self, tasks: Tasks, gamma: float, *, linear: bool) -> Floats:
        """How near each cell is to the goal, 0 to 1, (S,): gamma^d, or 1 - d/d_max, d the Manhattan distance."""
        import numpy as np

        from qinit_cli.elementary import power

        row, column = np.divmod(np.arange(self.size**2), self.size)
        distance = np.abs(row - self._place[0]) + np.abs(column - self._place[1])
        near: Floats = 1 - distance / (2 * (self.size - 1)) if linear else power(gamma, distance)
        return near

    @property
    def _place(self) -> tuple[int, int]:
        return self.goal_row or 0, self.goal_col or 0

    @property
    def _goal(self) -> int:
        row, column = self._place
        return row * self.size + column

    def _moves(self) -> Integers:
        """The cell that each move leads to, (S, 4); from the goal none leads away."""

        import numpy as np

        moves = open_map(self.size).moves.astype(np.int64)
        moves[self._goal] = self._goal
        return moves

    def _drifted(self, moves: Integers, most: int) -> Integers:
        """Where 0 to `most` cells of drift lead from each cell, (4, most + 1, S)."""
        import numpy as np

        there = [np.tile(np.arange(len(moves)), (4, 1))]
        for _ in range(most):
            there.append(np.take_along_axis(moves.T, there[-1], axis=1))
        return np.stack(there, axis=1)
