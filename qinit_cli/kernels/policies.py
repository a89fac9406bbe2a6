# mypy: allow-untyped-defs, allow-untyped-calls
"""Choosing among policies of solved tasks while learning: UCB1 over them, one choice an episode.

Each policy is tried once, in random order; then the one is taken for which W + c * sqrt(2 ln k / n) is largest (the first of
equals), W its mean return divided by the best return that any episode of this task had (0 while that is 0; both as shares, see
rewards.ReturnBounds), n its episodes, k the episodes so far. In the k-th episode the policy is followed with probability
psi = psi0 * rho^(k-1) * nu^t at step t.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from qinit_cli.arrays import Floats, Integers
from qinit_cli.kernels.compiled import inlined, inner
from qinit_cli.kernels.parts import part
from qinit_cli.kernels.random_streams import Words, below, unit
from qinit_cli.kernels.vectors import WIDTH

_ONE, _TIES = np.uint64(1), np.uint64(15)


@dataclass(frozen=True)
class Policies:
    """Policies of solved tasks to choose among while learning, and how."""

    actions: Integers  # (K, S)
    weights: Floats | None = (
        None  # (K, T, A) of tiles, in whose sums they are greedy; `actions` then says how many
    )
    c: float = 0.1
    psi0: float = 1.0
    rho: float = 0.99
    nu: float = 0.98
    explore_while_following: bool = False


class Choosing(NamedTuple):
    """The policies of a batch, K of them, and what the task of each lane knows about them."""

    policies: Any  # u2 (K, S) actions, or f8 (K, T * W) weights as tiles.TileMemory has them
    c: float
    psi0: float
    rho: float
    nu: float
    explore_while_following: bool
    rng: Any  # u8 (B, 4)
    words: Any  # u8 (L, 4) the stream of the lane's task
    chosen: Any  # i8 (L,) the policy of the episode
    tried: Any  # i8 (L, K) episodes of each
    mean: Any  # f8 (L, K) their mean return
    best: Any  # f8 (L,) the best return of an episode
    first_psi: Any  # f8 (L,) psi at the start of the episode
    psi: Any  # f8 (L,) psi of the coming step


def new_choosing(policies: Policies, rng: Words, lanes: int) -> Choosing:
    """What the loops need to choose among policies in that many lanes."""
    count = len(policies.actions)
    told: Any = np.ascontiguousarray(policies.actions, np.uint16)
    if policies.weights is not None:
        room = -policies.weights.shape[2] % WIDTH
        told = np.pad(policies.weights, ((0, 0), (0, 0), (0, room))).reshape(count, -1)
    return Choosing(
        policies=told,
        c=float(policies.c),
        psi0=float(policies.psi0),
        rho=float(policies.rho),
        nu=float(policies.nu),
        explore_while_following=policies.explore_while_following,
        rng=rng.copy(),
        words=np.zeros((lanes, 4), np.uint64),
        chosen=np.zeros(lanes, np.int64),
        tried=np.zeros((lanes, count), np.int64),
        mean=np.zeros((lanes, count)),
        best=np.zeros(lanes),
        first_psi=np.zeros(lanes),
        psi=np.zeros(lanes),
    )


@inner
def begin(choosing, lane, task):
    """A task takes the lane: nothing is known of any policy, and its first episode has its choice."""
    for word in range(4):
        choosing.words[lane, word] = choosing.rng[task, word]
    for policy in range(len(choosing.policies)):
        choosing.tried[lane, policy], choosing.mean[lane, policy] = 0, 0.0
    choosing.best[lane] = 0.0
    choosing.first_psi[lane] = choosing.psi0
    _choose(choosing, lane)


@inner
def learn_of_episode(choosing, lane, gained):
    """Credits an episode to its policy, given its share of the attainable return, and chooses the next one's."""
    policy = choosing.chosen[lane]
    choosing.tried[lane, policy] += 1
    choosing.mean[lane, policy] += (gained - choosing.mean[lane, policy]) / choosing.tried[lane, policy]
    choosing.best[lane] = max(choosing.best[lane], gained)
    choosing.first_psi[lane] *= choosing.rho
    _choose(choosing, lane)


@inlined
def follows(choosing, lane):
    """Whether the lane's step follows the episode's policy."""
    followed = unit(choosing.words[lane]) < choosing.psi[lane]
    choosing.psi[lane] *= choosing.nu
    return followed


@part
def policy_action(memory, choosing, lane, state):
    """What the episode's policy does in a state."""
    return np.int64(choosing.policies[choosing.chosen[lane], state])


@inlined
def followed(memory, choosing, lane, choice, ties, state):
    """The step's choice with its tied actions: the policy's alone if the step follows it, else the greedy ones."""
    choice = np.uint64(choice)
    if not follows(choosing, lane):
        return choice | ties
    if not choosing.explore_while_following:
        choice &= ~_TIES
    return choice | _ONE << np.uint64(policy_action(memory, choosing, lane, state))


@inner
def _choose(choosing, lane):
    tried, count = choosing.tried[lane], choosing.tried.shape[1]
    choosing.psi[lane] = choosing.first_psi[lane]
    untried = episodes = 0
    for policy in range(count):
        untried += tried[policy] == 0
        episodes += tried[policy]
    if untried > 0:
        place = below(choosing.words[lane], untried)
        for policy in range(count):
            if tried[policy] == 0:
                if place == 0:
                    choosing.chosen[lane] = policy
                place -= 1
        return
    best, width = -1.0, 2.0 * math.log(episodes)
    for policy in range(count):
        share = choosing.mean[lane, policy] / choosing.best[lane] if choosing.best[lane] > 0 else 0.0
        bound = share + choosing.c * math.sqrt(width / tried[policy])
        if bound > best:
            best = bound
            choosing.chosen[lane] = policy
