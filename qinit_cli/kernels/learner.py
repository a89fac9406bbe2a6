# mypy: allow-untyped-defs, allow-untyped-calls
"""Learners, compiled: what a step leaves in a lane's table, and with which step size.

A learner is a NamedTuple whose class may have bodies of its own for the parts below; what none has is Q-learning's. Arrays of
state-actions have a row for each lane and W places for each state, as the lanes' memory has.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from qinit_cli.kernels.compiled import inlined
from qinit_cli.kernels.exploration import Bounds, expectation
from qinit_cli.kernels.lane import (
    POTENTIAL,
    TD_VAR_RATE,
    WORTH,
    WORTH_OF_POTENTIAL,
    change,
    put,
    width_of,
)
from qinit_cli.kernels.parts import body, part
from qinit_cli.kernels.random_streams import Words
from qinit_cli.kernels.vectors import WIDTH
from qinit_cli.learning import Learning
from qinit_cli.schedules import ByVisits, Schedule

COUNTED = 1 << 16  # visits whose step size is looked up


class Batch(NamedTuple):
    """What the tasks of a batch are learned in."""

    tasks: int
    lanes: int
    states: int
    actions: int
    rng: Words | None  # (B, 4) what a learner draws from

    @property
    def pairs(self) -> tuple[int, int]:
        """The shape of what is kept for each state-action in each lane, (L, (S + 2) * W)."""
        return self.lanes, (self.states + 2) * -(-self.actions // WIDTH) * WIDTH


class QLearn(NamedTuple):
    """Q-learning."""


class OnPolicy(NamedTuple):
    """Sarsa."""


class Expected(NamedTuple):
    """Expected Sarsa."""


class Nothing(NamedTuple):
    """No learning."""


class Constant(NamedTuple):
    """One step size."""

    alpha: float


class Scheduled(NamedTuple):
    """A step size for each episode."""

    alphas: Any  # f8 (E,)


class Counted(NamedTuple):
    """1 / n^power for the n-th update of a state-action."""

    alphas: Any  # f8 (COUNTED,) of the first updates
    power: float
    updates: Any  # i8 (L, (S + 2) * W), or as many for each table of the learner


def new_rate(learning: Learning, batch: Batch) -> Constant | Scheduled | Counted:
    """The step size as the loop reads it."""
    alpha = learning.alpha
    if isinstance(alpha, ByVisits):
        lanes, pairs = batch.pairs
        updates = np.zeros((lanes, learning.learner.tables * pairs), np.int64)
        return Counted(np.array(alpha.of_visits(COUNTED)), float(alpha.power), updates)
    if isinstance(alpha, Schedule):
        return Scheduled(np.array(alpha.values(learning.episodes)))
    return Constant(alpha)


@part
def rate_of(rate, lane, pair, episode):
    """The step size of an update of a state-action of a lane; counts it where that matters."""
    return rate.alpha


@body(rate_of, Scheduled)
def _rate_of_episode(rate, lane, pair, episode):
    return rate.alphas[min(episode, len(rate.alphas) - 1)]  # after the last one nothing counts


@body(rate_of, Counted)
def _rate_of_update(rate, lane, pair, episode):
    count = rate.updates[lane, pair] + 1
    rate.updates[lane, pair] = count
    return rate.alphas[count - 1] if count <= len(rate.alphas) else 1.0 / math.pow(count, rate.power)


@part
def update(
    learner, memory, lane, state, action, after, following, setting, episode, potential, visits, td_var
):
    """Learns from a step to the row `after`; brings the row of `state` and what is recorded of it up to date.

    `following` is the action after it where the learner waits for that, -1 if none follows. Returns the step size.
    """
    target = memory.rows[(width_of(memory) + WIDTH) * after + width_of(memory) + WORTH]
    return _learn_towards(
        target, memory, lane, state, action, after, setting, episode, potential, visits, td_var
    )


@body(update, OnPolicy)
def _update_on_policy(
    learner, memory, lane, state, action, after, following, setting, episode, potential, visits, td_var
):
    target = on_policy_target(memory, lane, after, following, setting, episode)
    return _learn_towards(
        target, memory, lane, state, action, after, setting, episode, potential, visits, td_var
    )


@body(update, Expected)
def _update_expected(
    learner, memory, lane, state, action, after, following, setting, episode, potential, visits, td_var
):
    target = on_policy_target(memory, lane, after, -1, setting, episode)
    return _learn_towards(
        target, memory, lane, state, action, after, setting, episode, potential, visits, td_var
    )


@body(update, Nothing)
def _update_nothing(
    learner, memory, lane, state, action, after, following, setting, episode, potential, visits, td_var
):
    return 0.0


@inlined
def on_policy_target(memory, lane, after, following, setting, episode):
    """gamma times the value of the following action, or their mean under the exploration; what an end is worth."""
    row = (width_of(memory) + WIDTH) * np.int64(after)
    if np.int64(after) >= len(memory.ties) - 2:
        return memory.rows[row + width_of(memory) + WORTH]
    if following >= 0:
        return setting.gamma * memory.rows[row + following]
    return setting.gamma * expectation(setting.explore, memory, lane, after, episode)


@inlined
def _learn_towards(target, memory, lane, state, action, after, setting, episode, potential, visits, td_var):
    width = width_of(memory)
    row = (width + WIDTH) * state
    error = shaped(target, memory, state, after, potential) - memory.rows[row + action]
    alpha = rate_of(setting.rate, lane, width * state + action, episode)
    best, tied = change(memory, row, action, alpha * error)
    memory.rows[row + width + WORTH] = setting.gamma * best
    memory.ties[state] = tied
    tally(memory, state, action, error, visits, td_var)
    return alpha


@inlined
def shaped(target, memory, state, after, potential):
    """The target with the change of the potential, where there is one."""
    if potential is None:
        return target
    width = width_of(memory)
    entered, left = (width + WIDTH) * after + width, (width + WIDTH) * state + width
    # that of an end is 0, else shaping would change which policy is best (Ng et al., 1999)
    return target + memory.rows[entered + WORTH_OF_POTENTIAL] - memory.rows[left + POTENTIAL]


@inlined
def tally(memory, state, action, error, visits, td_var):
    """Counts an update and its squared error, where they are recorded."""
    width = width_of(memory)
    if visits is not None:
        memory.visits[2 * width * state + action] += 1
    if td_var is not None:
        place = 2 * width * state + width + action
        spread = memory.td_var[place]
        memory.td_var[place] = spread + TD_VAR_RATE * (error * error - spread)


@inlined
def put_value(memory, state, action, value, gamma):
    """Sets a value; brings its row up to date."""
    row = (width_of(memory) + WIDTH) * state
    best, tied = put(memory, row, action, value)
    memory.rows[row + width_of(memory) + WORTH] = gamma * best
    memory.ties[state] = tied


@part
def arrive(learner, memory, lane, state, gamma):
    """Brings a state's row up to date before it is read."""


@part
def chose(learner, memory, lane, state, action):
    """Notes which action a step takes, before the world moves."""


@part
def end_learning(learner, lane):
    """Notes that the lane's episode is over."""


@part
def begin_task(each, memory, lane, task):
    """Forgets what the lane's last task has left, given the table that the next one starts from in `memory`."""


@body(begin_task, Counted)
def _begin_counted(each, memory, lane, task):
    each.updates[lane, :] = 0


@body(begin_task, Bounds)
def _begin_bounds(each, memory, lane, task):
    each.visits[lane, :] = 0
