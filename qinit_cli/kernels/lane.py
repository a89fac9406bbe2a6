# mypy: allow-untyped-defs, allow-untyped-calls
"""A lane: the working memory of the task that learns in it, whatever its family.

Tasks of a batch are learned side by side, a few at a time, because a step waits for the one before it: while
one task waits, the others go on. Each lane keeps its task's table as rows of eight numbers, one cache line a
state: the four values (three actions: the last is -inf), what entering the state is worth (gamma times the
largest value; 1 at the goal, which is never acted in), gamma * potential and potential. Which actions tie for
the largest value is kept beside it, a byte a state.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from qinit_cli.arrays import Floats, Integers
from qinit_cli.kernels.compiled import inlined, inner
from qinit_cli.kernels.vectors import add_to_entry

BLOCK = 512  # steps between two looks at the lane: draws are made, and tasks change places, only there
ROW = 8
WORTH, WORTH_OF_POTENTIAL, POTENTIAL = 4, 5, 6  # places in a row after the values
TD_VAR = 4  # place in a row of tallies after the visits
CACHE_LINE = 64
NEVER = 1 << 62  # episodes: a lane without a task never comes to its last
TD_VAR_RATE = 0.01  # of the exponential running mean of squared TD errors


class LaneSetting(NamedTuple):
    """How a task is learned; `QLearning` as the loops read it."""

    alpha: float
    gamma: float
    exploration: np.uint64
    episodes: int
    horizon: int


class Tasks(NamedTuple):
    """The tasks of a batch, B of them, and how far each has come."""

    q: Any  # f8 (B, S, A), in and out
    rng: Any  # u8 (B, 4, 8)
    start_dice: Any  # u8 (B, 4)
    episode: Any  # i8 (B,) episodes done
    step_count: Any  # i8 (B,) steps of those
    finished: Any  # b1 (B,)
    steps: Any  # i8 (B, bins) sums over the episodes of a bin
    reached: Any  # i8 (B, bins)


class Evaluation(NamedTuple):
    """Greedy episodes without learning: one before the first episode, then one after every `every`-th."""

    every: int
    rng: Any  # u8 (B, 4)
    steps: Any  # i8 (B, 1 + episodes // every)
    reached: Any  # i8 (B, 1 + episodes // every)


class Lanes(NamedTuple):
    """Working memory of L lanes; the last state is a goal that is no state of its family's table."""

    task: Any  # i8 (L,) who learns there; -1: nobody
    order: Any  # i8 (L,) the lanes in use come first
    queue: Any  # i8 (B,) the tasks in the order in which they are taken
    following: Any  # i8 (1,) how many have been taken
    rows: Any  # f8 (L, (S + 1) * ROW)
    ties: Any  # u1 (L, S + 1)
    visits: Any  # i8 (L, (S + 1) * ROW), visits in places 0 to 3
    td_var: Any  # f8, the same memory, td_var in places 4 to 7
    draws: Any  # u8 (BLOCK,)
    choices: Any  # u2 (L, BLOCK)
    time: Any  # i8 (L,) steps in the current episode
    ended: Any  # i8 (L,) episodes of the task that have ended
    lengths: Any  # i8 (L, BLOCK) steps of those of this block, negative if they missed the goal; e % BLOCK for the e-th


def new_lanes(count: int, states: int, queue: Integers) -> Lanes:
    """Lanes that nobody has learned in, and who waits for them."""
    places = (states + 1) * ROW
    visits = _aligned(count, places).view(np.int64)
    return Lanes(
        task=np.full(count, -1, np.int64),
        order=np.arange(count),
        queue=queue,
        following=np.zeros(1, np.int64),
        rows=_aligned(count, places),
        ties=np.zeros((count, states + 1), np.uint8),
        visits=visits,
        td_var=visits.view(np.float64),
        draws=np.zeros(BLOCK, np.uint64),
        choices=np.zeros((count, BLOCK), np.uint16),
        time=np.zeros(count, np.int64),
        ended=np.full(count, NEVER),
        lengths=np.zeros((count, BLOCK), np.int64),
    )


def _aligned(rows: int, columns: int) -> Floats:
    """Zeros that begin on a cache line, so that a row of eight is one."""
    memory = np.zeros(rows * columns + CACHE_LINE // 8)
    first = -memory.ctypes.data % CACHE_LINE // 8
    return memory[first : first + rows * columns].reshape(rows, columns)


class Memory(NamedTuple):
    """What a step reads and writes in one lane."""

    rows: Any  # f8 ((S + 1) * ROW,)
    ties: Any  # u1 (S + 1,)
    visits: Any  # i8 ((S + 1) * ROW,)
    td_var: Any  # f8, the same memory
    choices: Any  # u2 (BLOCK,)


@inlined
def memory(lanes, lane):
    """What a step reads and writes in one lane."""
    return Memory(
        lanes.rows[lane], lanes.ties[lane], lanes.visits[lane], lanes.td_var[lane], lanes.choices[lane]
    )


@inner
def is_idle(tasks, lanes, lane):
    """True if nobody learns in the lane, or nobody any more, and a task of the batch still waits."""
    task = lanes.task[lane]
    return lanes.following[0] < len(tasks.q) and (task < 0 or tasks.finished[task])


@inner
def take(tasks, lanes, lane, gamma, potential, visits, td_var):
    """Puts the next task into the lane: its table, potential, visits and td_var."""
    task = lanes.queue[lanes.following[0]]
    lanes.following[0] += 1
    rows, ties = lanes.rows[lane], lanes.ties[lane]
    counts, spreads = lanes.visits[lane], lanes.td_var[lane]
    states, actions = tasks.q.shape[1], tasks.q.shape[2]
    rows[:] = -np.inf
    for state in range(states):
        row = ROW * state
        best = -np.inf
        for action in range(actions):
            rows[row + action] = tasks.q[task, state, action]
            best = max(best, rows[row + action])
        rows[row + WORTH] = gamma * best
        tied = 0
        for action in range(actions):
            tied |= (rows[row + action] == best) << action
        ties[state] = tied
        if potential is not None:
            phi = potential[task % len(potential), state]
            rows[row + WORTH_OF_POTENTIAL] = gamma * phi
            rows[row + POTENTIAL] = phi
        for action in range(actions):
            if visits is not None:
                counts[row + action] = visits[task, state, action]
            if td_var is not None:
                spreads[row + TD_VAR + action] = td_var[task, state, action]
    lanes.task[lane] = task
    lanes.time[lane] = 0
    lanes.ended[lane] = 0


@inner
def make_terminal(rows, state):
    """Entering the state ends an episode: it is worth 1, and its potential is 0 whatever was given."""
    rows[ROW * state + WORTH] = 1.0
    rows[ROW * state + WORTH_OF_POTENTIAL] = 0.0


@inner
def leave(tasks, lanes, lane, visits, td_var):
    """Writes what the lane's task has learned back to the batch; what the lane goes on to do is lost."""
    task = lanes.task[lane]
    rows, counts, spreads = lanes.rows[lane], lanes.visits[lane], lanes.td_var[lane]
    for state in range(tasks.q.shape[1]):
        row = ROW * state
        for action in range(tasks.q.shape[2]):
            tasks.q[task, state, action] = rows[row + action]
            if visits is not None:
                visits[task, state, action] = counts[row + action]
            if td_var is not None:
                td_var[task, state, action] = spreads[row + TD_VAR + action]


@inner
def end_block(tasks, lanes, lane, episodes):
    """Adds the episodes that ended to their bins of the learning curve: e * bins // episodes for the e-th.

    Those after the task's last are nobody's: the rest of its last block is learned for nothing.
    """
    task = lanes.task[lane]
    bins = tasks.steps.shape[1]
    for episode in range(tasks.episode[task], min(lanes.ended[lane], episodes)):
        length = lanes.lengths[lane, episode % BLOCK]
        place = episode * bins // episodes
        tasks.steps[task, place] += abs(length)
        tasks.reached[task, place] += length > 0
        tasks.step_count[task] += abs(length)
    tasks.episode[task] = min(lanes.ended[lane], episodes)
    tasks.finished[task] = tasks.episode[task] == episodes


@inlined
def update(own, state, action, after, alpha, gamma, potential, visits, td_var):
    """Q-learning's update for one step; brings the row of `state`, its ties and tallies up to date."""
    row = ROW * state
    target = own.rows[ROW * after + WORTH]
    if potential is not None:
        target = target + own.rows[ROW * after + WORTH_OF_POTENTIAL] - own.rows[row + POTENTIAL]
    error = target - own.rows[row + action]
    best, tied = add_to_entry(own.rows, row, action, alpha * error)
    own.rows[row + WORTH] = gamma * best
    own.ties[state] = tied
    if visits is not None:
        own.visits[row + action] += 1
    if td_var is not None:
        spread = own.td_var[row + TD_VAR + action]
        own.td_var[row + TD_VAR + action] = spread + TD_VAR_RATE * (error * error - spread)


@inlined
def record_end(length, reached, setting, tasks, lanes, lane, visits, td_var):
    """How many episodes have ended before; notes the length, and writes the results back after the last."""
    episode = lanes.ended[lane]
    lanes.lengths[lane, episode % BLOCK] = length if reached else -length
    lanes.ended[lane] = episode + 1
    if episode + 1 == setting.episodes:
        leave(tasks, lanes, lane, visits, td_var)
    return episode


@inlined
def evaluation_due(evaluation, ended, episodes):
    """True if a greedy episode follows the first `ended` ones."""
    return ended % evaluation.every == 0 and ended <= episodes


@inner
def lanes_in_use(tasks, lanes):
    """How many lanes hold an unfinished task; those come first in `lanes.order`."""
    count, rest = 0, len(lanes.task)
    for lane in range(len(lanes.task)):
        task = lanes.task[lane]
        if task >= 0 and not tasks.finished[task]:
            lanes.order[count] = lane
            count += 1
        else:
            rest -= 1
            lanes.order[rest] = lane
    return count
