# mypy: allow-untyped-defs, allow-untyped-calls
"""Eligibility traces: each lane lists the state-actions that have one.

A step changes the values of all of them, and leaves what hangs on the values of a row to whoever reads the row next.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from qinit_cli.kernels.compiled import inlined, inner
from qinit_cli.kernels.lane import WORTH, rescan, width_of
from qinit_cli.kernels.learner import (
    Batch,
    arrive,
    begin_task,
    chose,
    end_learning,
    on_policy_target,
    rate_of,
    shaped,
    tally,
    update,
)
from qinit_cli.kernels.parts import body
from qinit_cli.kernels.vectors import WIDTH

ABSENT = -1


class Watkins(NamedTuple):
    """The traces of every lane, for Watkins' Q(lambda)."""

    decay: float  # gamma * lambda
    accumulating: bool
    least: float
    count: Any  # i8 (L,) traces
    place: Any  # i8 (L, most) of their values in the lane's rows
    trace: Any  # f8 (L, most)
    slot: Any  # i4 (L, (S + 2) * (W + 4)) where a value stands in the list; ABSENT if it has none


class SarsaTraces(NamedTuple):
    """As Watkins, for Sarsa(lambda)."""

    decay: float
    accumulating: bool
    least: float
    count: Any
    place: Any
    trace: Any
    slot: Any


def new_watkins(batch: Batch, decay: float, accumulating: bool, least: float) -> Watkins:
    """No traces yet, for Q(lambda)."""
    return Watkins(float(decay), accumulating, float(least), *_lists(batch))


def new_sarsa_lambda(batch: Batch, decay: float, accumulating: bool, least: float) -> SarsaTraces:
    """No traces yet, for Sarsa(lambda)."""
    return SarsaTraces(float(decay), accumulating, float(least), *_lists(batch))


def _lists(batch: Batch) -> tuple[Any, Any, Any, Any]:
    lanes, pairs = batch.pairs
    places = pairs + (batch.states + 2) * WIDTH
    most = batch.states * batch.actions
    return (
        np.zeros(lanes, np.int64),
        np.zeros((lanes, most), np.int64),
        np.zeros((lanes, most)),
        np.full((lanes, places), ABSENT, np.int32),
    )


@body(arrive, Watkins, SarsaTraces)
def _arrive(learner, memory, lane, state, gamma):
    rescan(memory, np.int64(state), memory.actions, gamma)


@body(begin_task, Watkins, SarsaTraces)
def _begin_task(each, memory, lane, task):
    _cut(each, lane)


@body(end_learning, Watkins, SarsaTraces)
def _end_learning(learner, lane):
    _cut(learner, lane)


@body(chose, Watkins)
def _chose(learner, memory, lane, state, action):
    row = (width_of(memory) + WIDTH) * np.int64(state)
    value, greedy = memory.rows[row + np.int64(action)], True
    for each in range(memory.actions):
        greedy &= memory.rows[row + each] <= value
    if greedy:
        _decay(learner, lane)
    else:
        _cut(learner, lane)


@body(update, Watkins)
def _update_watkins(
    learner, memory, lane, state, action, after, following, setting, episode, potential, visits, td_var
):
    target = memory.rows[(width_of(memory) + WIDTH) * np.int64(after) + width_of(memory) + WORTH]
    return _learn_towards(
        target, learner, memory, lane, state, action, after, setting, episode, potential, visits, td_var
    )


@body(update, SarsaTraces)
def _update_sarsa(
    learner, memory, lane, state, action, after, following, setting, episode, potential, visits, td_var
):
    target = on_policy_target(memory, lane, after, following, setting, episode)
    alpha = _learn_towards(
        target, learner, memory, lane, state, action, after, setting, episode, potential, visits, td_var
    )
    _decay(learner, lane)
    return alpha


@inlined
def _learn_towards(
    target, learner, memory, lane, state, action, after, setting, episode, potential, visits, td_var
):
    width = width_of(memory)
    place = (width + WIDTH) * np.int64(state) + np.int64(action)
    error = shaped(target, memory, state, after, potential) - memory.rows[place]
    alpha = rate_of(setting.rate, lane, width * np.int64(state) + np.int64(action), episode)
    _meet(learner, lane, place)
    if error != 0.0:
        _spread(learner, memory, lane, alpha * error)
    tally(memory, state, action, error, visits, td_var)
    return alpha


@inlined
def _meet(learner, lane, place):
    """Gives a state-action its trace."""
    slot, traces = np.int64(learner.slot[lane, place]), learner.trace[lane]
    if slot == ABSENT:
        slot = learner.count[lane]
        learner.count[lane] = slot + 1
        learner.slot[lane, place] = slot
        learner.place[lane, slot], traces[slot] = place, 0.0
    traces[slot] = traces[slot] + 1.0 if learner.accumulating else 1.0


@inner
def _spread(learner, memory, lane, change):
    """Adds the change, times its trace, to each value that has one."""
    places, traces = learner.place[lane], learner.trace[lane]
    for slot in range(learner.count[lane]):
        memory.rows[places[slot]] += change * traces[slot]


@inner
def _decay(learner, lane):
    """Lets the traces fall, and forgets the small ones."""
    places, traces, slots = learner.place[lane], learner.trace[lane], learner.slot[lane]
    kept = 0
    for slot in range(learner.count[lane]):
        trace, place = traces[slot] * learner.decay, places[slot]
        remains = trace >= learner.least
        places[kept], traces[kept] = place, trace
        slots[place] = kept if remains else ABSENT
        kept += remains
    learner.count[lane] = kept


@inner
def _cut(learner, lane):
    """Forgets all traces."""
    for slot in range(learner.count[lane]):
        learner.slot[lane, learner.place[lane, slot]] = ABSENT
    learner.count[lane] = 0
