# mypy: allow-untyped-defs, allow-untyped-calls
"""Double Q-learning: two tables a lane; the lane's own rows hold their mean."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from qinit_cli.kernels.compiled import inlined
from qinit_cli.kernels.lane import WORTH, width_of
from qinit_cli.kernels.learner import Batch, begin_task, put, rate_of, shaped, tally, update
from qinit_cli.kernels.parts import body
from qinit_cli.kernels.random_streams import draw
from qinit_cli.kernels.vectors import WIDTH

SIXTY_THREE = np.uint64(63)


class Double(NamedTuple):
    """The tables of every lane."""

    tables: Any  # f8 (L, 2 * (S + 2) * W), one after the other
    updates: Any  # i8, of the same shape: updates of each state-action of each table, where the step size counts them
    rng: Any  # u8 (B, 4) coins
    words: Any  # u8 (L, 4) of the lane's task


def new_double(batch: Batch) -> Double:
    """The tables of a batch; ValueError without streams of their own."""
    if batch.rng is None:
        raise ValueError("double-q flips coins, and has no streams of its own")
    lanes, pairs = batch.pairs
    tables = np.zeros((lanes, 2 * pairs))
    return Double(tables, np.zeros(tables.shape, np.int64), batch.rng.copy(), np.zeros((lanes, 4), np.uint64))


@body(begin_task, Double)
def _begin_task(each, memory, lane, task):
    width, tables = width_of(memory), each.tables[lane]
    half = len(tables) // 2
    for word in range(4):
        each.words[lane, word] = each.rng[task, word]
    for state in range(len(memory.ties)):
        for action in range(width):
            value = memory.rows[(width + WIDTH) * state + action]
            tables[width * state + action] = tables[half + width * state + action] = value


@body(update, Double)
def _update(
    learner, memory, lane, state, action, after, following, setting, episode, potential, visits, td_var
):
    width, tables = width_of(memory), learner.tables[lane]
    half = len(tables) // 2
    coin = np.int64(draw(learner.words[lane]) >> SIXTY_THREE)
    learns, judges = coin * half, (1 - coin) * half
    pair = width * np.int64(state) + np.int64(action)
    target = memory.rows[(width + WIDTH) * np.int64(after) + width + WORTH]
    if np.int64(after) < len(memory.ties) - 2:
        first = width * np.int64(after)
        best = _first_best(tables, learns + first, memory.actions)
        target = setting.gamma * tables[judges + first + best]
    error = shaped(target, memory, state, after, potential) - tables[learns + pair]
    alpha = rate_of(setting.rate, lane, learns + pair, episode)
    tables[learns + pair] += alpha * error
    put(memory, state, action, (tables[pair] + tables[half + pair]) * 0.5, setting.gamma)
    tally(memory, state, action, error, visits, td_var)
    return alpha


@inlined
def _first_best(tables, first, actions):
    """The first of the actions with the largest value from `first` on."""
    best, largest = 0, tables[first]
    for action in range(1, actions):
        value = tables[first + action]
        best, largest = (action, value) if value > largest else (best, largest)
    return best
