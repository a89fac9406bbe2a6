# mypy: allow-untyped-defs, allow-untyped-calls
"""Double Q-learning: two tables a lane; the lane's own rows hold their mean."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from qinit_cli.kernels.compiled import inlined
from qinit_cli.kernels.lane import width_of
from qinit_cli.kernels.learner import (
    Batch,
    begin_task,
    is_state,
    put_value,
    rate_of,
    shaped,
    tally,
    target_of,
    update,
)
from qinit_cli.kernels.parts import body
from qinit_cli.kernels.payment import with_reward
from qinit_cli.kernels.random_streams import draw
from qinit_cli.kernels.vectors import WIDTH

ONE, LAST = np.uint64(1), np.uint64(1 << 63)


class Double(NamedTuple):
    """The tables of every lane."""

    tables: Any  # f8 (L, (S + 2) * 2 * W): of each state the row of the one, then that of the other
    rng: Any  # u8 (B, 4) coins
    words: Any  # u8 (L, 4) of the lane's task
    coins: Any  # u8 (L,) the lowest bit first, the highest bit that is set being none


def new_double(batch: Batch) -> Double:
    """The tables of a batch; ValueError without streams of their own."""
    if batch.rng is None:
        raise ValueError("double-q flips coins, and has no streams of its own")
    lanes, pairs = batch.pairs
    tables = np.zeros((lanes, 2 * pairs))
    words, coins = np.zeros((lanes, 4), np.uint64), np.ones(lanes, np.uint64)
    return Double(tables, batch.rng.copy(), words, coins)


@body(begin_task, Double)
def _begin_task(each, memory, lane, task):
    width, tables = width_of(memory), each.tables[lane]
    for word in range(4):
        each.words[lane, word] = each.rng[task, word]
    each.coins[lane] = ONE
    for state in range(len(memory.ties)):
        for action in range(width):
            place = 2 * width * state + action
            tables[place] = tables[place + width] = memory.rows[(width + WIDTH) * state + action]


@body(update, Double)
def _update(learner, memory, step, setting, hooks, recording):
    width, tables = width_of(memory), learner.tables[step.lane]
    coin = np.int64(_flipped(learner, step.lane))
    first = 2 * width * step.state + step.action
    place, target = first + coin * width, target_of(memory, step, setting)
    if is_state(memory, step.after):
        row = 2 * width * step.after
        best = _first_best(tables, row + coin * width, width)
        follows = setting.gamma * tables[row + (1 - coin) * width + best]
        target = with_reward(setting.payment, step.reward, follows)
    error = shaped(target, memory, step, hooks) - tables[place]
    alpha = rate_of(setting.rate, step.lane, place, step.episode)
    tables[place] += alpha * error
    put_value(memory, step.state, step.action, (tables[first] + tables[first + width]) * 0.5, setting.gamma)
    tally(memory, step, error, recording)
    return alpha


@inlined
def _first_best(tables, first, width):
    """The first of the actions with the largest value from `first` on; places without an action hold -inf."""
    best, largest = 0, tables[first]
    for action in range(1, width):
        value = tables[first + action]
        best, largest = (action, value) if value > largest else (best, largest)
    return best


@inlined
def _flipped(learner, lane):
    """A coin, 0 or 1; a draw has 63 of them."""
    coins = learner.coins[lane]
    if coins == ONE:
        coins = draw(learner.words[lane]) | LAST
    learner.coins[lane] = coins >> ONE
    return coins & ONE
