"""Learning by tile coding as Sutton & Barto (2018) write it down: one task, plain Python, weights by the places of tiles.

Section 9.5.4 for the tiles, 10.1 for Sarsa, 12.7 for traces; the compiled loop must equal it exactly.
"""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Callable, Iterator, Sequence
from typing import Any

import reference
from learner_reference import greedy_actions, in_order, picked

from qinit_cli.learning import Learning

Place = tuple[int, ...]  # a tiling, and the tile's number along each dimension


class Tiles:
    """The active tiles of a state: tiling i is shifted by (1, 3, 5, ...) i / n of a tile."""

    def __init__(self, box: Sequence[tuple[float, float]], tilings: int, tiles: int) -> None:
        self.box, self.tilings, self.tiles = box, tilings, tiles

    def active(self, state: Sequence[float]) -> list[Place]:
        inside = [
            min(max((x - low) * (self.tiles / (high - low)), 0.0), math.nextafter(self.tiles, 0.0))
            for x, (low, high) in zip(state, self.box, strict=True)
        ]
        return [
            (i, *(int(x + (2 * d + 1) * i % self.tilings / self.tilings) for d, x in enumerate(inside)))
            for i in range(self.tilings)
        ]


def coordinates(world: Any) -> Sequence[float]:
    """What a world observes, or where a car is."""
    observed: Sequence[float] | None = getattr(world, "observed", None)
    return (world.position, world.velocity) if observed is None else observed


class Linear:
    """Values that are sums of weights; a `potential` and policies are other weights, by places of tiles."""

    def __init__(
        self, world: Any, tiles: Tiles, learning: Learning, first: Callable[[Place, int], float]
    ) -> None:
        self.world, self.tiles, self.learning = world, tiles, learning
        self.weights: defaultdict[tuple[Place, int], float] = _Lazy(first)
        self.traces: list[list[Any]] = []  # [place, action, trace], in the order met last

    def places(self) -> list[Place]:
        return self.tiles.active(coordinates(self.world))

    def values(self, places: list[Place]) -> list[float]:
        return [
            in_order([0.0, *(self.weights[place, a] for place in places)]) for a in range(self.world.actions)
        ]

    def learn(self, places: list[Place], action: int, target: float) -> None:
        learner, alpha = self.learning.learner, self.learning.alpha
        error = target - self.values(places)[action]
        share = 1.0 / self.tiles.tilings
        if not hasattr(learner, "lambda_"):
            amount = alpha * error * share
            for place in places:
                self.weights[place, action] += amount
            return
        for place in places:
            old = [trace for at, a, trace in self.traces if (at, a) == (place, action)]
            self.traces = [one for one in self.traces if one[:2] != [place, action]]
            more = old[0] if old and learner.traces == "accumulating" else 0.0
            self.traces.append([place, action, more + 1.0])
        for place, a, trace in self.traces:
            self.weights[place, a] += alpha * error * share * trace
        self.decay()

    def decay(self) -> None:
        learner = self.learning.learner
        factor = self.learning.gamma * learner.lambda_
        fallen = [[place, a, trace * factor] for place, a, trace in self.traces]
        self.traces = [one for one in fallen if one[2] >= learner.least]

    def expected(self, values: list[float]) -> float:
        epsilon = round(self.learning.epsilon * 2**20) * 2.0**-20
        return epsilon * (in_order(values) / len(values)) + (1.0 - epsilon) * max(values)


class _Lazy(defaultdict):
    """Weights that begin as a function of their place."""

    def __init__(self, first: Callable[[Place, int], float]) -> None:
        super().__init__()
        self.first = first

    def __missing__(self, key: tuple[Place, int]) -> float:
        self[key] = self.first(*key)
        return self[key]


def learn(
    world: Any,
    tiles: Tiles,
    learning: Learning,
    rng: Iterator[int],
    first: Callable[[Place, int], float] = lambda place, action: 0.0,
    potential: Callable[[Place], float] | None = None,
    choices: reference.Choices | None = None,
) -> tuple[Linear, list[int], list[bool]]:
    """What one task learned, with the steps of each episode and whether it reached the goal.

    The policies of `choices` are functions of a place of a tile and an action, greedy in their sums.
    """
    linear = Linear(world, tiles, learning, first)
    limit, waits = round(learning.epsilon * 2**20), learning.learner.waits
    all_steps, all_reached = [], []

    for _ in range(learning.episodes):
        world.reset()
        linear.traces, length, reached, waiting = [], 0, False, None
        while not (reached or reference.ended(world)) and length < learning.horizon:
            draw, places = next(rng), linear.places()
            values = linear.values(places)
            explores = (draw >> 12 & 2**20 - 1) < limit
            tied = list(range(len(values))) if explores else greedy_actions(values)
            action = picked(draw, tied)
            if choices is not None and choices.follows():
                policy = choices.policies[choices.chosen]
                sums = [in_order([0.0, *(policy(place, a) for place in places)]) for a in range(len(values))]
                action = sums.index(max(sums))
            if waiting is not None:
                linear.learn(*waiting, learning.gamma * values[action])
            reached = world.step(draw, action)
            length += 1
            after = None if reached or reference.ended(world) else linear.places()
            follows = [0.0] if after is None else linear.values(after)
            if waits and after is not None:
                waiting = places, action
                if length == learning.horizon:
                    linear.learn(*waiting, learning.gamma * linear.expected(follows))
                continue
            expects = learning.learner.name == "expected-sarsa"
            bootstrap = linear.expected(follows) if expects else max(follows)
            reward = getattr(world, "paid", float(reached))
            target = reward if after is None else learning.gamma * bootstrap + reward
            if potential is not None:
                before = in_order([0.0, *map(potential, places)])
                ahead = 0.0 if after is None else learning.gamma * in_order([0.0, *map(potential, after)])
                target = target + ahead - before
            linear.learn(places, action, target)
        all_steps.append(length)
        all_reached.append(reached)
        if choices is not None:
            choices.episode_ended(length, reached, 0.0)
    return linear, all_steps, all_reached
