# mypy: allow-untyped-defs, allow-untyped-calls
"""The gridworld as the compiled loop steps through it.

Cells are numbered row * size + column, actions up, down, left, right. A move goes where it was meant to with
probability p, each other way with (1 - p)/3; a wall keeps the agent in place.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar, NamedTuple

import numpy as np
from numpy.typing import NDArray

from qinit_cli.arrays import Integers
from qinit_cli.kernels.choices import ACTIONS, WAYS, decide
from qinit_cli.kernels.loop import compiled_loop
from qinit_cli.kernels.parts import Function, body
from qinit_cli.kernels.random_streams import Words, below, slip_limit
from qinit_cli.kernels.worlds import GOAL, place_of, prepare, starts, steps
from qinit_cli.learning import Learning


class CellWorld(NamedTuple):
    """The gridworlds of a batch as the loop reads them."""

    neighbours: Any  # u4 (S * 4,)
    goal: Any  # u4 (B,)
    slips: Any  # u8 (B, 3) limits of the upper half of a draw
    start: int  # the target start
    lane_goal: Any  # u4 (L,) of the lane's task


@dataclass(frozen=True)
class Gridworlds:
    """Gridworld tasks to learn, B of them."""

    size: int
    goal: NDArray[np.int64]  # (B,) cells
    p: NDArray[np.float64]  # (B,) probability of the intended move
    start: int = 0  # the target start: of evaluation, and of episodes if learning.start is "fixed"

    actions: ClassVar[int] = 4
    lanes: ClassVar[int] = 4
    alone: ClassVar[int] = 3
    rng: ClassVar[Words | None] = None  # all that is random is in the steps' draws

    def __post_init__(self) -> None:
        if not (
            self.size >= 2
            and np.all((self.goal >= 0) & (self.goal < self.states))
            and 0 <= self.start < self.states
        ):
            raise ValueError(f"goals and start must be cells of the {self.size} x {self.size} grid")
        if np.any(self.goal == self.start):
            raise ValueError(
                f"cell {self.start} is the start and a goal: the episode would be over before its first step"
            )

    @property
    def states(self) -> int:
        """Number of cells."""
        return self.size**2

    def __len__(self) -> int:
        return len(self.goal)

    def queue(self) -> Integers:
        """As they are: no goal makes episodes much longer than another."""
        return np.arange(len(self))

    def loop(self, learning: Learning, lanes: int) -> tuple[Function, CellWorld]:
        """The compiled loop and the world it takes."""
        slip = (1.0 - self.p) / 3
        world = CellWorld(
            neighbours=neighbours(self.size),
            goal=self.goal.astype(np.uint32),
            slips=slip_limit(np.stack([self.p, self.p + slip, self.p + 2 * slip], axis=1)),
            start=self.start,
            lane_goal=np.zeros(lanes, np.uint32),
        )
        return compiled_loop(CellWorld, learning), world


def neighbours(size: int) -> NDArray[np.uint32]:
    """The cell that each move leads to from each cell, itself at a wall; flat, (S * 4,)."""
    row, column = np.divmod(np.arange(size * size), size)
    last = size - 1
    up, down = np.maximum(row - 1, 0) * size + column, np.minimum(row + 1, last) * size + column
    left, right = row * size + np.maximum(column - 1, 0), row * size + np.minimum(column + 1, last)
    return np.stack([up, down, left, right], axis=1).astype(np.uint32).ravel()


@starts(CellWorld)
def start(world, task, lane, rng, anywhere):
    """The target start; anywhere: uniform over the cells but the goal, without rejection."""
    world.lane_goal[lane] = world.goal[task]
    if not anywhere:
        return np.int64(world.start)
    cell = below(rng, len(world.neighbours) // 4 - 1)
    return cell + (cell >= world.goal[task])


@steps(CellWorld)
def step(world, task, lane, state, action, uniform, rng):
    """The cell that the action leads to, or one of the other three ways."""
    upper, slips = np.uint64(uniform * 2.0**32), world.slips[task]
    slip = np.int64(upper >= slips[0]) + np.int64(upper >= slips[1]) + np.int64(upper >= slips[2])
    after = np.int64(world.neighbours[4 * state + (action + slip) % 4])
    return GOAL if after == world.goal[task] else after


@body(prepare, CellWorld)
def _prepare(world, lane, task, rng, exploration, all_actions, draws, choices):
    decide(draws, exploration, all_actions, world.slips[task], choices)


@body(place_of, CellWorld)
def _place_of(world, task, lane, step, state, choice, action, drawn, rng, states):
    after = world.neighbours[4 * state + ACTIONS[choice + WAYS]]
    return np.uint32(states) if after == world.lane_goal[lane] else after
