# mypy: allow-untyped-defs, allow-untyped-calls
"""Delayed Q-learning (Strehl et al., 2006, algorithm 1)."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from qinit_cli.kernels.lane import width_of
from qinit_cli.kernels.learner import Batch, begin_task, put_value, tally, target_of, update, value
from qinit_cli.kernels.parts import body

RESTS = -1


class Delayed(NamedTuple):
    """What every lane has met of each state-action since its last attempt to update it."""

    m: int
    epsilon1: float
    now: Any  # i8 (L,) steps of the task
    changed: Any  # i8 (L,) the step of the last change of a value; t* in the paper
    summed: Any  # f8 (L, (S + 2) * W) targets; U
    count: Any  # i8 of them, l; RESTS where LEARN is false
    attempted: Any  # i8 the step of the last attempt; t(s, a)


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
    )


@body(begin_task, Delayed)
def _begin_task(each, memory, lane, task):
    each.now[lane] = each.changed[lane] = 0
    each.summed[lane, :] = 0.0
    each.count[lane, :] = 0
    each.attempted[lane, :] = 0


@body(update, Delayed)
def _update(learner, memory, step, setting, hooks, recording):
    lane, pair = step.lane, width_of(memory) * step.state + step.action
    target, before = target_of(memory, step, setting), value(memory, step.state, step.action)
    now, count = learner.now[lane] + 1, learner.count[lane, pair]
    learner.now[lane] = now
    if count != RESTS:
        count += 1
        summed = learner.summed[lane, pair] + target
        if count == learner.m:
            count, mean, summed = 0, summed / learner.m, 0.0
            if before - mean >= 2 * learner.epsilon1:
                put_value(memory, step.state, step.action, mean + learner.epsilon1, setting.gamma)
                learner.changed[lane] = now
            elif learner.attempted[lane, pair] >= learner.changed[lane]:
                count = RESTS
            learner.attempted[lane, pair] = now
        learner.summed[lane, pair], learner.count[lane, pair] = summed, count
    elif learner.attempted[lane, pair] < learner.changed[lane]:
        learner.count[lane, pair] = 0
    tally(memory, step, target - before, recording)
    return 0.0
