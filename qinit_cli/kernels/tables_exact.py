# mypy: allow-untyped-defs, allow-untyped-calls, disable-error-code="assignment"
"""Exact tables of tasks that are given by their transitions: value iteration, the value of exploring on it, and paths.

Entering the goal is worth 1, being lost 0, any other state gamma * V. Where steps have gains f8 (B, S, A, O), these are added,
and the goal is worth 0. Arrays as in kernels.tables: after i4 (B, S, A, O) with GOAL and LOST, probability f8 (B, S, A, O), open
b1 (B, S): the rows of states that are not open are 0, as nobody acts there.
"""

from __future__ import annotations

import numpy as np

from qinit_cli.kernels.compiled import compiled, inlined
from qinit_cli.kernels.worlds import GOAL

ROUNDING = 2.0**-52  # V is at most 1: changes below this are rounding, whatever tolerance was asked
CANCELLED = 16 * ROUNDING
RELATIVE = 1e-10  # change in a sweep, of every state's own value: logarithms of small values are fitted
NEVER = -1


@inlined
def _worth(entering, after, gains, place, outcome):
    """What an outcome of the state-action at `place` is worth, which leads to the state `after`."""
    if gains is not None:
        gain = gains[place][outcome]
        return gain + entering[after] if after >= 0 else gain
    if after >= 0:
        return entering[after]
    return 1.0 if after == GOAL else 0.0


@inlined
def _value(entering, after, probability, gains, place):
    """The mean of what the outcomes of the state-action at `place` are worth."""
    mean, there, odds = 0.0, after[place], probability[place]
    for outcome in range(len(there)):
        mean += odds[outcome] * _worth(entering, there[outcome], gains, place, outcome)
    return mean


@inlined
def _limit(tolerance, gamma):
    """The largest change in a sweep at which V is within `tolerance` of its fixed point."""
    return max(tolerance * (1.0 - gamma) / gamma, ROUNDING)


@inlined
def _allowed(tolerance, gamma, value, gains):
    """The largest change of a state's value at which it is settled."""
    if gains is None:
        return min(_limit(tolerance, gamma), RELATIVE * value)
    return max(_limit(tolerance, gamma), CANCELLED)  # a small sum keeps the rounding of gains of either sign


@compiled
def solve(after, probability, open, gains, gamma, tolerance, q, td_var):
    """Writes Q* into `q` and the variance of a step's target under it into `td_var`, both (B, S, A).

    Gauss-Seidel value iteration, sweeping up and down in turns; it ends once V changes by no more than tolerance and RELATIVE.
    """
    states, actions, outcomes = after.shape[1:]
    entering = np.empty(states)
    for task in range(len(after)):
        entering[:] = 0.0
        settled, upwards = False, False
        while not settled:
            settled, upwards = True, not upwards
            for place in range(states):
                state = place if upwards else states - 1 - place
                if open[task, state]:
                    best = 0.0 if gains is None else -np.inf
                    for action in range(actions):
                        pair = (task, state, action)
                        best = max(best, _value(entering, after, probability, gains, pair))
                    value = gamma * best
                    allowed = _allowed(tolerance, gamma, value, gains)
                    settled &= abs(value - entering[state]) <= allowed
                    entering[state] = value
        for state in range(states):
            for action in range(actions):
                q[task, state, action] = td_var[task, state, action] = 0.0
                if open[task, state]:
                    pair, there = (task, state, action), after[task, state, action]
                    mean = _value(entering, after, probability, gains, pair)
                    squares = 0.0
                    for outcome in range(outcomes):
                        error = _worth(entering, there[outcome], gains, pair, outcome) - mean
                        squares += probability[task, state, action, outcome] * error * error
                    q[task, state, action], td_var[task, state, action] = mean, squares


@compiled
def exploring_value(after, probability, open, gains, gamma, epsilon, tolerance, q, value):
    """Writes into `value` (B, S) what acting epsilon-greedily on `q` (B, S, A) is worth from each state, ties shared equally."""
    states, actions = after.shape[1], after.shape[2]
    share = np.empty((states, actions))
    entering = np.empty(states)
    for task in range(len(after)):
        for state in range(states):
            best = q[task, state].max()
            ties = (q[task, state] == best).sum()
            for action in range(actions):
                greedy = (1.0 - epsilon) / ties * (q[task, state, action] == best)
                share[state, action] = epsilon / actions + greedy
        entering[:] = 0.0
        change, upwards = 1.0, False
        while change > _limit(tolerance, gamma):
            change, upwards = 0.0, not upwards
            for place in range(states):
                state = place if upwards else states - 1 - place
                if open[task, state]:
                    mean = 0.0
                    for action in range(actions):
                        pair = (task, state, action)
                        mean += share[state, action] * _value(entering, after, probability, gains, pair)
                    change = max(change, abs(gamma * mean - entering[state]))
                    entering[state] = gamma * mean
        for state in range(states):
            value[task, state] = entering[state] / gamma


@inlined
def _likeliest(after, probability):
    """The most likely of the outcomes (O,); of equally likely ones the goal, else the lowest state, being lost last."""
    best, best_chance = after[0], -1.0
    for outcome in range(len(after)):
        there, odds = after[outcome], 0.0
        for other in range(len(after)):
            odds += probability[other] * (after[other] == there)
        # the same probabilities added in another order differ by an ulp: that is a tie
        tied = abs(odds - best_chance) <= 1e-12
        lower = there == GOAL or (best != GOAL and np.uint32(there) < np.uint32(best))  # LOST is the largest
        if (tied and lower) or (not tied and odds > best_chance):
            best, best_chance = there, odds
    return best


@compiled
def path_lengths(after, probability, open, q, eopl):
    """Writes into `eopl` i4 (B, S, A) the expected optimal path lengths; definition 1 of the paper.

    H(s, a) = 1 + H(s', pi(s')), s' the likeliest next state, pi greedy in the task's own `q` (first of equals). -1 where the
    path never arrives, as it comes back to where it was or is lost, and where nobody acts.
    """
    states, actions = after.shape[1], after.shape[2]
    following = np.empty(states, np.int64)
    steps = np.empty(states, np.int64)
    trail = np.empty(states, np.int64)
    unknown, walking = -3, -2
    for task in range(len(after)):
        for state in range(states):
            greedy = np.argmax(q[task, state])
            following[state] = _likeliest(after[task, state, greedy], probability[task, state, greedy])
            steps[state] = unknown if open[task, state] else NEVER
        for origin in range(states):
            state, count = np.int64(origin), 0
            while state >= 0 and steps[state] == unknown:
                steps[state] = walking
                trail[count] = state
                count += 1
                state = following[state]
            length = NEVER
            if state == GOAL:
                length = 0
            elif state >= 0 and steps[state] >= 0:
                length = steps[state]
            for back in range(count - 1, -1, -1):
                length = length + 1 if length >= 0 else NEVER
                steps[trail[back]] = length
        for state in range(states):
            for action in range(actions):
                if not open[task, state]:
                    eopl[task, state, action] = NEVER
                    continue
                there = np.int64(_likeliest(after[task, state, action], probability[task, state, action]))
                rest = steps[there] if there >= 0 else (0 if there == GOAL else NEVER)
                eopl[task, state, action] = rest + 1 if rest >= 0 else NEVER


@compiled
def greedy_visits(after, probability, start, q, horizon, visits):
    """Writes into `visits` i4 (B, S) the states on the way of likeliest steps, greedy in `q`, from the likeliest start (B, S).

    Zeros where that way does not reach the goal within the horizon.
    """
    for task in range(len(after)):
        visits[task] = 0
        state = np.argmax(start[task])
        for _ in range(horizon):
            visits[task, state] += 1
            action = np.argmax(q[task, state])
            state = np.int64(_likeliest(after[task, state, action], probability[task, state, action]))
            if state < 0:
                break
        if state != GOAL:
            visits[task] = 0


@compiled
def arrival(after, probability, start, q, horizon, share):
    """Writes into `share` (B,) the probability that greedy episodes from `start` (B, S) reach the goal within the horizon."""
    states, outcomes = after.shape[1], after.shape[3]
    there, then = np.empty(states), np.empty(states)
    for task in range(len(after)):
        share[task] = 0.0
        there[:] = start[task]
        for _ in range(horizon):
            then[:] = 0.0
            on_the_way = 0.0
            for state in range(states):
                if there[state] > 0.0:
                    action = np.argmax(q[task, state])
                    for outcome in range(outcomes):
                        after_it = after[task, state, action, outcome]
                        flow = there[state] * probability[task, state, action, outcome]
                        if after_it >= 0:
                            then[after_it] += flow
                            on_the_way += flow
                        elif after_it == GOAL:
                            share[task] += flow
            there[:] = then
            if on_the_way < ROUNDING:
                break


@compiled
def distances(after, probability, start, steps):
    """Writes into `steps` i8 (B,) the fewest steps that could lead from a start (B, S) to the goal; NEVER if there is no way."""
    states, actions, outcomes = after.shape[1:]
    queue = np.empty(states, np.int64)
    far = np.empty(states, np.int64)
    for task in range(len(after)):
        count = 0
        for state in range(states):
            far[state] = 0 if start[task, state] > 0.0 else NEVER
            if far[state] == 0:
                queue[count] = state
                count += 1
        steps[task], place = NEVER, 0
        while place < count and steps[task] == NEVER:
            state = queue[place]
            place += 1
            for action in range(actions):
                for outcome in range(outcomes):
                    there = after[task, state, action, outcome]
                    if probability[task, state, action, outcome] > 0.0:
                        if there == GOAL and steps[task] == NEVER:
                            steps[task] = far[state] + 1
                        elif there >= 0 and far[there] == NEVER:
                            far[there] = far[state] + 1
                            queue[count] = there
                            count += 1
