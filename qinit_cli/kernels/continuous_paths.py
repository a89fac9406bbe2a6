# mypy: allow-untyped-defs, allow-untyped-calls
"""Paths through continuous worlds without learning: greedy in a table over their bins, or by a plain controller.

The steps are those that learning takes, one lane at a time; the code is compiled for the world's class and kept with its package.
"""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np

from qinit_cli.kernels.compiled import kept_with, unkept_inlined
from qinit_cli.kernels.continuous import bin_of, end_at, guide, put_state
from qinit_cli.kernels.parts import Function
from qinit_cli.kernels.random_streams import unit
from qinit_cli.kernels.worlds import GOAL, start_of, step_of

NEVER = -1  # a path that does not arrive


def path_lengths(binned, greedy, centres, rng, horizon, lengths):
    """Writes into `lengths` i4 (B, S, A) the steps to the goal from each bin's centre f8 (S, D).

    First each action, then those of `greedy` i8 (B, S). 0 where the centre is in the goal; NEVER where an episode ends there
    otherwise, and beyond the horizon.
    """
    world = binned.world
    for task in range(lengths.shape[0]):
        for state in range(lengths.shape[1]):
            _put(world, task, rng, centres[state])
            code = end_at(world, task, 0)
            for action in range(lengths.shape[2]):
                if code != 0:
                    lengths[task, state, action] = 0 if code == GOAL else NEVER
                else:
                    _put(world, task, rng, centres[state])
                    lengths[task, state, action] = _steps(binned, task, action, greedy[task], rng, horizon)


def greedy_visits(binned, greedy, start, rng, horizon, visits):
    """Writes into `visits` i4 (B, S) how often the path of `greedy` i8 (B, S) from `start` f8 (D,) is in each bin, both its ends
    included; zeros where it does not arrive within the horizon."""
    world = binned.world
    for task in range(visits.shape[0]):
        visits[task, :] = 0
        _put(world, task, rng, start)
        here, code, steps = _bin(binned), np.int64(end_at(world, task, 0)), 0
        visits[task, here] = 1
        while code == 0 and steps < horizon:
            code = np.int64(step_of(world, task, 0, here, greedy[task, here], unit(rng), rng))
            here = _bin(binned)
            visits[task, here] += 1
            steps += 1
        if code != GOAL:
            visits[task, :] = 0


def arrivals(binned, greedy, words, horizon, counts):
    """Writes into `counts` i8 (B,) how many greedy episodes from the target start arrive, of one for each of words (B, P, 4)."""
    for task in range(len(counts)):
        counts[task] = 0
        for probe in range(words.shape[1]):
            rng = words[task, probe]
            start_of(binned.world, task, 0, rng, False)
            action = greedy[task, _bin(binned)]
            counts[task] += _steps(binned, task, action, greedy[task], rng, horizon) > 0


def guided_arrivals(binned, words, horizon, counts):
    """As `arrivals`, of the episodes of the world's plain controller."""
    world = binned.world
    for task in range(len(counts)):
        counts[task] = 0
        for probe in range(words.shape[1]):
            rng = words[task, probe]
            start_of(world, task, 0, rng, False)
            code, steps = np.int64(0), 0
            while code == 0 and steps < horizon:
                action = np.int64(guide(world, task, 0))
                code = np.int64(step_of(world, task, 0, 0, action, unit(rng), rng))
                steps += 1
            counts[task] += code == GOAL


def for_world(function: Function, binned: Any) -> Function:
    """One of these functions, compiled for the world that is binned."""
    world: Any = type(binned.world)
    return _compiled(function, world)


@cache
def _compiled(function: Any, world: Any) -> Function:
    made: Function = kept_with((world.__module__,), function)
    return made


@unkept_inlined
def _put(world, task, rng, state):
    """Begins an episode in that state."""
    start_of(world, task, 0, rng, False)
    put_state(world, 0, state)


@unkept_inlined
def _bin(binned):
    return bin_of(binned.world.observed[0], binned.low, binned.scale, binned.bins)


@unkept_inlined
def _steps(binned, task, action, greedy, rng, horizon):
    """Steps to the goal: `action` first, then the bins' `greedy` ones i8 (S,); NEVER if it is not reached within the horizon."""
    for step in range(1, horizon + 1):
        code = np.int64(step_of(binned.world, task, 0, 0, action, unit(rng), rng))
        if code != 0:
            return step if code == GOAL else NEVER
        action = greedy[_bin(binned)]
    return NEVER
