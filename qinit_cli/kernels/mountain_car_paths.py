# mypy: allow-untyped-defs, allow-untyped-calls
"""Paths of Mountain Car without learning: expected optimal path lengths, and whether a task can be solved at all.

The dynamics are those that learning steps through (kernels.mountain_car.move), one car at a time.
"""

from __future__ import annotations

import numpy as np

from qinit_cli.kernels.compiled import compiled
from qinit_cli.kernels.mountain_car import FASTEST, LEFT, PUSHES, RIGHT, bin_of, is_done, moved

NEVER = -1  # a path that does not arrive


@compiled
def _steps(position, velocity, action, eta, hill, bins, greedy, horizon):
    """Steps to the flag: `action` first, then the bins' `greedy` ones (S,); NEVER if more than the horizon."""
    for step in range(1, horizon + 1):
        position, velocity = moved(position, velocity, PUSHES[action], eta, hill)
        if is_done(position, velocity):
            return step
        action = greedy[np.int64(bin_of(position, velocity, np.float64(bins)))]
    return NEVER


@compiled
def path_lengths(eta, hill, bins, q, horizon, eopl):
    """Writes into `eopl` i4 (B, S, 3) the steps from each bin's centre, greedy in the task's own `q` after the first.

    No rule against coming back: a good path visits bins again. 0 where the centre is already done.
    """
    wide, high = (RIGHT - LEFT) / bins, 2 * FASTEST / bins
    greedy = np.empty(bins * bins, np.int64)
    for task in range(len(eta)):
        for state in range(bins * bins):
            greedy[state] = np.argmax(q[task, state])
        for state in range(bins * bins):
            position = LEFT + (state // bins + 0.5) * wide
            velocity = -FASTEST + (state % bins + 0.5) * high
            done = is_done(position, velocity)
            for action in range(3):
                eopl[task, state, action] = (
                    0 if done else _steps(position, velocity, action, eta[task], hill, bins, greedy, horizon)
                )


@compiled
def greedy_lengths(eta, hill, bins, q, horizon, position, velocity, lengths):
    """Writes into `lengths` i8 (B,) the steps of each task's own greedy policy from one start; NEVER if beyond the horizon."""
    greedy = np.empty(bins * bins, np.int64)
    for task in range(len(eta)):
        for state in range(bins * bins):
            greedy[state] = np.argmax(q[task, state])
        first = greedy[np.int64(bin_of(position, velocity, np.float64(bins)))]
        lengths[task] = _steps(position, velocity, first, eta[task], hill, bins, greedy, horizon)


@compiled
def greedy_visits(eta, hill, bins, q, horizon, position, velocity, visits):
    """Writes into `visits` i4 (B, S) how often the path of each task's own greedy policy is in each bin, its first and its
    last state included; zeros where it is longer than the horizon."""
    greedy = np.empty(bins * bins, np.int64)
    for task in range(len(eta)):
        for state in range(bins * bins):
            greedy[state] = np.argmax(q[task, state])
        visits[task, :] = 0
        at, speed, arrives = position, velocity, False
        here = np.int64(bin_of(at, speed, np.float64(bins)))
        visits[task, here] = 1
        for _ in range(horizon):
            at, speed = moved(at, speed, PUSHES[greedy[here]], eta[task], hill)
            here = np.int64(bin_of(at, speed, np.float64(bins)))
            visits[task, here] += 1
            if is_done(at, speed):
                arrives = True
                break
        if not arrives:
            visits[task, :] = 0


@compiled
def pumped_lengths(eta, hill, horizon, position, velocity, lengths):
    """Writes into `lengths` i8 (B,) the steps of the energy pump, right if v >= 0 and else left; NEVER if beyond the horizon."""
    for task in range(len(eta)):
        at, speed = position, velocity
        lengths[task] = NEVER
        for step in range(1, horizon + 1):
            at, speed = moved(at, speed, PUSHES[2 if speed >= 0.0 else 0], eta[task], hill)
            if is_done(at, speed):
                lengths[task] = step
                break
