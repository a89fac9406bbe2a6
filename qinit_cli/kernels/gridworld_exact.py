"""Exact tables of the gridworld: value iteration, the value of acting epsilon-greedily on them, and path lengths.

Cells are numbered row * columns + column, actions up, down, left, right. The agent goes where it meant to with probability p and
each other way with (1 - p)/3; a wall keeps it in place. U(s') = 1 at a goal, 0 in a hole, else gamma * V(s'), is what entering s'
is worth. Arguments of all: moves i4 (S, 4) the cell that each action leads to, itself at a wall and S + 1 into a hole; goals
i8 (B, K); p f8 (B, S), or (B, 1) where it is the same in all cells.
"""

from __future__ import annotations

import numpy as np

from qinit_cli.kernels.compiled import compiled

ROUNDING = 2.0**-52  # V is at most 1: changes below this are rounding, whatever tolerance was asked
# V is 1e-13 in the far corner of a 300 x 300 grid (gamma 0.95), and its logarithm is fitted
RELATIVE = 1e-10  # change in a sweep, of every cell's own value


@compiled
def _spread(moves, goals, distance, queue):  # type: ignore[no-untyped-def]
    """Writes into `distance` (S,) the steps of the shortest way from each cell to the nearest goal, -1 where there is none.

    Every move leads back as well, but into a hole, so the ways are followed from the goals; `queue` (S,) is working memory.
    """
    distance[:] = -1
    count = 0
    for goal in goals:
        distance[goal] = 0
        queue[count] = goal
        count += 1
    taken = 0
    while taken < count:
        cell = queue[taken]
        taken += 1
        for action in range(4):
            there = moves[cell, action]
            if there < len(moves) and distance[there] < 0:
                distance[there] = distance[cell] + 1
                queue[count] = there
                count += 1
    return count


@compiled
def _outward(moves, goals, distance, queue, order):  # type: ignore[no-untyped-def]
    """Writes into `order` the cells with a way to a goal, nearest first, and returns how many: values spread in one sweep.

    Goals are left out; cells of one distance stand in ascending order.
    """
    count = _spread(moves, goals, distance, queue)
    first = np.zeros(len(moves) + 1, np.int64)  # where the cells of each distance begin
    for cell in queue[len(goals) : count]:
        first[distance[cell] + 1] += 1
    for steps in range(1, len(first)):
        first[steps] += first[steps - 1]
    for cell in range(len(moves)):
        if distance[cell] > 0:
            order[first[distance[cell]]] = cell
            first[distance[cell]] += 1
    return count - len(goals)


@compiled
def distances(moves, goals, distance):  # type: ignore[no-untyped-def]
    """Writes into `distance` i8 (B, S) the steps of the shortest way to the nearest goal, -1 where there is none."""
    queue = np.empty(len(moves), np.int64)
    for task in range(len(goals)):
        _spread(moves, goals[task], distance[task], queue)


@compiled
def _parted(p, cells):  # type: ignore[no-untyped-def]
    """The probability of the intended way in each cell, that of each other, and by how much the first is larger, (S,) each."""
    intended = np.empty(cells)
    for cell in range(cells):
        intended[cell] = p[cell % len(p)]
    slip = (1.0 - intended) / 3.0
    return intended, slip, intended - slip


@compiled
def _sweep_limit(tolerance, gamma):  # type: ignore[no-untyped-def]
    """The largest change in a sweep at which V is within `tolerance` of its fixed point."""
    return max(tolerance * (1.0 - gamma) / gamma, ROUNDING)


@compiled
def solve(moves, goals, p, gamma, tolerance, q, td_var):  # type: ignore[no-untyped-def]
    """Writes Q* into `q` and the variance of a step's target under it into `td_var`, both (B, S, 4).

    Gauss-Seidel value iteration, swept outward from the goals. td_var is E[(r + gamma max Q(s') - Q(s, a))^2] in closed form,
    since Q*(s, a) is that target's mean. The rows of goals, walls and holes are 0. tolerance on V. However small V is,
    sweeps go on until it changes by less than RELATIVE of itself.
    """
    cells = len(moves)
    order, queue, distance = np.empty(cells, np.int64), np.empty(cells, np.int64), np.empty(cells, np.int64)
    entering = np.empty(cells + 2)
    ways = moves.ravel()
    limit = _sweep_limit(tolerance, gamma)
    for task in range(len(goals)):
        intended, slip, kept = _parted(p[task], cells)
        count = _outward(moves, goals[task], distance, queue, order)
        entering[:] = 0.0
        for goal in goals[task]:
            entering[goal] = 1.0
        settled = False
        while not settled:
            settled = True
            for cell in order[:count]:
                way = 4 * cell
                up, down = entering[ways[way]], entering[ways[way + 1]]
                left, right = entering[ways[way + 2]], entering[ways[way + 3]]
                best = max(max(up, down), max(left, right))
                value = gamma * (kept[cell] * best + slip[cell] * (up + down + left + right))
                settled &= abs(value - entering[cell]) <= min(limit, RELATIVE * value)
                entering[cell] = value
        for cell in range(cells):
            for action in range(4):
                q[task, cell, action] = 0.0
                td_var[task, cell, action] = 0.0
            if distance[cell] <= 0:
                continue
            total = 0.0
            for direction in range(4):
                total += entering[moves[cell, direction]]
            for action in range(4):
                q[task, cell, action] = kept[cell] * entering[moves[cell, action]] + slip[cell] * total
            for action in range(4):
                squares = 0.0
                for direction in range(4):
                    weight = intended[cell] if direction == action else slip[cell]
                    error = entering[moves[cell, direction]] - q[task, cell, action]
                    squares += weight * error * error
                td_var[task, cell, action] = squares


@compiled
def exploring_value(moves, goals, p, gamma, epsilon, tolerance, q, value):  # type: ignore[no-untyped-def]
    """Writes into `value` (B, S) what acting epsilon-greedily on `q` (B, S, 4) is worth from each cell, ties shared equally."""
    cells = len(moves)
    probability = np.empty((cells, 4))
    order, queue, distance = np.empty(cells, np.int64), np.empty(cells, np.int64), np.empty(cells, np.int64)
    entering = np.empty(cells + 2)
    limit = _sweep_limit(tolerance, gamma)
    for task in range(len(goals)):
        _, slip, kept = _parted(p[task], cells)
        count = _outward(moves, goals[task], distance, queue, order)
        for cell in range(cells):
            best = q[task, cell].max()
            ties = (q[task, cell] == best).sum()
            for action in range(4):
                probability[cell, action] = epsilon / 4 + (1.0 - epsilon) / ties * (
                    q[task, cell, action] == best
                )
        entering[:] = 0.0
        for goal in goals[task]:
            entering[goal] = 1.0
        change = 1.0
        while change > limit:
            change = 0.0
            for cell in order[:count]:
                intended = total = 0.0
                for action in range(4):
                    there = entering[moves[cell, action]]
                    intended += probability[cell, action] * there
                    total += there
                worth = gamma * (kept[cell] * intended + slip[cell] * total)
                change = max(change, abs(worth - entering[cell]))
                entering[cell] = worth
        for cell in range(cells):
            value[task, cell] = entering[cell] / gamma
        for goal in goals[task]:
            value[task, goal] = 0.0


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
def path_lengths(moves, goals, p, q, eopl):  # type: ignore[no-untyped-def]
    """Writes into `eopl` i4 (B, S, 4) the expected optimal path lengths; definition 1.

    H(s, a) = 1 + H(s', pi(s')), s' the likeliest next cell, pi greedy in the task's own `q` (first of equals). 0 at a goal,
    -1 where the path from s' never arrives. Loops are sought only in s -> T(s, pi(s)): a first step into a wall is no loop.
    """
    cells = len(moves)
    after = np.empty(cells, np.int64)
    steps = np.empty(cells + 2, np.int64)
    trail = np.empty(cells, np.int64)
    unknown, walking = -3, -2
    for task in range(len(goals)):
        for cell in range(cells):
            own = p[task, cell % p.shape[1]]
            after[cell] = _likeliest(moves[cell], np.argmax(q[task, cell]), own)
            steps[cell] = unknown
        steps[cells + 1] = -1  # lost
        for goal in goals[task]:
            steps[goal] = 0
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
                rest = steps[_likeliest(moves[cell], action, p[task, cell % p.shape[1]])]
                eopl[task, cell, action] = rest + 1 if rest >= 0 else -1
        for goal in goals[task]:
            for action in range(4):
                eopl[task, goal, action] = 0


@compiled
def greedy_visits(moves, goals, p, q, horizon, start, visits):  # type: ignore[no-untyped-def]
    """Writes into `visits` i4 (B, S) the cells of each task's likeliest path from `start`, greedy in its own `q`: 1 on it.

    Its first cell and the goal included; zeros where it does not arrive within the horizon.
    """
    for task in range(len(goals)):
        visits[task, :] = 0
        cell, left = start, horizon
        visits[task, cell] = 1
        arrived = (goals[task] == cell).any()
        while not arrived and left > 0:
            cell = _likeliest(moves[cell], np.argmax(q[task, cell]), p[task, cell % p.shape[1]])
            if cell >= len(moves):
                break
            visits[task, cell] += 1
            arrived = (goals[task] == cell).any()
            left -= 1
        if not arrived:
            visits[task, :] = 0
