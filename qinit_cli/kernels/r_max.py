# mypy: allow-untyped-defs, allow-untyped-calls
"""R-Max (Brafman & Tennenholtz, 2002): a lane's model of its task, and plans in it.

Known state-actions keep the rows that their first steps led to. Where one becomes known its state is backed up, and then every
state that leads to one whose value has changed, in the order of a queue.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from qinit_cli.errors import NotAllowed
from qinit_cli.kernels.compiled import inlined, inner
from qinit_cli.kernels.lane import largest, rescan, width_of
from qinit_cli.kernels.learner import Batch, begin_task, tally, target_of, update, value, worth
from qinit_cli.kernels.parts import body
from qinit_cli.kernels.payment import with_reward
from qinit_cli.kernels.vectors import WIDTH

NONE = -1
BACKUPS = 10_000  # at most, of one step: what is left in the queue waits for the next


class Model(NamedTuple):
    """What every lane knows of its task; a step that is kept has the number known * pair + how many came before it."""

    known: int  # steps of a state-action that make it known
    tolerance: float
    count: Any  # i8 (L, (S + 2) * W) steps kept
    paid: Any  # f8 (L, (S + 2) * W) their rewards, in sum
    led_to: Any  # u4 (L, (S + 2) * W * known) the row that each led to
    before: (
        Any  # i4 of the same shape: the step kept before it that led to the same row; NONE if there is none
    )
    latest: Any  # i4 (L, S + 2) the last step kept that led to a row
    queue: Any  # i8 (L, S), a ring
    first: Any  # i8 (L,) of the queue
    waiting: Any  # i8 (L,) states in the queue
    waits: Any  # b1 (L, S) the state is in the queue


def new_model(batch: Batch, known: int, tolerance: float) -> Model:
    """Nothing known; NotAllowed where the steps of a lane cannot be numbered."""
    lanes, pairs = batch.pairs
    if pairs * known >= 1 << 31:
        raise NotAllowed(
            f"r-max with known={known} keeps {pairs * known} steps of a task, more than the {(1 << 31) - 1} that it can number; "
            f"give --learner r-max:known=N a smaller N"
        )
    return Model(
        known=known,
        tolerance=float(tolerance),
        count=np.zeros(batch.pairs, np.int64),
        paid=np.zeros(batch.pairs),
        led_to=np.zeros((lanes, pairs * known), np.uint32),
        before=np.zeros((lanes, pairs * known), np.int32),
        latest=np.full((lanes, batch.states + 2), NONE, np.int32),
        queue=np.zeros((lanes, batch.states), np.int64),
        first=np.zeros(lanes, np.int64),
        waiting=np.zeros(lanes, np.int64),
        waits=np.zeros((lanes, batch.states), np.bool_),
    )


@body(begin_task, Model)
def _begin_task(each, memory, lane, task):
    each.count[lane, :] = 0
    each.paid[lane, :] = 0.0
    each.latest[lane, :] = NONE
    each.waits[lane, :] = False
    each.first[lane] = each.waiting[lane] = 0


@body(update, Model)
def _update(learner, memory, step, setting, hooks, recording):
    lane, pair = step.lane, width_of(memory) * step.state + step.action
    error = target_of(memory, step, setting) - value(memory, step.state, step.action)
    tally(memory, step, error, recording)
    count = learner.count[lane, pair]
    if count < learner.known:
        kept = learner.known * pair + count
        learner.led_to[lane, kept] = step.after
        learner.before[lane, kept] = learner.latest[lane, step.after]
        learner.latest[lane, step.after] = kept
        learner.paid[lane, pair] += with_reward(setting.payment, step.reward, 0.0)
        learner.count[lane, pair] = count + 1
        if count + 1 == learner.known and not learner.waits[lane, step.state]:
            _push(learner, lane, step.state)
    if learner.waiting[lane] > 0:
        _plan(learner, memory, lane, setting.gamma)
    return 0.0


@inlined
def _push(learner, lane, state):
    """Puts a state at the end of the queue."""
    last = learner.first[lane] + learner.waiting[lane]
    states = learner.queue.shape[1]
    learner.queue[lane, last if last < states else last - states] = state
    learner.waits[lane, state] = True
    learner.waiting[lane] += 1


@inner
def _plan(learner, memory, lane, gamma):
    """Backs up the states of the queue, and all that their changes reach."""
    counts, before, width = learner.count[lane], learner.before[lane], width_of(memory)
    for _ in range(BACKUPS):
        if learner.waiting[lane] == 0:
            return
        state = learner.queue[lane, learner.first[lane]]
        learner.first[lane] = (learner.first[lane] + 1) % learner.queue.shape[1]
        learner.waiting[lane] -= 1
        learner.waits[lane, state] = False
        if abs(_back_up(learner, memory, lane, state, gamma)) > learner.tolerance:
            step = np.int64(learner.latest[lane, state])
            while step != NONE:
                pair = step // learner.known
                leads = pair // width
                if counts[pair] == learner.known and not learner.waits[lane, leads]:
                    _push(learner, lane, leads)
                step = np.int64(before[step])


@inlined
def _back_up(learner, memory, lane, state, gamma):
    """Puts the means of what their steps led to into the known values of a state; how far its largest has changed."""
    width, led_to = width_of(memory), learner.led_to[lane]
    row = (width + WIDTH) * state
    before = largest(memory, row)
    for action in range(memory.actions):
        pair = width * state + action
        if learner.count[lane, pair] == learner.known:
            summed, kept = learner.paid[lane, pair], learner.known * pair
            for step in range(kept, kept + learner.known):
                summed += worth(memory, np.int64(led_to[step]))
            memory.rows[row + action] = summed / learner.known
    rescan(memory, state, memory.actions, gamma)
    return largest(memory, row) - before
