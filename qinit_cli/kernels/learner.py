# mypy: allow-untyped-defs, allow-untyped-calls
"""Learners, compiled: what a step leaves in a lane's table, and with which step size.

What takes the settings, of which the learner is one, is kept in its callers alone: the learner may be a plug-in's.

A learner is a NamedTuple whose class may have bodies of its own for the parts below; what none has is Q-learning's. Arrays of
state-actions have a row for each lane and W places for each state, as the lanes' memory has.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from qinit_cli.kernels.compiled import inlined, unkept_inlined
from qinit_cli.kernels.exploration import Bounds, expectation
from qinit_cli.kernels.lane import (
    POTENTIAL,
    TD_VAR_RATE,
    WORTH,
    WORTH_OF_POTENTIAL,
    change,
    note_best,
    put,
    width_of,
)
from qinit_cli.kernels.parts import body, part
from qinit_cli.kernels.payment import with_reward
from qinit_cli.kernels.random_streams import Words
from qinit_cli.kernels.vectors import WIDTH
from qinit_cli.learning import Learning
from qinit_cli.schedules import ByVisits, Schedule

COUNTED = 1 << 16  # visits whose step size is looked up


class Batch(NamedTuple):
    """What the tasks of a batch are learned in."""

    lanes: int
    states: int
    actions: int
    rng: Words | None  # (B, 4) what a learner draws from

    @property
    def pairs(self) -> tuple[int, int]:
        """The shape of what is kept for each state-action in each lane, (L, (S + 2) * W)."""
        return self.lanes, (self.states + 2) * -(-self.actions // WIDTH) * WIDTH

    @property
    def places(self) -> tuple[int, int]:
        """A shape with room for what is kept for each number of the lanes' rows or weights, (L, (S + 2) * (W + 4))."""
        lanes, pairs = self.pairs
        return lanes, pairs + (self.states + 2) * WIDTH


class QLearn(NamedTuple):
    """Q-learning."""


class OnPolicy(NamedTuple):
    """Sarsa."""


class InExpectation(NamedTuple):
    """Expected Sarsa."""


class Nothing(NamedTuple):
    """No learning."""


class Constant(NamedTuple):
    """One step size."""

    alpha: float


class AlphaByEpisode(NamedTuple):
    """A step size for each episode."""

    alphas: Any  # f8 (E,)


class Counted(NamedTuple):
    """1 / n^power for the n-th update of a state-action."""

    alphas: Any  # f8 (COUNTED,) of the first updates
    power: float
    updates: Any  # i8 (L, (S + 2) * W), or as many for each table of the learner


def new_rate(learning: Learning, batch: Batch) -> Constant | AlphaByEpisode | Counted:
    """The step size as the loop reads it."""
    alpha = learning.alpha
    if isinstance(alpha, ByVisits):
        lanes, pairs = batch.pairs
        updates = np.zeros((lanes, learning.learner.tables * pairs), np.int64)
        return Counted(np.array(alpha.of_visits(COUNTED)), float(alpha.power), updates)
    if isinstance(alpha, Schedule):
        return AlphaByEpisode(np.array(alpha.values(learning.episodes)))
    return Constant(alpha)


@part
def rate_of(rate, lane, pair, episode):
    """The step size of an update of a state-action of a lane; counts it where that matters."""
    return rate.alpha


@body(rate_of, AlphaByEpisode)
def _rate_of_episode(rate, lane, pair, episode):
    return rate.alphas[min(episode, len(rate.alphas) - 1)]  # after the last one nothing counts


@body(rate_of, Counted)
def _rate_of_update(rate, lane, pair, episode):
    count = rate.updates[lane, pair] + 1
    rate.updates[lane, pair] = count
    return rate.alphas[count - 1] if count <= len(rate.alphas) else 1.0 / math.pow(count, rate.power)


class Step(NamedTuple):
    """A step that is learned from; whole numbers but for its reward."""

    lane: Any
    state: Any
    action: Any
    reward: Any  # that the world told; else 0, whatever was paid
    after: Any  # the row it led to: a state, or S for the goal, S + 1 for being lost
    following: Any  # the action after it where the learner waits for that; -1: none follows
    episode: Any


@part
def update(learner, memory, step, setting, hooks, recording):
    """Learns from a step; brings the row of its state and what is recorded of it up to date. Returns the step size."""
    return learn_towards(aim(learner, memory, step, setting), memory, step, setting, hooks, recording)


@body(update, Nothing)
def _update_nothing(learner, memory, step, setting, hooks, recording):
    return 0.0


@part
def aim(learner, memory, step, setting):
    """What a step's value moves towards."""
    return target_of(memory, step, setting)


@body(aim, OnPolicy)
def _aim_on_policy(learner, memory, step, setting):
    return on_policy(memory, step, setting)


@body(aim, InExpectation)
def _aim_in_expectation(learner, memory, step, setting):
    return expected(memory, step, setting)


@inlined
def value(memory, state, action):
    """Q of a state-action."""
    return memory.rows[(width_of(memory) + WIDTH) * state + action]


@inlined
def worth(memory, after):
    """What entering a row is worth beyond the step's reward: gamma max Q of a state; of the goal 1, if that alone pays."""
    return memory.rows[(width_of(memory) + WIDTH) * after + width_of(memory) + WORTH]


@inlined
def is_state(memory, after):
    """True if the row is a state's, False if an end's."""
    return after < len(memory.ties) - 2


@unkept_inlined
def target_of(memory, step, setting):
    """The reward of a step, and gamma times the largest value that follows."""
    return with_reward(setting.payment, step.reward, worth(memory, step.after))


@unkept_inlined
def expected(memory, step, setting):
    """The reward of a step, and gamma times the mean of the values that follow under the exploration."""
    if not is_state(memory, step.after):
        return target_of(memory, step, setting)
    follows = setting.gamma * expectation(setting.explore, memory, step.lane, step.after, step.episode)
    return with_reward(setting.payment, step.reward, follows)


@unkept_inlined
def on_policy(memory, step, setting):
    """The reward of a step, and gamma times the value of the following action; where none follows, what is expected."""
    if is_state(memory, step.after) and step.following >= 0:
        follows = setting.gamma * value(memory, step.after, step.following)
        return with_reward(setting.payment, step.reward, follows)
    return expected(memory, step, setting)


@unkept_inlined
def learn_towards(target, memory, step, setting, hooks, recording):
    """Moves the value of a step's state-action towards the target. Returns the step size."""
    width = width_of(memory)
    error = shaped(target, memory, step, hooks) - value(memory, step.state, step.action)
    alpha = rate_of(setting.rate, step.lane, width * step.state + step.action, step.episode)
    best, tied = change(memory, (width + WIDTH) * step.state, step.action, alpha * error)
    note_best(memory, step.state, best, tied, setting.gamma)
    tally(memory, step, error, recording)
    return alpha


@inlined
def shaped(target, memory, step, hooks):
    """The target with the change of the potential, where there is one."""
    if hooks.potential is None:
        return target
    width = width_of(memory)
    entered, left = (width + WIDTH) * step.after + width, (width + WIDTH) * step.state + width
    # that of an end is 0, else shaping would change which policy is best (Ng et al., 1999)
    return target + memory.rows[entered + WORTH_OF_POTENTIAL] - memory.rows[left + POTENTIAL]


@inlined
def tally(memory, step, error, recording):
    """Counts an update and its squared error, where they are recorded."""
    width = width_of(memory)
    first = 2 * width * step.state + step.action
    if recording.visits is not None:
        memory.visits[first] += 1
    if recording.td_var is not None:
        spread = memory.td_var[first + width]
        memory.td_var[first + width] = spread + TD_VAR_RATE * (error * error - spread)


@inlined
def put_value(memory, state, action, value, gamma):
    """Sets a value; brings its row up to date."""
    best, tied = put(memory, (width_of(memory) + WIDTH) * state, action, value)
    note_best(memory, state, best, tied, gamma)


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
