# mypy: allow-untyped-defs, allow-untyped-calls
"""Knowledge that gives way, compiled: a lane acts on (1 - k) Q0 + k Q; a reconstruction after DQInit (Mehimeh, 2025).

Q0 is the method's start and stays; Q is learned from a return of 0. The numbers that values are made of are blended one by one,
those of a table as the weights of tiles: k = min(1, n / known_at) after n updates of a number. The lane's memory holds the
blend at all times, so that exploration, targets and evaluation read it as they read any value: the agent acts and bootstraps
on it. The abstract, which is all of the paper that this was made from, leaves k and what is bootstrapped on open.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from qinit_cli.kernels.compiled import inlined, unkept_inlined
from qinit_cli.kernels.lane import width_of
from qinit_cli.kernels.learner import Batch, aim, begin_task, put_value, rate_of, shaped, tally, update
from qinit_cli.kernels.parts import body, part
from qinit_cli.kernels.traces import traced
from qinit_cli.kernels.vectors import WIDTH


class Blended(NamedTuple):
    """A one-step learner, and what the numbers of every lane are blended of."""

    learner: Any  # whose target the learned values move towards
    known_at: float  # updates
    start: Any  # f8 (L, N) Q0, in the places of the memory's own numbers
    learned: Any  # f8 (L, N) Q
    updates: Any  # i8 (L, N)


def new_blend(learner: Any, known_at: int, batch: Batch) -> Blended:
    """Nothing learned yet."""
    start = np.zeros(batch.places)
    return Blended(learner, float(known_at), start, start.copy(), np.zeros(batch.places, np.int64))


@body(begin_task, Blended)
def _begin_task(each, memory, lane, task):
    numbers, _ = traced(memory)
    for place in range(len(numbers)):
        each.start[lane, place] = numbers[place]
        each.learned[lane, place] = 0.0
        each.updates[lane, place] = 0


@body(update, Blended)
def _update(learner, memory, step, setting, hooks, recording):
    return _learn(
        aim(learner.learner, memory, step, setting), learner, memory, step, setting, hooks, recording
    )


@unkept_inlined
def _learn(target, learner, memory, step, setting, hooks, recording):
    """Moves the learned value of the step's state-action towards the target. Returns the step size."""
    error = shaped(target, memory, step, hooks) - learned_value(memory, learner, step)
    pair = width_of(memory) * step.state + step.action
    alpha = rate_of(setting.rate, step.lane, pair, step.episode)
    learn_blended(memory, learner, step, alpha * error, setting.gamma)
    tally(memory, step, error, recording)
    return alpha


@part
def learned_value(memory, learner, step):
    """The learned value of the step's state-action."""
    return learner.learned[step.lane, (width_of(memory) + WIDTH) * step.state + step.action]


@part
def learn_blended(memory, learner, step, amount, gamma):
    """Adds to what the step's learned value is made of; brings the blend up to date."""
    place = (width_of(memory) + WIDTH) * step.state + step.action
    put_value(memory, step.state, step.action, blended(learner, step.lane, place, amount), gamma)


@inlined
def blended(learner, lane, place, amount):
    """The blend of a number once the amount was added to its learned part: an update."""
    learned, updates = learner.learned[lane, place] + amount, learner.updates[lane, place] + 1
    learner.learned[lane, place], learner.updates[lane, place] = learned, updates
    known = min(1.0, updates / learner.known_at)
    return (1.0 - known) * learner.start[lane, place] + known * learned
