# mypy: allow-untyped-defs, allow-untyped-calls
"""Explorations, compiled: which action a step takes, given its draw and the values of its state."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from qinit_cli.kernels.choices import ACTIONS
from qinit_cli.kernels.compiled import inlined, inner
from qinit_cli.kernels.lane import WideMemory, largest, picked, width_of
from qinit_cli.kernels.parts import body, part
from qinit_cli.kernels.policies import followed, follows, policy_action
from qinit_cli.kernels.random_streams import LOW_12, LOW_20, TWELVE, exploration_limit
from qinit_cli.kernels.vectors import WIDTH
from qinit_cli.schedules import Schedule

if TYPE_CHECKING:
    from qinit_cli.kernels.learner import Batch
    from qinit_cli.learning import Learning

LOW_32 = np.uint64((1 << 32) - 1)
_NONE, _ONE = np.uint64(0), np.uint64(1)


class Decided(NamedTuple):
    """A constant epsilon: whether a step explores is decided before it."""

    limit: np.uint64  # steps whose 20 bits of a draw are below explore


class EpsilonByEpisode(NamedTuple):
    """An epsilon for each episode."""

    limits: Any  # u8 (E,)


class Softmax(NamedTuple):
    """Actions in proportion to exp(Q / temperature)."""

    inverse: float  # of the temperature
    weights: Any  # f8 (L, A) of the step


class Bounds(NamedTuple):
    """Actions by their upper confidence bounds (Auer et al., 2002)."""

    c: float
    visits: Any  # i8 (L, (S + 2) * W)
    bounds: Any  # f8 (L, A) of the step


def new_epsilon_greedy(learning: Learning) -> Decided | EpsilonByEpisode:
    """Epsilon-greedy as the loop reads it."""
    if isinstance(learning.epsilon, Schedule):
        values = learning.epsilon.values(learning.episodes)
        return EpsilonByEpisode(np.array([exploration_limit(value) for value in values], np.uint64))
    return Decided(exploration_limit(learning.epsilon))


def new_softmax(batch: Batch, temperature: float) -> Softmax:
    """Boltzmann's exploration as the loop reads it."""
    return Softmax(1.0 / temperature, np.zeros((batch.lanes, batch.actions)))


def new_bounds(batch: Batch, c: float) -> Bounds:
    """UCB as the loop reads it."""
    return Bounds(float(c), np.zeros(batch.pairs, np.int64), np.zeros((batch.lanes, batch.actions)))


@part
def decided_limit(explore):
    """Steps whose 20 bits of a draw are below this explore, where that is decided before the step."""
    return explore.limit


@body(decided_limit, EpsilonByEpisode, Softmax, Bounds)
def _nothing_decided(explore):
    return _NONE


@part
def limit_of(explore, episode):
    """Steps of an episode whose 20 bits of a draw are below this explore, epsilon-greedily."""
    return explore.limit


@body(limit_of, EpsilonByEpisode)
def _limit_of_episode(explore, episode):
    return explore.limits[min(episode, len(explore.limits) - 1)]  # after the last one nothing counts


@part
def choose(memory, explore, step, lane, state, episode, choosing):
    """What a lane's step does: its choice, see choices.py, and the action that follows from it."""
    choice, tied = bits(explore, memory, step, lane, state, episode)
    choice = choice | tied if choosing is None else followed(memory, choosing, lane, choice, tied, state)
    return choice, ACTIONS[choice]


@body(choose, WideMemory)
def choose_wide(memory, explore, step, lane, state, episode, choosing):
    action, explores = pick(explore, memory, lane, state, episode, memory.draws[step])
    if choosing is not None:
        follows_policy = follows(choosing, lane)
        if follows_policy and not (explores and choosing.explore_while_following):
            action = policy_action(memory, choosing, lane, state)
    return _NONE, action


@part
def bits(explore, memory, step, lane, state, episode):
    """The step's choice without the greedy actions, and the bits of those that it chooses among."""
    return np.uint64(memory.choices[step]), np.uint64(memory.ties[state])


@body(bits, EpsilonByEpisode)
def _bits_scheduled(explore, memory, step, lane, state, episode):
    explores = _explores(memory.draws[step], explore, episode)
    all_actions = (_ONE << np.uint64(memory.actions)) - _ONE if explores else _NONE
    return np.uint64(memory.choices[step]) | all_actions, np.uint64(memory.ties[state])


@body(bits, Softmax, Bounds)
def _bits_picked(explore, memory, step, lane, state, episode):
    action, _ = pick(explore, memory, lane, state, episode, memory.draws[step])
    return np.uint64(memory.choices[step]), _ONE << np.uint64(action)


@part
def pick(explore, memory, lane, state, episode, drawn):
    """The action of a step, and whether it explores."""
    explores = _explores(drawn, explore, episode)
    return picked(memory, state, drawn, explores), explores


@body(pick, Softmax)
def _pick_softmax(explore, memory, lane, state, episode, drawn):
    weights = explore.weights[lane]
    whole = _weigh_actions(explore, memory, weights, state)
    mark = np.float64(drawn & LOW_32) * 2.0**-32 * whole
    running, action = 0.0, 0
    for each in range(memory.actions - 1):  # no branch that a processor could guess wrong
        running += weights[each]
        action += running <= mark
    return action, False


@body(pick, Bounds)
def _pick_bounds(explore, memory, lane, state, episode, drawn):
    bounds = explore.bounds[lane]
    best, tied = _bound_actions(explore, memory, bounds, lane, state)
    place = np.int64(((drawn & LOW_12) * np.uint64(tied)) >> TWELVE)
    action = 0
    for each in range(memory.actions):
        may = bounds[each] == best
        action = each if may and place == 0 else action
        place -= may
    return action, False


@part
def expectation(explore, memory, lane, state, episode):
    """The mean of a state's values under the exploration."""
    row, summed = (width_of(memory) + WIDTH) * np.int64(state), 0.0
    best, epsilon = memory.rows[row], np.float64(limit_of(explore, episode)) * 2.0**-20
    for action in range(memory.actions):  # one loop for both: two are a tenth slower
        summed += memory.rows[row + action]
        best = max(best, memory.rows[row + action])
    return epsilon * (summed / memory.actions) + (1.0 - epsilon) * best


@body(expectation, Softmax)
def _expectation_softmax(explore, memory, lane, state, episode):
    weights, row, above = explore.weights[lane], (width_of(memory) + WIDTH) * np.int64(state), 0.0
    whole = _weigh_actions(explore, memory, weights, state)
    for action in range(memory.actions):
        above += weights[action] * memory.rows[row + action]
    return above / whole


@body(expectation, Bounds)
def _expectation_bounds(explore, memory, lane, state, episode):
    bounds, row, above = explore.bounds[lane], (width_of(memory) + WIDTH) * np.int64(state), 0.0
    best, tied = _bound_actions(explore, memory, bounds, lane, state)
    for action in range(memory.actions):
        if bounds[action] == best:
            above += memory.rows[row + action]
    return above / tied


@part
def count_step(explore, memory, lane, state, action):
    """Notes that a step takes the action."""


@body(count_step, Bounds)
def _count_step_bounds(explore, memory, lane, state, action):
    explore.visits[lane, width_of(memory) * np.int64(state) + np.int64(action)] += 1


@inlined
def _explores(drawn, explore, episode):
    return ((drawn >> TWELVE) & LOW_20) < limit_of(explore, episode)


@inner
def _weigh_actions(explore, memory, weights, state):
    """Writes exp((Q - max Q) / temperature) of each action into `weights`; their sum."""
    row, whole = (width_of(memory) + WIDTH) * np.int64(state), 0.0
    best = largest(memory, row)
    for action in range(memory.actions):
        weights[action] = math.exp((memory.rows[row + action] - best) * explore.inverse)
        whole += weights[action]
    return whole


@inner
def _bound_actions(explore, memory, bounds, lane, state):
    """Writes each action's bound into `bounds`, infinity where it was not taken; the largest, and how many have it."""
    row, first = (width_of(memory) + WIDTH) * np.int64(state), width_of(memory) * np.int64(state)
    visits, whole, best, tied = explore.visits[lane], 0, -np.inf, 0
    for action in range(memory.actions):
        whole += visits[first + action]
    width = math.log(max(whole, 1))
    for action in range(memory.actions):
        count = visits[first + action]
        bound = memory.rows[row + action] + explore.c * math.sqrt(width / count) if count > 0 else np.inf
        bounds[action] = bound
        best = max(best, bound)
    for action in range(memory.actions):
        tied += bounds[action] == best
    return best, tied
