# mypy: allow-untyped-defs, allow-untyped-calls
"""Eligibility traces: each lane lists the state-actions that have one, in the order in which they were met last.

A step changes the values of all of them, and leaves what hangs on the values of a row to whoever reads the row next. An entry of
the list with a trace of 0 counts for nothing: its state-action was met again, or its trace has become too small.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from qinit_cli.kernels.compiled import inlined, inner
from qinit_cli.kernels.lane import change, largest, note_best, width_of
from qinit_cli.kernels.learner import (
    Batch,
    arrive,
    begin_task,
    chose,
    end_learning,
    on_policy,
    rate_of,
    shaped,
    tally,
    target_of,
    update,
    value,
)
from qinit_cli.kernels.parts import body, part
from qinit_cli.kernels.vectors import WIDTH


class Watkins(NamedTuple):
    """The traces of every lane, for Watkins' Q(lambda)."""

    decay: float  # gamma * lambda
    accumulating: bool
    least: float
    first: Any  # i8 (L,) of the list
    end: Any  # i8 (L,) of the list
    place: Any  # u4 (L, most) of the values in the lane's rows
    trace: Any  # f8 (L, most)
    entry: (
        Any  # i4 (L, (S + 2) * (W + 4)) of each value in the list, where it has one: there stands its place
    )


class SarsaTraces(Watkins):
    """As Watkins, for Sarsa(lambda)."""


def new_traces(batch: Batch, decay: float, accumulating: bool, least: float, waits: bool) -> Watkins:
    """No traces yet, for Q(lambda), or for Sarsa(lambda), which waits."""
    lanes = batch.lanes
    most = 2 * batch.states * batch.actions + 64  # as many again as there can be: it is tidied up that seldom
    return (SarsaTraces if waits else Watkins)(
        decay=float(decay),
        accumulating=accumulating,
        least=float(least),
        first=np.zeros(lanes, np.int64),
        end=np.zeros(lanes, np.int64),
        place=np.zeros((lanes, most), np.uint32),
        trace=np.zeros((lanes, most)),
        entry=np.zeros(batch.places, np.int32),
    )


@body(arrive, Watkins, SarsaTraces)
def _arrive(learner, memory, lane, state, gamma):
    row = (width_of(memory) + WIDTH) * np.int64(state)
    best, tied = change(memory, row, 0, -0.0)  # which changes no value
    note_best(memory, np.int64(state), best, tied, gamma)


@body(begin_task, Watkins, SarsaTraces)
def _begin_task(each, memory, lane, task):
    each.first[lane] = each.end[lane] = 0


@body(end_learning, Watkins, SarsaTraces)
def _end_learning(learner, lane):
    learner.first[lane] = learner.end[lane] = 0


@body(chose, Watkins)
def _chose(learner, memory, lane, state, action):
    row = (width_of(memory) + WIDTH) * np.int64(state)
    if memory.rows[row + np.int64(action)] == largest(memory, row):
        _decay(learner, lane)
    else:
        learner.first[lane] = learner.end[lane] = 0


@body(update, Watkins)
def _update_watkins(learner, memory, step, setting, hooks, recording):
    return _learn_towards(target_of(memory, step, setting), learner, memory, step, setting, hooks, recording)


@body(update, SarsaTraces)
def _update_sarsa(learner, memory, step, setting, hooks, recording):
    target = on_policy(memory, step, setting)
    alpha = _learn_towards(target, learner, memory, step, setting, hooks, recording)
    _decay(learner, step.lane)
    return alpha


@inlined
def _learn_towards(target, learner, memory, step, setting, hooks, recording):
    width, lane = width_of(memory), step.lane
    error = shaped(target, memory, step, hooks) - value(memory, step.state, step.action)
    alpha = rate_of(setting.rate, lane, width * step.state + step.action, step.episode)
    meet_step(memory, learner, step)
    if error != 0.0:
        span = learner.first[lane], learner.end[lane]
        entries, share = traced(memory)
        _spread(entries, learner.place[lane], learner.trace[lane], span, alpha * error * share)
    tally(memory, step, error, recording)
    return alpha


@part
def traced(memory):
    """The numbers that have traces, and the share of an update that each takes."""
    return memory.rows, 1.0


@part
def meet_step(memory, learner, step):
    """Gives what a step's value is made of its traces."""
    meet(learner, step.lane, (width_of(memory) + WIDTH) * step.state + step.action)


@inlined
def meet(learner, lane, place):
    """Gives a number its trace, at the end of the list."""
    places, traces, old, trace = learner.place[lane], learner.trace[lane], learner.entry[lane, place], 0.0
    if learner.first[lane] <= old < learner.end[lane] and places[old] == place:
        trace, traces[old] = traces[old], 0.0
    if learner.end[lane] == len(places):
        _tidy(learner, lane)
    end = learner.end[lane]
    places[end], traces[end] = place, trace + 1.0 if learner.accumulating else 1.0
    learner.entry[lane, place] = end
    learner.end[lane] = end + 1


@inner
def _spread(rows, places, traces, span, amount):
    """Adds the amount, times its trace, to each value that has one; `span` are the list's first and end."""
    for entry in range(span[0], span[1]):
        rows[places[entry]] += amount * traces[entry]


@inlined
def _decay(learner, lane):
    """Lets the traces fall, and forgets the small ones."""
    first = _fallen(learner.trace[lane], learner.first[lane], learner.end[lane], learner.decay, learner.least)
    learner.first[lane] = first


@inner
def _fallen(traces, first, end, decay, least):
    """Lets the traces fall; the first of the list that counts."""
    for entry in range(first, end):
        trace = traces[entry] * decay
        traces[entry] = trace if trace >= least else 0.0
    while first < end and traces[first] == 0.0:
        first += 1
    return first


@inner
def _tidy(learner, lane):
    """Moves the list to the front, without what counts for nothing."""
    places, traces, kept = learner.place[lane], learner.trace[lane], 0
    for entry in range(learner.first[lane], learner.end[lane]):
        if traces[entry] > 0.0:
            places[kept], traces[kept] = places[entry], traces[entry]
            learner.entry[lane, places[kept]] = kept
            kept += 1
    learner.first[lane], learner.end[lane] = 0, kept
