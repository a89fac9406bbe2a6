# mypy: allow-untyped-defs, allow-untyped-calls
"""Weighing tables of solved tasks by a target's own steps, while it is learned.

Table i is a hypothesis about the target. A step's TD error under it, d = r + gamma max Q_i(s', .) - Q_i(s, a), has a known
scale where the hypothesis is true, so ln w_i falls by temperature * min(cap, (d^2 - c td_var_i(s, a)) / (td_var_i(s, a) +
floor^2) - excess): c is 1 for centred evidence, whose mean is 0 where the hypothesis is true, else 0, and then it is at least 0.
The start M is the mean of the tables under the weights. When these have moved by more than `threshold` since M was last made,
M becomes M' and Q(s, a) changes by (1 - alpha)^n (M' - M), n the updates of (s, a), or the product of their 1 - alpha_k in place
of the power: what learning with the same targets would hold had it begun at M'. That factor changes only where the agent acts,
so a state's row is brought up to date when the agent comes to it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from qinit_cli.arrays import Floats, Integers
from qinit_cli.elementary import exp, ln
from qinit_cli.kernels.compiled import inlined, inner
from qinit_cli.kernels.lane import rescan, width_of
from qinit_cli.kernels.payment import with_reward
from qinit_cli.kernels.reals import EIGHT, chosen, load_reals, store_reals, total
from qinit_cli.kernels.vectors import WIDTH
from qinit_cli.rewards import UNIT, Payment, ReturnBounds

NEVER = -1  # episode after which weights froze, where they never did
# ln of a weight below the largest: no weight becomes 0, or who alone knows a pair would know it no more
LEAST = -600.0


@dataclass(frozen=True)
class Hypotheses:
    """Tables of solved tasks, any of which the target may be like, and how its steps tell between them.

    Values are shares of the attainable return, see rewards.ReturnBounds, and `bounds` those of what the target learns.
    """

    q: Floats  # (K, S, A); a table knows a pair where it is above 0
    td_var: Floats  # (K, S, A) mean squared TD error of the table on its own task
    temperature: float
    floor: float
    excess: float
    cap: float
    freeze: int
    threshold: float
    geometric: bool
    centred: bool
    bounds: ReturnBounds = UNIT

    def mean(self) -> Floats:
        """The tables' mean under equal weights, (S, A): over those that know the pair, NaN where none does."""
        known = self.q > 0
        terms = ln(np.where(known, self.q, 1.0)) if self.geometric else self.q * known
        with np.errstate(invalid="ignore"):
            mean: Floats = terms.sum(axis=0) / known.sum(axis=0)
        return exp(mean) if self.geometric else mean


class PosteriorState(NamedTuple):
    """The hypotheses of a batch, K of them padded to eights, and what the task of each lane thinks of them."""

    tables: int  # K without the padding
    actions: int
    values: Any  # f8 (S * A, K)
    worth: Any  # f8 (S + 2, K) of entering a state: gamma max_a Q_i; the last two are the ends
    precision: Any  # f8 (S * A, K) 1 / (td_var + floor^2); 0 where the table does not know the pair
    expected: Any  # f8 (S * A, K) d^2 * precision that counts as no evidence
    terms: Any  # f8 (S * A, K) what M averages: Q_i as a share, or its logarithm, 0 where unknown
    temperature: float
    cap: float
    least: float
    freeze: int
    threshold: float
    geometric: bool
    low: float  # the least return
    width: float  # the largest less the least
    log_weight: Any  # f8 (L, K)
    weight: Any  # f8 (L, K)
    mixed: Any  # f8 (L, K) the weights that M was made with
    version: Any  # i8 (L,) of M
    current: Any  # i8 (L, S) the version that a state's row is of
    start: Any  # f8 (L, S * A) M as that row has it
    left: Any  # f8 (L, S * A) the product of 1 - alpha of the updates, the share of M in Q
    goals: Any  # i8 (L,) reached
    live: Any  # b1 (L,) the weights of the lane's task are not frozen
    next_moment: Any  # i8 (L,)
    moments: Any  # i8 (R,) episodes after which weights are recorded
    weights: Any  # f8 (B, R, K) as they were then, without the padding
    moves: Any  # i8 (B,) times that M changed
    frozen: Any  # i8 (B,) episodes after which the weights froze


def new_posterior(
    hypotheses: Hypotheses,
    gamma: float,
    payment: Payment | None,
    moments: Integers,
    batch: int,
    lanes: int,
) -> PosteriorState:
    """What the loops need to weigh the hypotheses in that many lanes."""
    count, states, actions = hypotheses.q.shape
    padded = -(-count // EIGHT) * EIGHT

    def columns(tables: Floats) -> Floats:
        across = np.zeros((tables[0].size, padded))
        across[:, :count] = tables.reshape(count, -1).T
        return across

    known, bounds = hypotheses.q > 0, hypotheses.bounds
    returns = bounds.returns(hypotheses.q)
    worth = np.zeros((states + 2, padded))
    worth[states:] = [[1.0], [0.0]] if payment is None else [[0.0], [payment.lost]]
    worth[:states] = columns(gamma * returns.max(axis=2))
    shares = columns(hypotheses.q)
    precision: Floats = known / (hypotheses.td_var + hypotheses.floor**2)
    usual = hypotheses.td_var * (1.0 if hypotheses.centred else 0.0)
    logs = ln(np.where(known, hypotheses.q, 1.0)) if hypotheses.geometric else None
    return PosteriorState(
        tables=count,
        actions=actions,
        values=columns(returns),
        worth=worth,
        precision=columns(precision / bounds.width**2),
        expected=columns(known * (usual * precision + hypotheses.excess)),
        terms=shares if logs is None else columns(logs),
        temperature=float(hypotheses.temperature),
        cap=float(hypotheses.cap),
        least=-np.inf if hypotheses.centred else 0.0,
        freeze=int(hypotheses.freeze),
        threshold=float(hypotheses.threshold),
        geometric=bool(hypotheses.geometric),
        low=float(bounds.low),
        width=float(bounds.width),
        log_weight=np.zeros((lanes, padded)),
        weight=np.zeros((lanes, padded)),
        mixed=np.zeros((lanes, padded)),
        version=np.zeros(lanes, np.int64),
        current=np.zeros((lanes, states), np.int64),
        start=np.zeros((lanes, states * actions)),
        left=np.ones((lanes, states * actions)),
        goals=np.zeros(lanes, np.int64),
        live=np.zeros(lanes, np.bool_),
        next_moment=np.zeros(lanes, np.int64),
        moments=np.ascontiguousarray(moments, np.int64),
        weights=np.zeros((batch, len(moments), count)),
        moves=np.zeros(batch, np.int64),
        frozen=np.full(batch, NEVER),
    )


@inner
def begin(posterior, tasks, lane, task):
    """A task takes the lane: all hypotheses weigh the same, and M is the table that it starts from."""
    log_weight, weight, mixed = posterior.log_weight[lane], posterior.weight[lane], posterior.mixed[lane]
    for each in range(posterior.tables):
        log_weight[each] = 0.0
        weight[each] = mixed[each] = 1.0 / posterior.tables
    start, left, current = posterior.start[lane], posterior.left[lane], posterior.current[lane]
    for state in range(len(current)):
        current[state] = 0
        for action in range(posterior.actions):
            start[state * posterior.actions + action] = tasks.q[task, state, action]
            left[state * posterior.actions + action] = 1.0
    posterior.version[lane] = posterior.goals[lane] = posterior.next_moment[lane] = 0
    posterior.live[lane] = True
    record(posterior, lane, task, 0)


@inlined
def weigh(posterior, payment, lane, task, state, action, reward, after, kept):
    """What a step says, after its update: moves the weights and, if they have moved far enough, the version of M.

    `after` is the state it led to, the number of states S if that was the goal, or S + 1 if the episode ended elsewhere;
    `kept` is 1 - alpha of the update.
    """
    pair = posterior.actions * np.int64(state) + np.int64(action)
    posterior.left[lane, pair] *= kept
    log_weight, values = posterior.log_weight[lane], posterior.values[pair]
    worth, precision = posterior.worth[np.int64(after)], posterior.precision[pair]
    expected, cap, least = posterior.expected[pair], posterior.cap, posterior.least
    for place in range(0, len(log_weight), EIGHT):
        error = with_reward(payment, reward, load_reals(worth, place)) - load_reals(values, place)
        surprise = error * error * load_reals(precision, place) - load_reals(expected, place)
        surprise = chosen(surprise > cap, cap, chosen(surprise > least, surprise, least))
        store_reals(log_weight, place, load_reals(log_weight, place) - surprise * posterior.temperature)
    _normalise(posterior, lane, task)


@inner
def _normalise(posterior, lane, task):
    log_weight, weight, mixed = posterior.log_weight[lane], posterior.weight[lane], posterior.mixed[lane]
    largest, whole, moved = log_weight[0], 0.0, 0.0
    for each in range(posterior.tables):
        largest = max(largest, log_weight[each])
    for each in range(posterior.tables):
        log_weight[each] -= largest
        weight[each] = math.exp(max(log_weight[each], LEAST))
        whole += weight[each]
    for each in range(posterior.tables):
        weight[each] /= whole
        moved += abs(weight[each] - mixed[each])
    if moved > posterior.threshold:
        for each in range(posterior.tables):
            mixed[each] = weight[each]
        posterior.version[lane] += 1
        posterior.moves[task] += 1


@inlined
def refresh(posterior, lane, memory, state, gamma):
    """Brings a state's row, its ties and what entering it is worth up to date with M."""
    if posterior.current[lane, state] != posterior.version[lane]:
        _correct(posterior, lane, memory, np.int64(state), gamma)


@inner
def _correct(posterior, lane, memory, state, gamma):
    posterior.current[lane, state] = posterior.version[lane]
    start, left = posterior.start[lane], posterior.left[lane]
    row = (width_of(memory) + WIDTH) * state
    for action in range(posterior.actions):
        pair = posterior.actions * state + action
        mean = mean_at(posterior, lane, pair)
        memory.rows[row + action] += left[pair] * (mean - start[pair])
        start[pair] = mean
    rescan(memory, state, posterior.actions, gamma)


@inner
def mean_at(posterior, lane, pair):
    """M at a state-action: the mean of the tables that know it, under the weights; the least return where none does."""
    mixed, terms, precision = posterior.mixed[lane], posterior.terms[pair], posterior.precision[pair]
    above, below = load_reals(mixed, 0) * 0.0, load_reals(mixed, 0) * 0.0
    for place in range(0, len(mixed), EIGHT):
        weight = chosen(load_reals(precision, place) > 0.0, load_reals(mixed, place), 0.0)
        above = above + weight * load_reals(terms, place)
        below = below + weight
    if total(below) == 0.0:
        return posterior.low
    mean = total(above) / total(below)
    return posterior.low + posterior.width * (math.exp(mean) if posterior.geometric else mean)


@inner
def end_episode(posterior, task, lane, memory, reached, ended, evaluated, gamma, episodes):
    """The first `ended` episodes of the lane's task are over: counts goals, freezes, records, and brings the table up to date
    if it is read now."""
    if count_goal(posterior, task, lane, reached, ended, episodes) or evaluated:
        for state in range(posterior.current.shape[1]):
            refresh(posterior, lane, memory, state, gamma)


@inner
def count_goal(posterior, task, lane, reached, ended, episodes):
    """True if the weights are read no more after the first `ended` episodes: they freeze, or the task is done. Records them."""
    posterior.goals[lane] += reached
    freezes = reached and posterior.goals[lane] == posterior.freeze
    if freezes:
        posterior.frozen[task] = ended
    last = freezes or ended == episodes
    if last:
        posterior.live[lane] = False
    record(posterior, lane, task, episodes if last else ended)
    return last


@inner
def record(posterior, lane, task, ended):
    """Notes the weights for every moment that has come; those after freezing hold the same."""
    while posterior.next_moment[lane] < len(posterior.moments):
        moment = posterior.next_moment[lane]
        if posterior.moments[moment] > ended:
            return
        for each in range(posterior.tables):
            posterior.weights[task, moment, each] = posterior.weight[lane, each]
        posterior.next_moment[lane] += 1


@inner
def weighs(posterior, first, end):
    """True if the weights of a task in the lanes `first` to `end` - 1 still move."""
    count = 0
    for lane in range(first, end):
        count += posterior.live[lane]
    return count > 0
