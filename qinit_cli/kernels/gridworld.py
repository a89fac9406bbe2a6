# mypy: allow-untyped-defs, allow-untyped-calls
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

from qinit_cli.arrays import Integers
from qinit_cli.kernels.choices import ACTIONS, DIRECTIONS, decide, greedy_choice
from qinit_cli.kernels.compiled import inlined, inner, lean
from qinit_cli.kernels.lane import (
    BLOCK,
    end_block,
    evaluation_due,
    is_idle,
    lanes_in_use,
    make_terminal,
    memory,
    record_end,
    take,
    update,
)
from qinit_cli.kernels.policies import begin, followed, learn_of_episode
from qinit_cli.kernels.posterior import begin as begin_weighing
from qinit_cli.kernels.posterior import end_episode, frozen_first, refresh, weigh
from qinit_cli.kernels.random_streams import below, draw, draw_block, slip_limit
from qinit_cli.learning import QLearning

ALL_ACTIONS = np.uint64(0b1111)
ANYWHERE = -1


class CellWorld(NamedTuple):
    """The gridworlds of a batch as the loop reads them."""

    neighbours: Any  # u4 (S * 4,)
    goal: Any  # i8 (B,)
    slips: Any  # u8 (B, 3) limits of the upper half of a draw
    start: int  # where episodes start; ANYWHERE: uniformly over the cells but the goal
    target_start: int  # where evaluation starts
    cell: Any  # u4 (L,) where the task of a lane is
    goals: Any  # u4 (L,) where it goes
    starts: Any  # u4 (L, BLOCK) where its next episodes start, e % BLOCK for where the e-th leads


@dataclass(frozen=True)
class Gridworlds:
    """Gridworld tasks to learn, B of them."""

    size: int
    goal: NDArray[np.int64]  # (B,) cells
    p: NDArray[np.float64]  # (B,) probability of the intended move
    start: int = 0  # the target start: of evaluation, and of episodes if learning.start is "fixed"

    actions: ClassVar[int] = 4
    lanes: ClassVar[int] = 4

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

    def loop(self, learning: QLearning, lanes: int) -> tuple[Any, CellWorld]:
        """The compiled loop and the world it takes."""
        slip = (1.0 - self.p) / 3
        world = CellWorld(
            neighbours=neighbours(self.size),
            goal=np.ascontiguousarray(self.goal, np.int64),
            slips=slip_limit(np.stack([self.p, self.p + slip, self.p + 2 * slip], axis=1)),
            start=ANYWHERE if learning.start == "anywhere" else self.start,
            target_start=self.start,
            cell=np.zeros(lanes, np.uint32),
            goals=np.zeros(lanes, np.uint32),
            starts=np.zeros((lanes, BLOCK), np.uint32),
        )
        return advance, world


def neighbours(size: int) -> NDArray[np.uint32]:
    """The cell that each move leads to from each cell, itself at a wall; flat, (S * 4,)."""
    row, column = np.divmod(np.arange(size * size), size)
    last = size - 1
    up, down = np.maximum(row - 1, 0) * size + column, np.minimum(row + 1, last) * size + column
    left, right = row * size + np.maximum(column - 1, 0), row * size + np.minimum(column + 1, last)
    return np.stack([up, down, left, right], axis=1).astype(np.uint32).ravel()


@lean
def advance(blocks, world, setting, tasks, lanes, potential, visits, td_var, evaluation, choosing, posterior):
    """Learns for that many blocks of steps in every lane, or until the batch is done.

    Writes into `tasks` and the records. potential f8 (B or 1, S), visits i8 (B, S, 4), td_var f8 (B, S, 4), an Evaluation, a
    Choosing, a Posterior: each may be None, and then costs nothing. Lanes whose task is done take the next one of the batch.
    Called again it goes on where it stopped.
    """
    for _ in range(blocks):
        for lane in range(len(lanes.task)):
            if is_idle(tasks, lanes, lane):
                take(tasks, lanes, lane, setting.gamma, potential, visits, td_var)
                _place(world, setting, tasks, lanes, lane, evaluation, choosing, posterior)
        count = lanes_in_use(tasks, lanes)
        for place in range(count):
            lane = lanes.order[place]
            task = lanes.task[lane]
            draw_block(tasks.rng[task], lanes.draws)
            decide(lanes.draws, setting.exploration, ALL_ACTIONS, world.slips[task], lanes.choices[lane])
        alike = count if posterior is None else frozen_first(posterior, lanes, count)
        fours = alike // 4 * 4 if choosing is None else 0
        for place in range(0, fours, 4):
            four = lanes.order[place : place + 4]
            _learn_in_four(four, world, setting, tasks, lanes, potential, visits, td_var, evaluation)
        for place in range(fours, count):
            lane = lanes.order[place]
            _learn_in_one(
                lane, world, setting, tasks, lanes, potential, visits, td_var, evaluation, choosing, posterior
            )
        for place in range(count):
            lane = lanes.order[place]
            first = tasks.episode[lanes.task[lane]]
            end_block(tasks, lanes, lane, setting.episodes)
            _draw_starts(world, tasks, lanes, lane, first, lanes.ended[lane])
        if count == 0:
            return


@inner
def _learn_in_four(four, world, setting, tasks, lanes, potential, visits, td_var, evaluation):
    """A block of steps in four lanes: while one waits for its last step, the others go on."""
    moves, horizon = world.neighbours, setting.horizon
    a, b, c, d = four[0], four[1], four[2], four[3]
    own_a, own_b, own_c, own_d = memory(lanes, a), memory(lanes, b), memory(lanes, c), memory(lanes, d)
    goal_a, goal_b, goal_c, goal_d = world.goals[a], world.goals[b], world.goals[c], world.goals[d]
    cell_a, cell_b, cell_c, cell_d = world.cell[a], world.cell[b], world.cell[c], world.cell[d]
    time_a, time_b, time_c, time_d = lanes.time[a], lanes.time[b], lanes.time[c], lanes.time[d]
    for step in range(BLOCK):
        cell_a = _step(a, step, cell_a, own_a, moves, setting, potential, visits, td_var, None)
        cell_b = _step(b, step, cell_b, own_b, moves, setting, potential, visits, td_var, None)
        cell_c = _step(c, step, cell_c, own_c, moves, setting, potential, visits, td_var, None)
        cell_d = _step(d, step, cell_d, own_d, moves, setting, potential, visits, td_var, None)
        time_a += 1
        time_b += 1
        time_c += 1
        time_d += 1
        if cell_a == goal_a or time_a == horizon:
            cell_a = _end(
                a, time_a, cell_a, world, setting, tasks, lanes, visits, td_var, evaluation, None, None
            )
            time_a = 0
        if cell_b == goal_b or time_b == horizon:
            cell_b = _end(
                b, time_b, cell_b, world, setting, tasks, lanes, visits, td_var, evaluation, None, None
            )
            time_b = 0
        if cell_c == goal_c or time_c == horizon:
            cell_c = _end(
                c, time_c, cell_c, world, setting, tasks, lanes, visits, td_var, evaluation, None, None
            )
            time_c = 0
        if cell_d == goal_d or time_d == horizon:
            cell_d = _end(
                d, time_d, cell_d, world, setting, tasks, lanes, visits, td_var, evaluation, None, None
            )
            time_d = 0
    world.cell[a], world.cell[b], world.cell[c], world.cell[d] = cell_a, cell_b, cell_c, cell_d
    lanes.time[a], lanes.time[b], lanes.time[c], lanes.time[d] = time_a, time_b, time_c, time_d


@inner
def _learn_in_one(
    lane, world, setting, tasks, lanes, potential, visits, td_var, evaluation, choosing, posterior
):
    """A block of steps in one lane."""
    own, moves, goal = memory(lanes, lane), world.neighbours, world.goals[lane]
    cell, time = world.cell[lane], lanes.time[lane]
    for step in range(BLOCK):
        if posterior is not None and posterior.live[lane]:
            task = lanes.task[lane]
            cell = _weighing_step(
                lane, step, cell, own, moves, goal, setting, potential, visits, td_var, task, posterior
            )
        else:
            cell = _step(lane, step, cell, own, moves, setting, potential, visits, td_var, choosing)
        time += 1
        if cell == goal or time == setting.horizon:
            cell = _end(
                lane,
                time,
                cell,
                world,
                setting,
                tasks,
                lanes,
                visits,
                td_var,
                evaluation,
                choosing,
                posterior,
            )
            time = 0
    world.cell[lane], lanes.time[lane] = cell, time


@inlined
def _step(lane, step, cell, own, moves, setting, potential, visits, td_var, choosing):
    """One step of Q-learning: the cell it leads to."""
    if choosing is None:
        choice = own.choices[step] | own.ties[cell]
    else:
        choice = followed(choosing, lane, own.choices[step], own.ties[cell], cell)
    action = ACTIONS[choice]
    after = moves[4 * cell + DIRECTIONS[choice]]
    update(own, cell, action, after, setting.alpha, setting.gamma, potential, visits, td_var)
    return after


@inlined
def _weighing_step(lane, step, cell, own, moves, goal, setting, potential, visits, td_var, task, posterior):
    """As `_step`, between rows that are up to date with the weights, which then learn of it."""
    refresh(posterior, lane, own, cell, setting.gamma)
    choice = own.choices[step] | own.ties[cell]
    action = ACTIONS[choice]
    after = moves[4 * cell + DIRECTIONS[choice]]
    if after != goal:
        refresh(posterior, lane, own, after, setting.gamma)
    update(own, cell, action, after, setting.alpha, setting.gamma, potential, visits, td_var)
    state = np.int64(after)
    weigh(posterior, lane, task, cell, action, posterior.current.shape[1] if after == goal else state)
    return after


@inlined
def _end(lane, length, cell, world, setting, tasks, lanes, visits, td_var, evaluation, choosing, posterior):
    """Notes an episode's end, with all that hangs on it; the cell where the next one starts."""
    reached = cell == world.goals[lane]
    if posterior is not None and posterior.live[lane]:
        evaluated = False
        if evaluation is not None:
            evaluated = evaluation_due(evaluation, lanes.ended[lane] + 1, setting.episodes)
        own, goal = memory(lanes, lane), np.int64(world.goals[lane])
        end_episode(posterior, lanes, own, lane, reached, goal, setting, evaluated)
    episode = record_end(length, reached, setting, tasks, lanes, lane, visits, td_var)
    if evaluation is not None and evaluation_due(evaluation, episode + 1, setting.episodes):
        _evaluate(world, setting, lanes, lane, episode + 1, evaluation)
    if choosing is not None:
        learn_of_episode(choosing, lane, length, reached, setting.gamma)
    return world.starts[lane, episode % BLOCK]


@inner
def _place(world, setting, tasks, lanes, lane, evaluation, choosing, posterior):
    """Gets a task's goal and first starts ready; the task is in its lane already."""
    task = lanes.task[lane]
    make_terminal(lanes.rows[lane], world.goal[task])
    world.goals[lane] = world.goal[task]
    world.cell[lane] = _start(world, tasks, task)
    _draw_starts(world, tasks, lanes, lane, 0, BLOCK)
    if evaluation is not None:
        _evaluate(world, setting, lanes, lane, 0, evaluation)
    if choosing is not None:
        begin(choosing, lane, task)
    if posterior is not None:
        begin_weighing(posterior, tasks, lane, task)


@inner
def _evaluate(world, setting, lanes, lane, ended, evaluation):
    """Plays a greedy episode from the target start with what the lane's task has learned in `ended` episodes."""
    task, ties = lanes.task[lane], lanes.ties[lane]
    rng, slips = evaluation.rng[task], world.slips[task]
    cell, goal, length = np.uint32(world.target_start), world.goals[lane], 0
    while cell != goal and length < setting.horizon:
        choice = greedy_choice(draw(rng), slips[0], slips[1], slips[2]) | ties[cell]
        cell = world.neighbours[4 * cell + DIRECTIONS[choice]]
        length += 1
    evaluation.steps[task, ended // evaluation.every] = length
    evaluation.reached[task, ended // evaluation.every] = cell == goal


@inner
def _draw_starts(world, tasks, lanes, lane, first, end):
    """Replaces the starts that episodes `first` to `end` - 1 left for: all of the next block have theirs."""
    for episode in range(first, end):
        world.starts[lane, episode % BLOCK] = _start(world, tasks, lanes.task[lane])


@inlined
def _start(world, tasks, task):
    """The cell where an episode starts; anywhere: uniform over the cells but the goal, without rejection."""
    if world.start != ANYWHERE:
        return np.uint32(world.start)
    cell = below(tasks.start_dice[task], tasks.q.shape[1] - 1)
    return np.uint32(cell + (cell >= world.goal[task]))
