# mypy: allow-untyped-defs, allow-untyped-calls
"""A lane: the working memory of the task that learns in it, whatever its world.

Tasks of a batch are learned side by side, a few at a time, because a step waits for the one before it: while
one task waits, the others go on. Each lane keeps its task's table as rows, one for each state and two more for the
goal and for being lost, which end an episode. A row is the values of the actions, filled up with -inf to a multiple of
four, and four numbers more: what entering the state is worth (gamma times the largest value; for the goal its reward), gamma *
potential, potential, and nothing: with up to four actions, one cache line. Which of these tie for the largest value is
kept beside it, a byte a state; where there are more actions, a step looks for that itself.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from qinit_cli.arrays import Floats, Integers
from qinit_cli.kernels.choices import ACTIONS, NO_SLIP, greedy_choice
from qinit_cli.kernels.compiled import inlined, inner, unkept
from qinit_cli.kernels.parts import body, part
from qinit_cli.kernels.payment import worth_of_end
from qinit_cli.kernels.random_streams import LOW_12, TWELVE
from qinit_cli.kernels.vectors import WIDTH, add_to_entry, put_entry

BLOCK = 512  # steps between two looks at the lane: draws are made, and tasks change places, only there
FEW = 4  # actions whose row is one vector
WORTH, WORTH_OF_POTENTIAL, POTENTIAL = 0, 1, 2  # places in a row after the values
CACHE_LINE = 64
NEVER = 1 << 62  # episodes: a lane without a task never comes to its last
TD_VAR_RATE = 0.01  # of the exponential running mean of squared TD errors


class LaneSetting(NamedTuple):
    """How a task is learned; `Learning` as the loop reads it."""

    gamma: float
    learner: Any  # a class of learner.py or one like it
    rate: Any  # a class of learner.py
    explore: Any  # a class of exploration.py
    payment: Any  # a class of payment.py
    episodes: int
    horizon: int
    anywhere: bool  # where episodes start; else at the target start
    all_actions: np.uint64  # a bit for each
    alone: int  # lanes of a group that are learned one after the other if no more are in use


class Tasks(NamedTuple):
    """The tasks of a batch, B of them, and how far each has come."""

    q: Any  # f8 (B, S, A), in and out
    rng: Any  # u8 (B, 4, 8)
    start_dice: Any  # u8 (B, 4)
    world_dice: Any  # u8 (B, 4) randomness of a task's world beyond the steps' own
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


class Recording(NamedTuple):
    """What is recorded of each task besides its table; what is None is not, and costs nothing."""

    visits: Any  # i8 (B, S, A)
    td_var: Any  # f8 (B, S, A)
    evaluation: Any  # an Evaluation


class Hooks(NamedTuple):
    """What a method changes in learning; what is None costs nothing.

    A function that asks whether one is None takes it as an argument of its own: Numba leaves out branches on arguments alone.
    """

    potential: Any  # f8 (B or 1, S)
    choosing: Any  # a policies.Choosing
    posterior: Any  # a posterior.PosteriorState


class Memory(NamedTuple):
    """What steps read and write, of all lanes (L, ...) or of one; a table of up to four actions."""

    rows: Any  # f8 (L, (S + 2) * 8)
    ties: Any  # u1 (L, S + 2)
    visits: Any  # i8 (L, (S + 2) * 8), visits in places 0 to 3
    td_var: Any  # f8, the same memory, td_var in places 4 to 7
    draws: Any  # u8 (L, BLOCK)
    choices: Any  # u2 (L, BLOCK)
    actions: int


class WideMemory(NamedTuple):
    """As Memory, for more than four actions: W places each for values, visits and td_var."""

    rows: Any  # f8 (L, (S + 2) * (W + 4))
    ties: Any  # u1 (L, S + 2), not used
    visits: Any  # i8 (L, (S + 2) * 2 * W), visits first
    td_var: Any  # f8, the same memory, td_var after them
    draws: Any  # u8 (L, BLOCK)
    choices: Any  # u2 (L, 0)
    actions: int
    width: int  # W, a multiple of four


class Waiting(NamedTuple):
    """The step of each lane whose update waits for the action after it."""

    state: Any  # i8 (L,) where it began; -1: none waits
    action: Any  # i8 (L,)
    reward: Any  # f8 (L,) that the world told


class Lanes(NamedTuple):
    """Working memory of L lanes."""

    memory: Any  # Memory, WideMemory or one of tiles.py
    task: Any  # i8 (L,) who learns there; -1: nobody
    queue: Any  # i8 (B,) the tasks in the order in which they are taken
    following: Any  # i8 (1,) how many have been taken
    state: Any  # u4 (L,)
    action: Any  # u1 (L,) of the coming step
    after: Any  # u4 (L,) the place that it leads to, see worlds.place_of
    waiting: Any  # a Waiting, or None if the learner does not wait
    time: Any  # i8 (L,) steps of the current episode before this block
    ended: Any  # i8 (L,) episodes of the task that have ended
    lengths: Any  # i8 (L, BLOCK) steps of those of this block, negative if they missed the goal; e % BLOCK for the e-th


def new_lanes(memory: Any, queue: Integers, waits: bool) -> Lanes:
    """Lanes that nobody has learned in, who waits for them, and their memory."""
    count = len(memory.rows)
    return Lanes(
        memory=memory,
        task=np.full(count, -1, np.int64),
        queue=queue,
        following=np.zeros(1, np.int64),
        state=np.zeros(count, np.uint32),
        action=np.zeros(count, np.uint8),
        after=np.zeros(count, np.uint32),
        waiting=Waiting(np.full(count, -1), np.zeros(count, np.int64), np.zeros(count)) if waits else None,
        time=np.zeros(count, np.int64),
        ended=np.full(count, NEVER),
        lengths=np.zeros((count, BLOCK), np.int64),
    )


def new_memory(count: int, states: int, actions: int) -> Memory | WideMemory:
    """The memory of lanes that hold tables."""
    width = -(-actions // WIDTH) * WIDTH
    visits = aligned(count, (states + 2) * 2 * width).view(np.int64)
    arrays = (
        aligned(count, (states + 2) * (width + WIDTH)),
        np.zeros((count, states + 2), np.uint8),
        visits,
        visits.view(np.float64),
        np.zeros((count, BLOCK), np.uint64),
    )
    if actions <= FEW:
        return Memory(*arrays, np.zeros((count, BLOCK), np.uint16), actions)
    return WideMemory(*arrays, np.zeros((count, 0), np.uint16), actions, width)


def aligned(rows: int, columns: int) -> Floats:
    """Zeros that begin on a cache line, so that a row of eight is one."""
    memory = np.zeros(rows * columns + CACHE_LINE // 8)
    first = -memory.ctypes.data % CACHE_LINE // 8
    return memory[first : first + rows * columns].reshape(rows, columns)


@part
def own(memory, lane):
    """What steps read and write in one lane, or in those of a slice."""
    return Memory(
        memory.rows[lane],
        memory.ties[lane],
        memory.visits[lane],
        memory.td_var[lane],
        memory.draws[lane],
        memory.choices[lane],
        memory.actions,
    )


@body(own, WideMemory)
def _own_wide(memory, lane):
    return WideMemory(
        memory.rows[lane],
        memory.ties[lane],
        memory.visits[lane],
        memory.td_var[lane],
        memory.draws[lane],
        memory.choices[lane],
        memory.actions,
        memory.width,
    )


@part
def width_of(memory):
    """The places of a row before what it is worth."""
    return WIDTH


@body(width_of, WideMemory)
def _width_of_wide(memory):
    return memory.width


@part
def greedy_action(memory, state, drawn):
    """One of a state's greedy actions, by the lower 12 bits of a draw."""
    return ACTIONS[greedy_choice(drawn, NO_SLIP[0], NO_SLIP[1], NO_SLIP[2]) | memory.ties[state]]


@body(greedy_action, WideMemory)
def _greedy_action_wide(memory, state, drawn):
    return picked(memory, state, drawn, False)


@inlined
def picked(memory, state, drawn, explores):
    """One of the greedy actions, or of all where the step explores, by the lower 12 bits of its draw."""
    row = (width_of(memory) + WIDTH) * np.int64(state)
    values = memory.rows[row : row + memory.actions]
    best, tied, taken = values[0], 0, 0
    for value in values:
        best = max(best, value)
    for value in values:
        tied += (value == best) | explores
    pick = np.int64(((drawn & LOW_12) * np.uint64(tied)) >> TWELVE)
    for action in range(len(values)):  # no branch that a processor could guess wrong
        may = (values[action] == best) | explores
        taken = action if may & (pick == 0) else taken
        pick -= may
    return taken


@part
def change(memory, row, action, amount):
    """Adds to a row's value: the largest afterwards, and which of them equal it."""
    return add_to_entry(memory.rows, row, action, amount)


@body(change, WideMemory)
def _change_wide(memory, row, action, amount):
    memory.rows[row + action] += amount
    return largest(memory, row), 0


@part
def put(memory, row, action, value):
    """Sets a row's value: the largest afterwards, and which of them equal it."""
    return put_entry(memory.rows, row, action, value)


@body(put, WideMemory)
def _put_wide(memory, row, action, value):
    memory.rows[row + action] = value
    return largest(memory, row), 0


@inlined
def largest(memory, row):
    """The largest value of a row."""
    best = memory.rows[row]
    for place in range(1, memory.actions):
        best = max(best, memory.rows[row + place])
    return best


@inner
def rescan(memory, state, actions, gamma):
    """Brings what entering a state is worth, and its ties, up to date with its values."""
    width = width_of(memory)
    row, best, tied = (width + WIDTH) * state, -np.inf, 0
    for action in range(actions):
        best = max(best, memory.rows[row + action])
    for action in range(actions):
        tied |= (memory.rows[row + action] == best) << action
    note_best(memory, state, best, tied, gamma)


@part
def note_best(memory, state, best, tied, gamma):
    """Keeps what entering a state is worth, and its ties, given the largest of its values and which of them equal it."""
    width = width_of(memory)
    memory.rows[(width + WIDTH) * state + width + WORTH] = gamma * best
    memory.ties[state] = tied


@inner
def is_idle(tasks, lanes, lane):
    """True if nobody learns in the lane, or nobody any more, and a task of the batch still waits."""
    task = lanes.task[lane]
    return lanes.following[0] < len(tasks.q) and (task < 0 or tasks.finished[task])


@inlined
def in_use(tasks, lanes, lane):
    """True if the lane holds an unfinished task."""
    task = lanes.task[lane]
    return task >= 0 and not tasks.finished[task]


@unkept
def take(tasks, lanes, lane, gamma, payment, potential, visits, td_var):
    """Puts the next task into the lane: its table, potential, visits and td_var."""
    task = lanes.queue[lanes.following[0]]
    lanes.following[0] += 1
    memory = own(lanes.memory, lane)
    width = width_of(memory)
    fill(memory, tasks, task, gamma, potential, visits, td_var)
    for end in range(2):
        place = (width + WIDTH) * (len(memory.ties) - 2 + end) + width
        memory.rows[place + WORTH] = worth_of_end(payment, end)
        memory.rows[place + WORTH_OF_POTENTIAL] = 0.0
    lanes.task[lane] = task
    lanes.time[lane] = 0
    lanes.ended[lane] = 0


@part
def fill(memory, tasks, task, gamma, potential, visits, td_var):
    """Writes what the task has learned so far into a lane's memory."""
    width, states, actions = width_of(memory), tasks.q.shape[1], tasks.q.shape[2]
    memory.rows[:] = -np.inf
    for state in range(states):
        row, tally = (width + WIDTH) * state, 2 * width * state
        for action in range(actions):
            memory.rows[row + action] = tasks.q[task, state, action]
            if visits is not None:
                memory.visits[tally + action] = visits[task, state, action]
            if td_var is not None:
                memory.td_var[tally + width + action] = td_var[task, state, action]
        rescan(memory, state, actions, gamma)
        if potential is not None:
            phi = potential[task % len(potential), state]
            memory.rows[row + width + WORTH_OF_POTENTIAL] = gamma * phi
            memory.rows[row + width + POTENTIAL] = phi


@part
def empty(memory, tasks, task, visits, td_var):
    """Writes what a lane's memory holds back to the task."""
    width = width_of(memory)
    for state in range(tasks.q.shape[1]):
        row, tally = (width + WIDTH) * state, 2 * width * state
        for action in range(tasks.q.shape[2]):
            tasks.q[task, state, action] = memory.rows[row + action]
            if visits is not None:
                visits[task, state, action] = memory.visits[tally + action]
            if td_var is not None:
                td_var[task, state, action] = memory.td_var[tally + width + action]


@part
def read(memory, state, gamma):
    """Sums a state's weights into its row; the rows of a table are their own."""


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
def evaluation_due(evaluation, ended, episodes):
    """True if a greedy episode follows the first `ended` ones."""
    return ended % evaluation.every == 0 and ended <= episodes
