"""The bits that the loop through tables makes of worlds of many shapes, with all that may hang on a step or an episode.

A hash that is changed on purpose is changed here, in the commit that says why.
"""

from __future__ import annotations

import dataclasses
import hashlib
from collections.abc import Mapping
from typing import Any

import numpy as np
import pytest

from qinit_cli.kernels import random_streams as rng
from qinit_cli.kernels.batch import LaneStreams, Learned, Policies, Records, Start, learn
from qinit_cli.kernels.posterior import Hypotheses
from qinit_cli.kernels.tables import Tables
from qinit_cli.kernels.worlds import GOAL, LOST
from qinit_cli.learning import Learning
from qinit_cli.watch import Watch

STATES, LIBRARY = 9, 11
EXPLORING = Learning(alpha=0.1, gamma=0.95, epsilon=0.5, episodes=60, horizon=40, start="anywhere")
GREEDY = Learning(alpha=0.2, gamma=0.9, epsilon=0.05, episodes=70, horizon=25, start="fixed")
ALL = Records(bins=20, visits=True, td_var=True, evaluate_every=7, moments=np.array([0, 1, 5, 50]))
BARE = Records(bins=60)
FOLLOWING = {"c": 0.2, "psi0": 0.9, "rho": 0.97, "nu": 0.95}
BOUNDED = {"temperature": 0.01, "floor": 0.01, "excess": 0.5, "cap": 5.0, "freeze": 9, "threshold": 0.05}
CENTRED = BOUNDED | {"temperature": 0.05, "excess": 0.0, "cap": 200.0, "freeze": 0}

# actions x outcomes -> tasks, lanes
SHAPES = {"2x1": (1, 8), "3x2": (3, 8), "4x3": (11, 8), "5x4": (6, 3), "9x5": (5, 1)}
HASHES = """
bare          9cfd1ca3 9eacc206 d66c4a10 a44d6b5e 78a9503d
exploring     7918ddec 755a6a01 3b00f8d5 df3e61cb 3c8af20f
greedy        464181d9 05cb7855 bb19dfea 6e4335e2 24eba427
shaped        3ef04a39 1a764ae6 88ed9343 cd423ac9 73431aa5
shaped-each   d74446d8 dbbe8e6e e22e2ab1 5031dd75 331022d3
following     60823b8a 39d1dc44 d44d1a4e 92476c1f 7259f572
exploring-too 402a9e79 d74f65fb c43b8368 ace5c183 b8dca9e3
weighing      872f8bb0 6f7c72df 69e3b875 d47894de 541e5431
centred       035dc51c b054dbe7 5da5393d 4bafd2dd e6205067
all-together  b92065ea 64232b14 4529dace 93357282 5e4ccb42
"""


class Random:
    """A task's chance, by arithmetic whose bits are the same everywhere."""

    def __init__(self, actions: int, outcomes: int, tasks: int) -> None:
        self.draw = np.random.default_rng([actions, outcomes])
        self.actions, self.outcomes, self.tasks = actions, outcomes, tasks

    def tables(self) -> Tables:
        """Ends that are the goal and ends that are not, outcomes of probability 0, and a state where nobody acts."""
        shape = self.tasks, STATES, self.actions, self.outcomes
        after = self.draw.integers(0, STATES - 1, shape)
        ends = self.draw.random(shape)
        after = np.where(ends < 0.1, GOAL, np.where(ends < 0.15, LOST, after)).astype(np.int32)
        shares = np.maximum(self.draw.integers(-3, 6, shape), 0)
        shares[..., 0] += shares.sum(axis=-1) == 0
        start = np.zeros(shape[:2])
        start[:, [1, 4]] = 0.25, 0.75
        open = np.tile(np.arange(STATES) < STATES - 1, (self.tasks, 1))
        return Tables(after, shares / shares.sum(axis=-1, keepdims=True), start, open)

    def start(self) -> np.ndarray:
        """With ties in it."""
        return self.draw.integers(0, 3, (STATES, self.actions)) / 8

    def policies(self, **rules: Any) -> Policies:
        return Policies(self.draw.integers(0, self.actions, (LIBRARY, STATES)), **rules)

    def hypotheses(self, **rules: Any) -> Hypotheses:
        """With pairs that no table knows, or only some."""
        shape = LIBRARY, STATES, self.actions
        known = (self.draw.random(shape) < 0.8) & (self.draw.random(shape[1:]) < 0.9)
        return Hypotheses(self.draw.random(shape) * known, self.draw.random(shape) / 16, **rules)


# what hangs on the learning -> how it learns, what it starts from, what is kept
LEARNED = {
    "bare": (EXPLORING, lambda random: Start(random.start()), BARE),
    "exploring": (EXPLORING, lambda random: Start(random.start()), ALL),
    "greedy": (GREEDY, lambda random: Start(random.start()), ALL),
    "shaped": (GREEDY, lambda random: Start(random.start(), random.draw.random(STATES)), ALL),
    "shaped-each": (
        EXPLORING,
        lambda random: Start(random.start(), random.draw.random((random.tasks, STATES))),
        ALL,
    ),
    "following": (EXPLORING, lambda random: Start(random.start(), None, random.policies(**FOLLOWING)), ALL),
    "exploring-too": (
        EXPLORING,
        lambda random: Start(
            random.start(), None, random.policies(**FOLLOWING, explore_while_following=True)
        ),
        ALL,
    ),
    "weighing": (
        EXPLORING,
        lambda random: _weighing(random.hypotheses(**BOUNDED, geometric=False, centred=False)),
        ALL,
    ),
    "centred": (
        GREEDY,
        lambda random: _weighing(random.hypotheses(**CENTRED, geometric=True, centred=True)),
        ALL,
    ),
    "all-together": (
        EXPLORING,
        lambda random: dataclasses.replace(
            _weighing(random.hypotheses(**CENTRED, geometric=False, centred=True)),
            potential=random.draw.random(STATES),
            policies=random.policies(**FOLLOWING, explore_while_following=True),
        ),
        ALL,
    ),
}


def _weighing(hypotheses: Hypotheses) -> Start:
    return Start(np.nan_to_num(hypotheses.mean()), hypotheses=hypotheses)


def streams(tasks: int) -> LaneStreams:
    def each(kind: int) -> list[np.random.SeedSequence]:
        return [np.random.SeedSequence(7, spawn_key=(kind, task)) for task in range(tasks)]

    return LaneStreams(rng.lane_seeds(each(0)), *(rng.seeds(each(kind)) for kind in (1, 2, 3)))


def learned(kind: str, shape: str) -> Learned:
    tasks, lanes = SHAPES[shape]
    random = Random(*map(int, shape.split("x")), tasks)
    learning, start, records = LEARNED[kind]
    world = random.tables().worlds(np.zeros((tasks, 4), np.uint64))
    return learn(world, learning, start(random), streams(tasks), records, Watch(), lanes)


def digest(found: Learned) -> str:
    """The first eight digits of the SHA-256 of all that was learned, but the seconds; its worlds tell no rewards."""
    fields = dataclasses.asdict(found)
    assert fields.pop("returns") is fields.pop("evaluation_returns") is None
    weighing, _ = fields.pop("weighing") or {}, fields.pop("seconds")
    told = hashlib.sha256()
    for name, array in sorted((fields | weighing).items()):
        told.update(f"{name} {array if array is None else (array.dtype.str, array.shape)}".encode())
        told.update(b"" if array is None else array.tobytes())
    return told.hexdigest()[:8]


def pinned() -> Mapping[str, list[str]]:
    return {row[0]: row[1:] for row in (line.split() for line in HASHES.strip().splitlines())}


@pytest.mark.parametrize("kind", LEARNED)
def test_what_is_learned_through_tables_is_the_same_bits_as_ever(kind: str) -> None:
    assert [digest(learned(kind, shape)) for shape in SHAPES] == pinned()[kind]
