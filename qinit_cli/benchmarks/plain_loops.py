# mypy: allow-untyped-defs, allow-untyped-calls
"""Q-learning as one writes it in Numba at the first go: one task, a Generator, a scan for the best action, no records.

Each loop changes `q` in place and gives back the number of steps. They are raced, not used: no result of qinit comes from here.
"""

from __future__ import annotations

import math

import numba
import numpy as np


@numba.njit
def _best(row, rng):
    """An action of the largest value, drawn among equals."""
    largest = row[0]
    for action in range(1, len(row)):
        if row[action] > largest:
            largest = row[action]
    ties = 0
    for action in range(len(row)):
        if row[action] == largest:
            ties += 1
    pick = rng.integers(0, ties) if ties > 1 else 0
    for action in range(len(row)):
        if row[action] == largest:
            if pick == 0:
                return action
            pick -= 1
    return 0


@numba.njit
def gridworld(rng, q, size, goal, p, anywhere, alpha, gamma, epsilon, episodes, horizon):
    """Steps taken; q (S, 4), actions up, down, left, right. Episodes start anywhere, or in cell 0."""
    steps = 0
    for _ in range(episodes):
        cell = 0
        if anywhere:
            cell = rng.integers(0, size * size)
            while cell == goal:
                cell = rng.integers(0, size * size)
        for _ in range(horizon):
            action = rng.integers(0, 4) if rng.random() < epsilon else _best(q[cell], rng)
            move = action
            if rng.random() >= p:
                move = (action + rng.integers(1, 4)) % 4
            row, column = cell // size, cell % size
            if move == 0:
                row = max(row - 1, 0)
            elif move == 1:
                row = min(row + 1, size - 1)
            elif move == 2:
                column = max(column - 1, 0)
            else:
                column = min(column + 1, size - 1)
            after = row * size + column
            target = 1.0 if after == goal else gamma * np.max(q[after])
            q[cell, action] += alpha * (target - q[cell, action])
            cell = after
            steps += 1
            if cell == goal:
                break
    return steps


@numba.njit
def mountain_car(rng, q, bins, eta, hill, anywhere, alpha, gamma, epsilon, episodes, horizon):
    """Steps taken; q (bins * bins, 3). Episodes start anywhere left of the flag, or at rest at x = -0.5."""
    steps = 0
    for _ in range(episodes):
        position, velocity = -0.5, 0.0
        if anywhere:
            position, velocity = rng.uniform(-1.2, 0.5), rng.uniform(-0.07, 0.07)
        state = _bin(position, velocity, bins)
        for _ in range(horizon):
            action = rng.integers(0, 3) if rng.random() < epsilon else _best(q[state], rng)
            push = eta if position >= hill else 0.0
            velocity += (action - 1) * 0.001 - 0.0025 * math.cos(3 * position)
            velocity = min(max(velocity, -0.07), 0.07)
            position = min(max(position + velocity + push, -1.2), 0.6)
            if position == -1.2 and velocity < 0:
                velocity = 0.0
            after = _bin(position, velocity, bins)
            done = position >= 0.5 and velocity >= 0
            target = 1.0 if done else gamma * np.max(q[after])
            q[state, action] += alpha * (target - q[state, action])
            state = after
            steps += 1
            if done:
                break
    return steps


@numba.njit
def _bin(position, velocity, bins):
    row = min(int((position + 1.2) * bins / 1.8), bins - 1)
    column = min(int((velocity + 0.07) * bins / 0.14), bins - 1)
    return row * bins + column
