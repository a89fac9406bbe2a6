# mypy: allow-untyped-defs
"""Q-learning in the gridworld, compiled: many tasks a call, four side by side.

Cells are numbered row * size + column, actions up, down, left, right. A move goes where it was meant to with
probability p, each other way with (1 - p)/3; a wall keeps the agent in place. What a task learns depends on
its own streams alone, not on its batch.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar, NamedTuple

import numpy as np
from numpy.typing import NDArray

from qinit_cli.kernels.choices import ACTIONS, DIRECTIONS, decide
from qinit_cli.kernels.compiled import compiled, inlined
from qinit_cli.kernels.dice import below, draw_block, slip_limit
from qinit_cli.kernels.lane import (
    BLOCK,
    POTENTIAL,
    ROW,
    TD_VAR,
    TD_VAR_RATE,
    WORTH,
    WORTH_OF_POTENTIAL,
    lanes_in_use,
    leave,
    make_terminal,
    record_episode,
    take,
)
from qinit_cli.kernels.vectors import add_to_entry
from qinit_cli.learning import Learning

ALL_ACTIONS = np.uint64(0b1111)
ANYWHERE = -1


class World(NamedTuple):
    """The gridworlds of a batch as the loop reads them."""

    neighbours: Any  # u4 (S * 4,)
    goal: Any  # i8 (B,)
    slips: Any  # u8 (B, 3) limits of the upper half of a draw
    start: int  # where episodes start; ANYWHERE: uniformly over the cells but the goal
    state: Any  # i8 (L,) where the task of a lane is


@dataclass(frozen=True)
class Gridworlds:
    """Gridworld tasks to learn, B of them."""

    size: int
    goal: NDArray[np.int64]  # (B,) cells
    p: NDArray[np.float64]  # (B,) probability of the intended move
    start: int = 0  # where episodes start if learning.start is "fixed"

    actions: ClassVar[int] = 4

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

    def loop(self, learning: Learning, lanes: int) -> tuple[Any, World]:
        """The compiled loop and the world it takes."""
        slip = (1.0 - self.p) / 3
        world = World(
            neighbours=neighbours(self.size),
            goal=np.ascontiguousarray(self.goal, np.int64),
            slips=slip_limit(np.stack([self.p, self.p + slip, self.p + 2 * slip], axis=1)),
            start=ANYWHERE if learning.start == "anywhere" else self.start,
            state=np.zeros(lanes, np.int64),
        )
        return advance, world


def neighbours(size: int) -> NDArray[np.uint32]:
    """The cell that each move leads to from each cell, itself at a wall; flat, (S * 4,)."""
    row, column = np.divmod(np.arange(size * size), size)
    last = size - 1
    up, down = np.maximum(row - 1, 0) * size + column, np.minimum(row + 1, last) * size + column
    left, right = row * size + np.maximum(column - 1, 0), row * size + np.minimum(column + 1, last)
    return np.stack([up, down, left, right], axis=1).astype(np.uint32).ravel()


@compiled
def advance(blocks, world, setting, tasks, lanes, potential, visits, td_var):
    """Learns for that many blocks of steps in every lane, or until the batch is done; writes into `tasks` and
    the records.

    potential f8 (B or 1, S), visits i8 (B, S, 4), td_var f8 (B, S, 4): each may be None, and then costs
    nothing. Lanes whose task is done take the next one of the batch. Called again it goes on where it
    stopped.
    """
    for _ in range(blocks):
        for lane in range(len(lanes.task)):
            task = lanes.following[0]
            if task < len(tasks.q) and (lanes.task[lane] < 0 or tasks.finished[lanes.task[lane]]):
                lanes.following[0] += 1
                take(tasks, lanes, lane, task, setting.gamma, potential, visits, td_var)
                make_terminal(lanes.rows[lane], world.goal[task])
                world.state[lane] = _start(world, tasks, task)
        count = lanes_in_use(tasks, lanes)
        if count == 0:
            return
        for place in range(count):
            lane = lanes.order[place]
            task = lanes.task[lane]
            draw_block(tasks.dice[task], lanes.draws[lane])
            decide(
                lanes.draws[lane], setting.exploration, ALL_ACTIONS, world.slips[task], lanes.choices[lane]
            )
        place = 0
        while count - place >= 4:
            _four_lanes(place, world, setting, tasks, lanes, potential, visits, td_var)
            place += 4
        while place < count:
            _one_lane(place, world, setting, tasks, lanes, potential, visits, td_var)
            place += 1


@compiled
def _four_lanes(place, world, setting, tasks, lanes, potential, visits, td_var):
    """A block of steps in four lanes, `place` and the three after it in `lanes.order`, in turn: while one
    waits another goes on."""
    neighbours, alpha, gamma, horizon = world.neighbours, setting.alpha, setting.gamma, setting.horizon
    a, b, c, d = lanes.order[place], lanes.order[place + 1], lanes.order[place + 2], lanes.order[place + 3]
    rows_a, ties_a, counts_a, spreads_a = lanes.rows[a], lanes.ties[a], lanes.visits[a], lanes.td_var[a]
    rows_b, ties_b, counts_b, spreads_b = lanes.rows[b], lanes.ties[b], lanes.visits[b], lanes.td_var[b]
    rows_c, ties_c, counts_c, spreads_c = lanes.rows[c], lanes.ties[c], lanes.visits[c], lanes.td_var[c]
    rows_d, ties_d, counts_d, spreads_d = lanes.rows[d], lanes.ties[d], lanes.visits[d], lanes.td_var[d]
    choices_a, choices_b, choices_c, choices_d = (
        lanes.choices[a],
        lanes.choices[b],
        lanes.choices[c],
        lanes.choices[d],
    )
    goal_a, goal_b = np.uint32(world.goal[lanes.task[a]]), np.uint32(world.goal[lanes.task[b]])
    goal_c, goal_d = np.uint32(world.goal[lanes.task[c]]), np.uint32(world.goal[lanes.task[d]])
    state_a, state_b = np.uint32(world.state[a]), np.uint32(world.state[b])
    state_c, state_d = np.uint32(world.state[c]), np.uint32(world.state[d])
    time_a, time_b, time_c, time_d = lanes.time[a], lanes.time[b], lanes.time[c], lanes.time[d]
    for step in range(BLOCK):
        state_a = _step(
            choices_a[step],
            state_a,
            rows_a,
            ties_a,
            counts_a,
            spreads_a,
            neighbours,
            alpha,
            gamma,
            potential,
            visits,
            td_var,
        )
        state_b = _step(
            choices_b[step],
            state_b,
            rows_b,
            ties_b,
            counts_b,
            spreads_b,
            neighbours,
            alpha,
            gamma,
            potential,
            visits,
            td_var,
        )
        state_c = _step(
            choices_c[step],
            state_c,
            rows_c,
            ties_c,
            counts_c,
            spreads_c,
            neighbours,
            alpha,
            gamma,
            potential,
            visits,
            td_var,
        )
        state_d = _step(
            choices_d[step],
            state_d,
            rows_d,
            ties_d,
            counts_d,
            spreads_d,
            neighbours,
            alpha,
            gamma,
            potential,
            visits,
            td_var,
        )
        time_a += 1
        time_b += 1
        time_c += 1
        time_d += 1
        if state_a == goal_a or time_a == horizon:
            state_a = _next_episode(
                a, time_a, state_a == goal_a, world, setting, tasks, lanes, visits, td_var
            )
            time_a = 0
        if state_b == goal_b or time_b == horizon:
            state_b = _next_episode(
                b, time_b, state_b == goal_b, world, setting, tasks, lanes, visits, td_var
            )
            time_b = 0
        if state_c == goal_c or time_c == horizon:
            state_c = _next_episode(
                c, time_c, state_c == goal_c, world, setting, tasks, lanes, visits, td_var
            )
            time_c = 0
        if state_d == goal_d or time_d == horizon:
            state_d = _next_episode(
                d, time_d, state_d == goal_d, world, setting, tasks, lanes, visits, td_var
            )
            time_d = 0
    world.state[a], world.state[b], world.state[c], world.state[d] = state_a, state_b, state_c, state_d
    lanes.time[a], lanes.time[b], lanes.time[c], lanes.time[d] = time_a, time_b, time_c, time_d


@compiled
def _one_lane(place, world, setting, tasks, lanes, potential, visits, td_var):
    """A block of steps in one lane, `place` in `lanes.order`."""
    neighbours, alpha, gamma, horizon = world.neighbours, setting.alpha, setting.gamma, setting.horizon
    lane = lanes.order[place]
    rows, ties, counts, spreads = lanes.rows[lane], lanes.ties[lane], lanes.visits[lane], lanes.td_var[lane]
    choices, goal = lanes.choices[lane], np.uint32(world.goal[lanes.task[lane]])
    state, time = np.uint32(world.state[lane]), lanes.time[lane]
    for step in range(BLOCK):
        state = _step(
            choices[step],
            state,
            rows,
            ties,
            counts,
            spreads,
            neighbours,
            alpha,
            gamma,
            potential,
            visits,
            td_var,
        )
        time += 1
        if state == goal or time == horizon:
            state = _next_episode(lane, time, state == goal, world, setting, tasks, lanes, visits, td_var)
            time = 0
    world.state[lane], lanes.time[lane] = state, time


@inlined
def _step(choice, state, rows, ties, counts, spreads, neighbours, alpha, gamma, potential, visits, td_var):
    """One step of Q-learning: the cell it leads to. The row, ties and tallies are brought up to date."""
    choice = choice | ties[state]
    action = ACTIONS[choice]
    after = neighbours[4 * state + DIRECTIONS[choice]]
    row = ROW * state
    target = rows[ROW * after + WORTH]
    if potential is not None:
        target = target + rows[ROW * after + WORTH_OF_POTENTIAL] - rows[row + POTENTIAL]
    error = target - rows[row + action]
    best, tied = add_to_entry(rows, row, action, alpha * error)
    rows[row + WORTH] = gamma * best
    ties[state] = tied
    if visits is not None:
        counts[row + action] += 1
    if td_var is not None:
        spread = spreads[row + TD_VAR + action]
        spreads[row + TD_VAR + action] = spread + TD_VAR_RATE * (error * error - spread)
    return after


@compiled
def _next_episode(lane, length, reached, world, setting, tasks, lanes, visits, td_var):
    """Where the lane's next episode starts; the one that ended is recorded, and a task that is done leaves
    its results."""
    task = lanes.task[lane]
    if not tasks.finished[task]:
        record_episode(tasks, task, length, reached, setting.episodes)
        if tasks.episode[task] == setting.episodes:
            leave(tasks, lanes, lane, visits, td_var)
            tasks.finished[task] = True
    return _start(world, tasks, task)


@compiled
def _start(world, tasks, task):
    """The cell where an episode starts; anywhere: uniform over the cells but the goal, without rejection."""
    if world.start != ANYWHERE:
        return np.uint32(world.start)
    cell = below(tasks.start_dice[task], tasks.q.shape[1] - 1)
    return np.uint32(cell + (cell >= world.goal[task]))
