"""The states on greedy paths from the target start, worked by hand and against Gymnasium."""

from __future__ import annotations

from typing import Any

import gymnasium
import numpy as np
import pytest

from qinit_cli.environments.gridworld import Gridworld
from qinit_cli.environments.mountain_car import MountainCar

UP, DOWN, LEFT, RIGHT = range(4)
BINS = 30


def _greedy(actions: Any, count: int) -> Any:
    """A table whose greedy action in each state is the one given, (1, S, A)."""
    return np.eye(count)[np.asarray(actions).ravel()][None]


def _cars(*etas: float) -> Any:
    return np.array([(eta,) for eta in etas], dtype=[("eta", "<f8")])


def _pump() -> Any:
    """Right where the bin's velocity is not negative, else left: it swings up whatever the push."""
    return _greedy([[2 if column >= BINS // 2 else 0 for column in range(BINS)]] * BINS, 3)


def test_a_deterministic_grids_path_is_the_one_walked_by_hand(tasks_of: Any) -> None:
    grid = Gridworld(size=3, p_low=1.0, p_high=1.0)
    actions = [[RIGHT, DOWN, LEFT], [UP, DOWN, UP], [UP, RIGHT, UP]]
    visits = grid.visits(tasks_of(grid, (2, 2, 1.0)), _greedy(actions, 4), horizon=10)
    assert visits.reshape(3, 3).tolist() == [[1, 1, 0], [0, 1, 0], [0, 1, 1]]


def test_a_path_that_loops_pushes_a_wall_or_is_longer_than_the_horizon_counts_nowhere(tasks_of: Any) -> None:
    grid = Gridworld(size=2)
    around, wall = _greedy([[RIGHT, DOWN], [UP, LEFT]], 4), _greedy([[UP, UP], [UP, UP]], 4)
    task = tasks_of(grid, (1, 0, 0.9))
    assert grid.visits(task, around, horizon=3).tolist() == [[1, 1, 1, 1]]
    assert not grid.visits(task, around, horizon=2).any()
    assert not grid.visits(task, wall, horizon=50).any()
    back = _greedy([[RIGHT, LEFT], [UP, LEFT]], 4)
    assert not grid.visits(task, back, horizon=50).any()


def test_grid_visits_are_one_more_than_the_path_lengths_of_exact_tables(tasks_of: Any) -> None:
    grid = Gridworld(size=8)
    tasks = tasks_of(grid, (5, 6, 0.7), (0, 1, 0.6), (7, 7, 0.9))
    q, _ = grid.solve(tasks, 0.95)
    visits = grid.visits(tasks, q, horizon=100)
    assert visits.sum(axis=1).tolist() == [11 + 1, 1 + 1, 14 + 1]
    assert visits.max() == 1
    assert visits.reshape(3, 8, 8)[[0, 1, 2], [5, 0, 7], [6, 1, 7]].tolist() == [1, 1, 1]


def test_the_cars_visits_are_those_of_gymnasiums_car() -> None:
    car: Any = gymnasium.make("MountainCar-v0").unwrapped
    car.reset()
    car.state, done, expected = (-0.5, 0.0), False, np.zeros((BINS, BINS), int)
    while True:
        position, velocity = car.state
        row = min(int((position + 1.2) / 1.8 * BINS), BINS - 1)
        column = min(int((velocity + 0.07) / 0.14 * BINS), BINS - 1)
        expected[row, column] += 1
        if done:
            break
        done = car.step(2 if column >= BINS // 2 else 0)[2]
    visits = MountainCar().visits(_cars(0.0), _pump(), horizon=1_000)
    np.testing.assert_array_equal(visits.reshape(BINS, BINS), expected)
    assert expected.sum() > 100


@pytest.mark.parametrize("eta", [-0.004, 0.0, 0.008])
def test_the_cars_visits_are_one_more_than_its_steps_and_none_where_the_horizon_cuts_it(eta: float) -> None:
    from qinit_cli.kernels.mountain_car_paths import greedy_lengths

    family, lengths = MountainCar(), np.empty(1, np.int64)
    greedy_lengths(np.array([eta]), 0.0, BINS, _pump(), 1_000, -0.5, 0.0, lengths)
    visits = family.visits(_cars(eta), _pump(), horizon=1_000)
    assert visits.sum() == lengths[0] + 1
    assert family.visits(_cars(eta), _pump(), horizon=int(lengths[0])).sum() == lengths[0] + 1
    assert not family.visits(_cars(eta), _pump(), horizon=int(lengths[0]) - 1).any()
    assert family.solved(_cars(eta), _pump(), 1_000).all()


def test_a_car_that_never_pushes_stays_and_counts_nowhere() -> None:
    still = _greedy(np.ones((BINS, BINS), int), 3)
    assert not MountainCar().visits(_cars(0.0), still, horizon=200).any()
