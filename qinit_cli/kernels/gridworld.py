# mypy: allow-untyped-defs, allow-untyped-calls
"""The gridworld as the compiled loop steps through it.

Cells are numbered row * columns + column, actions up, down, left, right. A move goes where it was meant to with
probability p, each other way with (1 - p)/3; a wall keeps the agent in place.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar, NamedTuple

import numpy as np
from numpy.typing import NDArray

from qinit_cli.arrays import Floats, Integers
from qinit_cli.kernels.choices import ACTIONS, WAYS, decide
from qinit_cli.kernels.compiled import inlined
from qinit_cli.kernels.loop import compiled_loop
from qinit_cli.kernels.parts import Function, body
from qinit_cli.kernels.random_streams import THIRTY_TWO, Words, below, slip_limit
from qinit_cli.kernels.worlds import GOAL, LOST, place_of, prepare, starts, steps
from qinit_cli.learning import Learning

RECORD, MOVES = 8, 4  # numbers of a cell in a PatchyWorld, and where the places among them begin


class CellWorld(NamedTuple):
    """The gridworlds of a batch as the loop reads them."""

    neighbours: Any  # u4 (S * 4,) the place that each move leads to, see worlds.place_of
    goal: Any  # u4 (B,)
    slips: Any  # u8 (B, 3) limits of the upper half of a draw
    starts: Any  # u4 (W,) the target's, those drawn oftener as often
    free: Any  # u4 (F,) the cells where episodes go on, the goal among them
    rank: Any  # i8 (B,) of the goal in `free`
    lane_goal: Any  # u4 (L,) of the lane's task


class PatchyWorld(NamedTuple):
    """As CellWorld, for tasks with several goals or with slips that differ from cell to cell."""

    # u4 (B, S * RECORD), of each cell one after another: what a draw's upper half must exceed to slip once, twice and three
    # times, nothing, and the four places that moves lead to; half a cache line, as a step reads them all
    records: Any
    starts: Any  # u4 (W,)
    open: Any  # u4 (B, F - K) the cells where episodes go on
    lane_task: Any  # i8 (L,) whose records a lane holds, -1: none
    lane_records: Any  # u4 (L, S * RECORD): at an address that a step need not look up


@dataclass(frozen=True)
class Gridworlds:
    """Gridworld tasks to learn, B of them: through walls no move leads, and a hole ends the episode."""

    moves: NDArray[
        np.int32
    ]  # (S, 4) the cell that each action leads to, itself at a wall, S + 1 into a hole; of walls themselves
    goal: Integers  # (B,) cells, or (B, K)
    p: Floats  # (B,) probability of the intended move, or (B, S) in each cell
    starts: tuple[int, ...] = (
        0,
    )  # the target's: of evaluation, and of episodes if learning.start is "fixed"

    actions: ClassVar[int] = 4
    lanes: ClassVar[int] = 4
    alone: ClassVar[int] = 3
    rng: ClassVar[Words | None] = None  # all that is random is in the steps' draws

    def __post_init__(self) -> None:
        if not np.isin(self.goal, self._free).all() or not np.isin(self.starts, self._free).all():
            raise ValueError("goals and starts must be free cells of the grid")
        if both := set(self.starts) & set(self.goal.ravel().tolist()):
            raise ValueError(
                f"cell {min(both)} is a start and a goal: the episode would be over before its first step"
            )

    @property
    def states(self) -> int:
        """Number of cells."""
        return len(self.moves)

    def __len__(self) -> int:
        return len(self.goal)

    def queue(self) -> Integers:
        """As they are: no goal makes episodes much longer than another."""
        return np.arange(len(self))

    def loop(self, learning: Learning, lanes: int) -> tuple[Function, CellWorld | PatchyWorld]:
        """The compiled loop and the world it takes."""
        slip = (1.0 - self.p) / 3
        slips = slip_limit(np.stack([self.p, self.p + slip, self.p + 2 * slip], axis=-1))
        starts = np.array(self.starts, np.uint32)
        if self.goal.ndim > 1 or self.p.ndim > 1:
            return compiled_loop(learning, PatchyWorld), self._patchy(slips, starts, lanes)
        world = CellWorld(
            neighbours=self.moves.astype(np.uint32).ravel(),
            goal=self.goal.astype(np.uint32),
            slips=slips,
            starts=starts,
            free=self._free.astype(np.uint32),
            rank=np.searchsorted(self._free, self.goal),
            lane_goal=np.zeros(lanes, np.uint32),
        )
        return compiled_loop(learning, CellWorld), world

    @property
    def _free(self) -> Integers:
        """The cells that some move leaves, (F,), ascending."""
        return np.flatnonzero((self.moves != np.arange(self.states)[:, None]).any(axis=1))

    def _patchy(self, slips: Words, starts: NDArray[np.uint32], lanes: int) -> PatchyWorld:
        goals = self.goal.reshape(len(self), -1)
        places = np.tile(np.arange(self.states + 2), (len(self), 1))
        np.put_along_axis(places, goals, self.states, axis=1)
        records = np.zeros((len(self), self.states, RECORD), np.uint32)
        records[..., :3] = slips.reshape(len(self), -1, 3) - np.uint64(1)
        records[..., MOVES:] = places[:, self.moves]
        return PatchyWorld(
            records=records.reshape(len(self), -1),
            starts=starts,
            open=np.array([np.setdiff1d(self._free, own) for own in goals], np.uint32),
            lane_task=np.full(lanes, -1),
            lane_records=np.zeros((lanes, self.states * RECORD), np.uint32),
        )


@starts(CellWorld)
def start(world, task, lane, rng, anywhere):
    """One of the target's starts; anywhere: uniform over the free cells but the goal, without rejection."""
    world.lane_goal[lane] = world.goal[task]
    if not anywhere:
        return _target_start(world.starts, rng)
    drawn = below(rng, len(world.free) - 1)
    return np.int64(world.free[drawn + (drawn >= world.rank[task])])


@starts(PatchyWorld)
def patchy_start(world, task, lane, rng, anywhere):
    """As `start`."""
    if world.lane_task[lane] != task:
        world.lane_task[lane] = task
        for place in range(world.records.shape[1]):
            world.lane_records[lane, place] = world.records[task, place]
    if not anywhere:
        return _target_start(world.starts, rng)
    return np.int64(world.open[task, below(rng, world.open.shape[1])])


@inlined
def _target_start(starts, rng):
    return np.int64(starts[below(rng, len(starts)) if len(starts) > 1 else 0])


@steps(CellWorld)
def step(world, task, lane, state, action, uniform, rng):
    """The cell that the action leads to, or one of the other three ways."""
    upper, slips = np.uint64(uniform * 2.0**32), world.slips[task]
    slip = np.int64(upper >= slips[0]) + np.int64(upper >= slips[1]) + np.int64(upper >= slips[2])
    after = np.int64(world.neighbours[4 * state + (action + slip) % 4])
    if after == world.goal[task]:
        return GOAL
    return after if after < len(world.neighbours) // 4 else LOST


@steps(PatchyWorld)
def patchy_step(world, task, lane, state, action, uniform, rng):
    """As `step`."""
    after = np.int64(_patchy_after(world.lane_records, lane, state, action, np.uint32(uniform * 2.0**32)))
    states = world.records.shape[1] // RECORD
    return after if after < states else states - 1 - after


@inlined
def _patchy_after(records, lane, state, action, upper):
    """The place that a step leads to, given the upper half of its draw."""
    cell = RECORD * np.int64(state)
    slip = np.int64(upper > records[lane, cell]) + np.int64(upper > records[lane, cell + 1])
    slip += np.int64(upper > records[lane, cell + 2])
    return records[lane, cell + MOVES + ((np.int64(action) + slip) & 3)]


@body(prepare, CellWorld)
def _prepare(world, lane, task, rng, exploration, all_actions, draws, choices):
    decide(draws, exploration, all_actions, world.slips[task], choices)


@body(place_of, CellWorld)
def _place_of(world, task, lane, step, state, choice, action, drawn, rng, states):
    after = world.neighbours[4 * state + ACTIONS[choice + WAYS]]
    return np.uint32(states) if after == world.lane_goal[lane] else after


@body(place_of, PatchyWorld)
def _patchy_place_of(world, task, lane, step, state, choice, action, drawn, rng, states):
    return _patchy_after(world.lane_records, lane, state, action, np.uint32(drawn >> THIRTY_TWO))
