# mypy: allow-untyped-defs, allow-untyped-calls
"""Delayed Q-learning (Strehl et al., 2006, algorithm 1)."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from qinit_cli.kernels.lane import WORTH, width_of
from qinit_cli.kernels.learner import Batch, begin_task, put, tally, update
from qinit_cli.kernels.parts import body
from qinit_cli.kernels.vectors import WIDTH


class Delayed(NamedTuple):
    """What every lane has met of each state-action since its last attempt to update it."""

    m: int
    epsilon1: float
    now: Any  # i8 (L,) steps of the task
    changed: Any  # i8 (L,) the step of the last change of a value; t* in the paper
    summed: Any  # f8 (L, (S + 2) * W) targets; U
    count: Any  # i8 of them; l
    attempted: Any  # i8 the step of the last attempt; t(s, a)
    learns: Any  # b1; LEARN


def new_delayed(batch: Batch, m: int, epsilon1: float) -> Delayed:
    """Nothing met yet."""
    each, pairs = np.zeros(batch.lanes, np.int64), np.zeros(batch.pairs, np.int64)
    return Delayed(
        m=m,
        epsilon1=float(epsilon1),
        now=each,
        changed=each.copy(),
        summed=np.zeros(batch.pairs),
        count=pairs,
        attempted=pairs.copy(),
        learns=np.ones(batch.pairs, np.bool_),
    )


@body(begin_task, Delayed)
def _begin_task(each, memory, lane, task):
    each.now[lane] = each.changed[lane] = 0
    each.summed[lane, :] = 0.0
    each.count[lane, :] = 0
    each.attempted[lane, :] = 0
    each.learns[lane, :] = True


@body(update, Delayed)
def _update(
    learner, memory, lane, state, action, after, following, setting, episode, potential, visits, td_var
):
    width = width_of(memory)
    pair = width * np.int64(state) + np.int64(action)
    target = memory.rows[(width + WIDTH) * np.int64(after) + width + WORTH]
    value = memory.rows[(width + WIDTH) * np.int64(state) + np.int64(action)]
    now = learner.now[lane] + 1
    learner.now[lane] = now
    if learner.learns[lane, pair]:
        learner.summed[lane, pair] += target
        learner.count[lane, pair] += 1
        if learner.count[lane, pair] == learner.m:
            mean = learner.summed[lane, pair] / learner.m
            if value - mean >= 2 * learner.epsilon1:
                put(memory, state, action, mean + learner.epsilon1, setting.gamma)
                learner.changed[lane] = now
            elif learner.attempted[lane, pair] >= learner.changed[lane]:
                learner.learns[lane, pair] = False
            learner.attempted[lane, pair], learner.count[lane, pair] = now, 0
            learner.summed[lane, pair] = 0.0
    elif learner.attempted[lane, pair] < learner.changed[lane]:
        learner.learns[lane, pair] = True
    tally(memory, state, action, target - value, visits, td_var)
    return 0.0
