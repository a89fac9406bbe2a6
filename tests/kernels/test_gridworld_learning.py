"""The compiled gridworld loop against the plain reference, and against itself in other batches."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from qinit_cli.kernels import dice
from qinit_cli.kernels.batch import Chance, Learned, Records, Start, Watch, learn
from qinit_cli.kernels.gridworld import Gridworlds
from qinit_cli.learning import Learning

from . import reference

SIZE = 6
GOALS = np.array([35, 14, 1, 22, 30, 8, 17])
P = np.array([0.6, 0.75, 0.9, 1.0, 0.25, 0.8, 0.7])
EXPLORING = Learning(alpha=0.1, gamma=0.95, epsilon=0.5, episodes=60, horizon=40, start="anywhere")
GREEDY = Learning(alpha=0.2, gamma=0.9, epsilon=0.05, episodes=60, horizon=25, start="fixed")
ALL = Records(bins=60, visits=True, td_var=True)


def chance(seed: int, tasks: int) -> Chance:
    def streams(kind: int) -> list[np.random.SeedSequence]:
        return [np.random.SeedSequence(seed, spawn_key=(kind, task)) for task in range(tasks)]

    return Chance(dice=dice.lane_seeds(streams(0)), starts=dice.seeds(streams(1)))


def part(given: Chance, tasks: slice | list[int]) -> Chance:
    return Chance(**{field.name: getattr(given, field.name)[tasks] for field in dataclasses.fields(given)})


def worlds(tasks: slice | list[int] = slice(None)) -> Gridworlds:
    return Gridworlds(SIZE, GOALS[tasks], P[tasks])


def table(seed: int = 5) -> np.ndarray:
    """A start table with ties in it."""
    return np.random.default_rng(seed).integers(0, 3, (SIZE**2, 4)) / 8


def potential(tasks: int) -> np.ndarray:
    return np.random.default_rng(6).random((tasks, SIZE**2))


def expected(task: int, learning: Learning, start: Start, given: Chance) -> reference.Outcome:
    fixed = 0 if learning.start == "fixed" else None
    starts = reference.xoshiro(given.starts[task])
    world = reference.Gridworld(SIZE, int(GOALS[task]), float(P[task]), fixed, starts)
    phi = (
        None
        if start.potential is None
        else np.atleast_2d(start.potential)[task % len(np.atleast_2d(start.potential))]
    )
    return reference.learn(world, learning, start.table, reference.in_lanes(given.dice[task]), phi)


def assert_same(learned: Learned, task: int, outcome: reference.Outcome) -> None:
    assert learned.finished[task]
    np.testing.assert_array_equal(learned.q[task], outcome.q)
    np.testing.assert_array_equal(learned.visits[task], outcome.visits)
    np.testing.assert_array_equal(learned.td_var[task], outcome.td_var)
    np.testing.assert_array_equal(learned.steps[task], outcome.steps)
    np.testing.assert_array_equal(learned.reached[task], outcome.reached)
    assert learned.step_count[task] == sum(outcome.steps)


@pytest.mark.parametrize("learning", [EXPLORING, GREEDY], ids=["exploring", "greedy"])
@pytest.mark.parametrize(
    "phi", [None, potential(1)[0], potential(len(GOALS))], ids=["unshaped", "shaped", "own potentials"]
)
def test_the_compiled_loop_equals_the_plain_one_to_the_last_bit(
    learning: Learning, phi: np.ndarray | None
) -> None:
    given = chance(1, len(GOALS))
    start = Start(table(), phi)
    learned = learn(worlds(), learning, start, given, ALL, Watch())
    for task in range(len(GOALS)):
        assert_same(learned, task, expected(task, learning, start, given))


@pytest.mark.parametrize("lanes", [1, 2, 3, 4, 5, 9])
def test_a_task_learns_the_same_whatever_learns_beside_it(lanes: int) -> None:
    given = chance(2, len(GOALS))
    whole = learn(worlds(), EXPLORING, Start(table()), given, ALL, Watch(), lanes=lanes)
    for tasks in ([3], [6, 1], [5, 4, 3, 2, 0]):
        some = learn(worlds(tasks), EXPLORING, Start(table()), part(given, tasks), ALL, Watch())
        for name in ("q", "visits", "td_var", "steps", "reached", "step_count"):
            np.testing.assert_array_equal(getattr(some, name), getattr(whole, name)[tasks])


def test_records_left_out_change_nothing() -> None:
    given = chance(3, len(GOALS))
    full = learn(worlds(), EXPLORING, Start(table()), given, ALL, Watch())
    bare = learn(worlds(), EXPLORING, Start(table()), given, Records(bins=7), Watch())
    assert bare.visits is None
    assert bare.td_var is None
    np.testing.assert_array_equal(bare.q, full.q)
    bins = np.arange(60) * 7 // 60
    for binned, each in ((bare.steps, full.steps), (bare.reached, full.reached)):
        np.testing.assert_array_equal(binned, np.stack([np.bincount(bins, row, 7) for row in each]))
