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
from qinit_cli.kernels.lane import rescan, width_of
from qinit_cli.kernels.learner import Batch, begin_task, tally, update, value, worth
from qinit_cli.kernels.parts import body
from qinit_cli.kernels.vectors import WIDTH

NONE = -1


class Model(NamedTuple):
    """What every lane knows of its task; a step that is kept has the number known * pair + how many came before it."""

    known: int  # steps of a state-action that make it known
    tolerance: float
    count: Any  # i8 (L, (S + 2) * W) steps kept
    led_to: Any  # u4 (L, (S + 2) * W * known) the row that each led to
    before: (
        Any  # i4 of the same shape: the step kept before it that led to the same row; NONE if there is none
    )
    latest: Any  # i4 (L, S + 2) the last step kept that led to a row
    queue: Any  # i8 (L, S)
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
        led_to=np.zeros((lanes, pairs * known), np.uint32),
        before=np.zeros((lanes, pairs * known), np.int32),
        latest=np.full((lanes, batch.states + 2), NONE, np.int32),
        queue=np.zeros((lanes, batch.states), np.int64),
        waits=np.zeros((lanes, batch.states), np.bool_),
    )


@body(begin_task, Model)
def _begin_task(each, memory, lane, task):
    each.count[lane, :] = 0
    each.latest[lane, :] = NONE


@body(update, Model)
def _update(learner, memory, step, setting, hooks, recording):
    lane, pair = step.lane, width_of(memory) * step.state + step.action
    tally(memory, step, worth(memory, step.after) - value(memory, step.state, step.action), recording)
    count = learner.count[lane, pair]
    if count < learner.known:
        kept = learner.known * pair + count
        learner.led_to[lane, kept] = step.after
        learner.before[lane, kept] = learner.latest[lane, step.after]
        learner.latest[lane, step.after] = kept
        learner.count[lane, pair] = count + 1
        if count + 1 == learner.known:
            _plan(learner, memory, lane, step.state, setting.gamma)
    return 0.0


@inner
def _plan(learner, memory, lane, state, gamma):
    """Backs up the state, and all that its change reaches."""
    queue, waits, counts = learner.queue[lane], learner.waits[lane], learner.count[lane]
    before, latest, width = learner.before[lane], learner.latest[lane], width_of(memory)
    first, waiting = 0, 1
    queue[0], waits[state] = state, True
    while waiting > 0:
        here = queue[first]
        first = first + 1 if first + 1 < len(queue) else 0
        waiting -= 1
        waits[here] = False
        if abs(_back_up(learner, memory, lane, here, gamma)) > learner.tolerance:
            step = np.int64(latest[here])
            while step != NONE:
                pair = step // learner.known
                leads = pair // width
                if counts[pair] == learner.known and not waits[leads]:
                    last = first + waiting
                    queue[last if last < len(queue) else last - len(queue)] = leads
                    waits[leads] = True
                    waiting += 1
                step = np.int64(before[step])


@inlined
def _back_up(learner, memory, lane, state, gamma):
    """Puts the means of what their steps led to into the known values of a state; how far its largest has changed."""
    width, led_to = width_of(memory), learner.led_to[lane]
    row = (width + WIDTH) * state
    largest = _largest(memory, row)
    for action in range(memory.actions):
        pair = width * state + action
        if learner.count[lane, pair] == learner.known:
            summed, kept = 0.0, learner.known * pair
            for step in range(kept, kept + learner.known):
                summed += worth(memory, np.int64(led_to[step]))
            memory.rows[row + action] = summed / learner.known
    rescan(memory, state, memory.actions, gamma)
    return _largest(memory, row) - largest


@inlined
def _largest(memory, row):
    largest = memory.rows[row]
    for action in range(1, memory.actions):
        largest = max(largest, memory.rows[row + action])
    return largest
