"""Knowledge that gives way: the plain blend by hand, and the compiled one against it to the last bit."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
import reference
from learner_reference import Blend, Table, Tiles
from test_learner_reference import CHAIN, made, walk, zeros
from test_learners import (
    ALL,
    CARS,
    EPISODES,
    FALLING,
    GRIDS,
    TABLES,
    USUAL,
    VISITS,
    Cars,
    assert_plain,
    plainly_learned,
    streams,
    table_of,
)

from qinit_cli.kernels.batch import Records, Start, learn
from qinit_cli.kernels.mountain_car import MountainCars
from qinit_cli.kernels.posterior import Hypotheses
from qinit_cli.kernels.tiles import TiledWorlds
from qinit_cli.learners.one_step import ExpectedSarsa, QLearner, Sarsa
from qinit_cli.tile_coding import TileCoding
from qinit_cli.watch import Watch

FEW = Records(EPISODES)  # of tiles no visits are kept


def blended(q: Table, known_at: int, learner: Any = None, **settings: Any) -> Any:
    one = made(learner or QLearner(), q, **settings)
    one.blend = Blend(q, known_at)
    return one


def test_a_start_gives_way_by_the_share_of_the_updates_that_make_a_value_known() -> None:
    """Goals worth 1, alpha 1/2: what is learned is 1/2, 3/4, 7/8, 15/16; Q0 is 1/4."""
    learner, acted_on = blended([[0.25]], 4), []
    for _ in range(5):
        walk(learner, [(0, 0, 1.0, None)])
        acted_on.append(learner.q[0][0])
    assert acted_on == [
        0.75 * 0.25 + 0.25 * 0.5,
        0.5 * 0.25 + 0.5 * 0.75,
        0.25 * 0.25 + 0.75 * 0.875,
        15 / 16,
        31 / 32,
    ]


def test_what_follows_a_step_is_the_blend_and_not_what_was_learned() -> None:
    learner = blended([[0.0], [0.5]], 2)
    walk(learner, [(0, 0, 0.0, 1)])  # learned 1/2 (1/2 1/2) = 1/8, known by half, and Q0 is 0
    assert learner.q[0][0] == 1 / 16
    walk(learner, [(0, 0, 0.0, 1)])
    assert learner.q[0][0] == 1 / 8 + 0.5 * (0.25 - 1 / 8)


def test_sarsa_and_expected_sarsa_follow_the_blend_too() -> None:
    for learner, value in ((Sarsa(), 0.25), (ExpectedSarsa(), 0.5 * 0.625 + 0.5 * 1.0)):
        plain = blended([[0.0, 0.0], [0.25, 1.0]], 1, learner)
        walk(plain, [(0, 0, 0.0, 1), (1, 0, 0.0, None)])
        assert plain.q[0][0] == 0.5 * (0.5 * value)


def test_a_tile_gives_way_by_its_own_updates() -> None:
    """Two tilings: states (0, 1) and (0, 2) share tile 0. Each weight learns half, 1/4; Q0 are 1/8."""
    q = Tiles([[0.125], [0.125], [0.125]])
    learner = blended(q, 2)
    walk(learner, [((0, 1), 0, 1.0, None)])
    assert [row[0] for row in q] == [0.5 * 0.125 + 0.5 * 0.25, 0.5 * 0.125 + 0.5 * 0.25, 0.125]
    walk(learner, [((0, 2), 0, 1.0, None)])  # learned so far: 1/4 and 0
    change = 0.5 * (1 - 0.25) / 2
    assert [row[0] for row in q] == [0.25 + change, 0.1875, 0.5 * 0.125 + 0.5 * change]


def test_from_zero_and_known_at_once_a_blend_is_plain_learning() -> None:
    one, other = blended(zeros(), 1), made(QLearner(), zeros())
    for _ in range(3):
        walk(one, CHAIN)
        walk(other, CHAIN)
    assert one.q == other.q
    start = Start(np.zeros((GRIDS.states, GRIDS.actions)))
    for task in range(GRIDS.tasks):
        at_once = plainly_learned(GRIDS, USUAL, replace(start, known_at=1), task)
        assert at_once == plainly_learned(GRIDS, USUAL, start, task)


def test_a_compiled_blend_equals_the_plain_one_to_the_last_bit() -> None:
    """One loop of tables, for each takes long to compile: a learner that waits, rows of six, and steps by visits."""
    learning = replace(USUAL, learner=Sarsa(), alpha=VISITS, epsilon=FALLING)
    start = Start(table_of(TABLES), known_at=5)
    outcomes = assert_plain(TABLES, learning, start)
    assert any(any(outcome.reached) for outcome in outcomes)
    assert outcomes[0].steps != plainly_learned(TABLES, learning, replace(start, known_at=None), 0).steps


class TiledCar(reference.MountainCar):
    """Told by the tiles of its position and velocity: grid i of n is shifted by i / n and 3 i / n of a tile."""

    tilings = 1

    @property
    def state(self) -> Any:
        along = (self.position + 1.2) * (self.bins / 1.8), (self.velocity + 0.07) * (self.bins / 0.14)
        column, row = (min(max(each, 0.0), math.nextafter(self.bins, 0.0)) for each in along)
        n, length = self.tilings, self.bins + (self.tilings > 1)
        return tuple(
            i * length**2 + int(column + i % n / n) * length + int(row + 3 * i % n / n) for i in range(n)
        )


class TiledCars(Cars):
    """The ten cars in tilings of 6 x 6."""

    kind = Tiles

    def __init__(self, tilings: int) -> None:
        self.coding = TileCoding((-1.2, -0.07), (0.6, 0.07), tilings, 6)
        self.states = self.coding.weights

    def worlds(self, tasks: Any = slice(None)) -> Any:
        return TiledWorlds(MountainCars(self.eta[tasks], bins=6), self.coding)

    def plain(self, task: int, anywhere: bool, starts: Any) -> Any:
        car = TiledCar(6, float(self.eta[task]), 0.0, "anywhere" if anywhere else "point", starts)
        car.tilings = self.coding.tilings
        return car


@pytest.mark.parametrize("tilings", [1, 4])
def test_blended_weights_equal_the_plain_ones_to_the_last_bit(tilings: int) -> None:
    cars, learning = TiledCars(tilings), replace(USUAL, horizon=120)
    start = Start(table_of(cars) / tilings, known_at=5)
    learned = learn(cars.worlds(), learning, start, streams(cars.tasks), FEW, Watch())
    for task in range(cars.tasks):
        outcome = plainly_learned(cars, learning, start, task)
        np.testing.assert_array_equal(learned.q[task], outcome.q)
        np.testing.assert_array_equal(learned.steps[task], outcome.steps)
        if tilings == 1:  # which is the table
            assert outcome.q == plainly_learned(CARS, learning, start, task).q
    assert learned.reached.any()


def test_a_start_that_hypotheses_change_is_not_blended() -> None:
    start = Start(table_of(GRIDS), known_at=5)
    tables = np.ones((2, GRIDS.states, GRIDS.actions))
    rule: Any = {
        "temperature": 0.05,
        "floor": 0.01,
        "excess": 0.0,
        "cap": 200.0,
        "freeze": 3,
        "threshold": 0.01,
    }
    moved = replace(start, hypotheses=Hypotheses(tables, tables, **rule, geometric=False, centred=True))
    with pytest.raises(ValueError, match="a blend keeps it"):
        learn(GRIDS.worlds(), USUAL, moved, streams(GRIDS.tasks), ALL, Watch())
