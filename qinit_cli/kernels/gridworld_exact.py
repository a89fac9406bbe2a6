"""Exact tables of the gridworld: value iteration, the value of acting epsilon-greedily on them, and path lengths.

Cells are numbered row * size + column, actions up, down, left, right. The agent goes where it meant to with probability p and
each other way with (1 - p)/3; a wall keeps it in place. U(s') = 1 at the goal, else gamma * V(s'), is what entering s' is worth.
"""

from __future__ import annotations

import numpy as np

from qinit_cli.kernels.compiled import compiled

ROUNDING = 2.0**-52  # V is at most 1: changes below this are rounding, whatever tolerance was asked
# V is 1e-13 in the far corner of a 300 x 300 grid (gamma 0.95), and its logarithm is fitted
RELATIVE = 1e-10  # change in a sweep, of every cell's own value


@compiled
def neighbours(size):  # type: ignore[no-untyped-def]
    """The cell that each move leads to, (S, 4); itself at a wall."""
    cells = np.empty((size * size, 4), np.int64)
    for row in range(size):
        for column in range(size):
            cell = row * size + column
            cells[cell, 0] = cell - size if row > 0 else cell
            cells[cell, 1] = cell + size if row < size - 1 else cell
            cells[cell, 2] = cell - 1 if column > 0 else cell
            cells[cell, 3] = cell + 1 if column < size - 1 else cell
    return cells


@compiled
def _outward(size, goal, order):  # type: ignore[no-untyped-def]
    """Writes into `order` every cell but the goal, nearest (Manhattan) first: values spread from the goal in one sweep."""
    row, column = goal // size, goal % size
    count = 0
    for distance in range(1, 2 * size - 1):
        for down in range(-distance, distance + 1):
            r = row + down
            if r < 0 or r >= size:
                continue
            across = distance - abs(down)
            if column - across >= 0:
                order[count] = r * size + column - across
                count += 1
            if across > 0 and column + across < size:
                order[count] = r * size + column + across
                count += 1


@compiled
def _sweep_limit(tolerance, gamma):  # type: ignore[no-untyped-def]
    """The largest change in a sweep at which V is within `tolerance` of its fixed point."""
    return max(tolerance * (1.0 - gamma) / gamma, ROUNDING)


@compiled
def solve(goal, p, size, gamma, tolerance, q, td_var):  # type: ignore[no-untyped-def]
    """Writes Q* into `q` and the variance of a step's target under it into `td_var`, both (B, S, 4).

    Gauss-Seidel value iteration, swept outward from the goal. td_var is E[(r + gamma max Q(s') - Q(s, a))^2] in closed form,
    since Q*(s, a) is that target's mean. The goal's rows are 0. goal i8 (B,), p f8 (B,); tolerance on V. However small V is,
    sweeps go on until it changes by less than RELATIVE of itself.
    """
    cells = size * size
    moves = neighbours(size)
    order = np.empty(cells - 1, np.int64)
    entering = np.empty(cells)
    limit = _sweep_limit(tolerance, gamma)
    for task in range(len(goal)):
        slip = (1.0 - p[task]) / 3.0
        kept = p[task] - slip
        _outward(size, goal[task], order)
        entering[:] = 0.0
        entering[goal[task]] = 1.0
        settled = False
        while not settled:
            settled = True
            for cell in order:
                up, down = entering[moves[cell, 0]], entering[moves[cell, 1]]
                left, right = entering[moves[cell, 2]], entering[moves[cell, 3]]
                best = max(max(up, down), max(left, right))
                value = gamma * (kept * best + slip * (up + down + left + right))
                settled &= abs(value - entering[cell]) <= min(limit, RELATIVE * value)
                entering[cell] = value
        for cell in range(cells):
            for action in range(4):
                q[task, cell, action] = 0.0
                td_var[task, cell, action] = 0.0
            if cell == goal[task]:
                continue
            total = 0.0
            for direction in range(4):
                total += entering[moves[cell, direction]]
            for action in range(4):
                q[task, cell, action] = kept * entering[moves[cell, action]] + slip * total
            for action in range(4):
                squares = 0.0
                for direction in range(4):
                    weight = p[task] if direction == action else slip
                    error = entering[moves[cell, direction]] - q[task, cell, action]
                    squares += weight * error * error
                td_var[task, cell, action] = squares


@compiled
def exploring_value(goal, p, size, gamma, epsilon, tolerance, q, value):  # type: ignore[no-untyped-def]
    """Writes into `value` (B, S) what acting epsilon-greedily on `q` (B, S, 4) is worth from each cell, ties shared equally."""
    cells = size * size
    moves = neighbours(size)
    probability = np.empty((cells, 4))
    order = np.empty(cells - 1, np.int64)
    entering = np.empty(cells)
    limit = _sweep_limit(tolerance, gamma)
    for task in range(len(goal)):
        slip = (1.0 - p[task]) / 3.0
        kept = p[task] - slip
        _outward(size, goal[task], order)
        for cell in range(cells):
            best = q[task, cell].max()
            ties = (q[task, cell] == best).sum()
            for action in range(4):
                probability[cell, action] = epsilon / 4 + (1.0 - epsilon) / ties * (
                    q[task, cell, action] == best
                )
        entering[:] = 0.0
        entering[goal[task]] = 1.0
        change = 1.0
        while change > limit:
            change = 0.0
            for cell in order:
                intended = total = 0.0
                for action in range(4):
                    there = entering[moves[cell, action]]
                    intended += probability[cell, action] * there
                    total += there
                worth = gamma * (kept * intended + slip * total)
                change = max(change, abs(worth - entering[cell]))
                entering[cell] = worth
        for cell in range(cells):
            value[task, cell] = entering[cell] / gamma
        value[task, goal[task]] = 0.0


@compiled
def _likeliest(moves, action, p):  # type: ignore[no-untyped-def]
    """The most likely next cell given a cell's moves (4,); among equally likely ones the intended, else the lowest index."""
    slip = (1.0 - p) / 3.0
    best, best_chance = moves[action], -1.0
    for candidate in range(-1, 4):  # the intended move first
        there = moves[action] if candidate < 0 else moves[candidate]
        probability = 0.0
        for direction in range(4):
            if moves[direction] == there:
                probability += p if direction == action else slip
        # the same slips added in another order differ by an ulp: that is a tie
        tied = abs(probability - best_chance) <= 1e-12
        if (tied and best != moves[action] and there < best) or (not tied and probability > best_chance):
            best, best_chance = there, probability
    return best


@compiled
def path_lengths(goal, p, size, q, eopl):  # type: ignore[no-untyped-def]
    """Writes into `eopl` i4 (B, S, 4) the expected optimal path lengths; definition 1.

    H(s, a) = 1 + H(s', pi(s')), s' the likeliest next cell, pi greedy in the task's own `q` (first of equals). 0 at the goal,
    -1 where the path from s' never arrives. Loops are sought only in s -> T(s, pi(s)): a first step into a wall is no loop.
    """
    cells = size * size
    moves = neighbours(size)
    after = np.empty(cells, np.int64)
    steps = np.empty(cells, np.int64)
    trail = np.empty(cells, np.int64)
    unknown, walking = -3, -2
    for task in range(len(goal)):
        for cell in range(cells):
            after[cell] = _likeliest(moves[cell], np.argmax(q[task, cell]), p[task])
            steps[cell] = unknown
        steps[goal[task]] = 0
        for origin in range(cells):
            cell, count = origin, 0
            while steps[cell] == unknown:
                steps[cell] = walking
                trail[count] = cell
                count += 1
                cell = after[cell]
            length = -1 if steps[cell] == walking else steps[cell]
            for back in range(count - 1, -1, -1):
                length = length + 1 if length >= 0 else -1
                steps[trail[back]] = length
        for cell in range(cells):
            for action in range(4):
                if cell == goal[task]:
                    eopl[task, cell, action] = 0
                    continue
                rest = steps[_likeliest(moves[cell], action, p[task])]
                eopl[task, cell, action] = rest + 1 if rest >= 0 else -1


@compiled
def greedy_visits(goal, p, size, q, horizon, start, visits):  # type: ignore[no-untyped-def]
    """Writes into `visits` i4 (B, S) the cells of each task's likeliest path from `start`, greedy in its own `q`: 1 on it.

    Its first cell and the goal included; zeros where it does not arrive within the horizon.
    """
    moves = neighbours(size)
    for task in range(len(goal)):
        visits[task, :] = 0
        cell, left = start, horizon
        visits[task, cell] = 1
        while cell != goal[task] and left > 0:
            cell = _likeliest(moves[cell], np.argmax(q[task, cell]), p[task])
            visits[task, cell] += 1
            left -= 1
        if cell != goal[task]:
            visits[task, :] = 0
