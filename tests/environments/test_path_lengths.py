"""Expected optimal path lengths on the gridworld, worked by hand; definition 1 of the paper."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from qinit_cli.environments.gridworld import Gridworld

UP, DOWN, LEFT, RIGHT = range(4)
NEVER = -1


def _greedy(size: int, actions: Any) -> Any:
    """A table whose greedy action in each cell is the one given, (1, S, 4)."""
    q = np.zeros((size, size, 4))
    for row, column in np.ndindex(size, size):
        q[row, column, actions[row][column]] = 1.0
    return q.reshape(1, size * size, 4)


def _lengths(size: int, task: Any, q: Any) -> Any:
    """(size, size, 4)."""
    return Gridworld(size=size).path_lengths(task, q, horizon=1_000)[0].reshape(size, size, 4)


def _distance(size: int, goal: tuple[int, int]) -> Any:
    rows, columns = np.indices((size, size))
    return abs(rows - goal[0]) + abs(columns - goal[1])


@pytest.mark.parametrize("goal", [(4, 5), (0, 0), (6, 0), (3, 3)], ids=str)
def test_on_the_open_grid_every_length_is_one_more_than_the_distance_after_the_move(
    goal: tuple[int, int], tasks_of: Any, model: Any
) -> None:
    grid = Gridworld(size=7)
    task = tasks_of(grid, (*goal, 0.75))
    q, _ = grid.solve(task, 0.95)
    distance = _distance(7, goal).ravel()
    expected = 1 + distance[model(7, goal, 0.75).next_cells()]
    expected[goal[0] * 7 + goal[1]] = 0
    np.testing.assert_array_equal(_lengths(7, task, q).reshape(-1, 4), expected)


def test_the_best_length_is_the_manhattan_distance(tasks_of: Any) -> None:
    grid = Gridworld(size=9)
    task = tasks_of(grid, (6, 2, 0.65))
    q, _ = grid.solve(task, 0.95)
    np.testing.assert_array_equal(_lengths(9, task, q).min(axis=2), _distance(9, (6, 2)))


def test_the_goal_is_no_step_away_and_its_neighbours_one(tasks_of: Any) -> None:
    grid = Gridworld(size=5)
    task = tasks_of(grid, (2, 2, 0.8))
    q, _ = grid.solve(task, 0.95)
    lengths = _lengths(5, task, q)
    assert lengths[2, 2].tolist() == [0, 0, 0, 0]
    into = [lengths[3, 2, UP], lengths[1, 2, DOWN], lengths[2, 3, LEFT], lengths[2, 1, RIGHT]]
    assert into == [1, 1, 1, 1]


def test_pushing_a_wall_costs_one_step_and_is_no_loop(tasks_of: Any) -> None:
    grid = Gridworld(size=5)
    task = tasks_of(grid, (4, 3, 0.8))
    q, _ = grid.solve(task, 0.95)
    lengths = _lengths(5, task, q)
    assert lengths[0, 0, UP] == lengths[0, 0, LEFT] == 1 + 7
    assert lengths[2, 4, RIGHT] == 1 + 3


def test_a_policy_that_loops_never_arrives_and_others_are_not_touched(tasks_of: Any) -> None:
    # to column 0, then up to the goal; but (2, 2) and (2, 3) send each other back
    actions = [[LEFT] * 4, [UP, LEFT, LEFT, LEFT], [UP, LEFT, RIGHT, LEFT], [UP, LEFT, LEFT, LEFT]]
    lengths = _lengths(4, tasks_of(Gridworld(size=4), (0, 0, 0.9)), _greedy(4, actions))
    to_the_loop = {(2, 2, RIGHT), (2, 3, LEFT), (2, 3, RIGHT), (2, 1, RIGHT)}  # (2, 3) pushes the wall
    to_the_loop |= {(1, 2, DOWN), (1, 3, DOWN), (3, 2, UP), (3, 3, UP)}
    found = {tuple(int(each) for each in place) for place in np.argwhere(lengths == NEVER)}
    assert found == to_the_loop
    assert lengths[2, 2, LEFT] == 1 + 3  # the first step out of the loop is none of it
    assert lengths[3, 3, LEFT] == 1 + 5


def test_a_policy_that_pushes_a_wall_for_ever_never_arrives(tasks_of: Any) -> None:
    actions = [[UP, LEFT, LEFT], [UP, UP, UP], [UP, UP, UP]]  # all end in the corner (0, 0), pushing
    lengths = _lengths(3, tasks_of(Gridworld(size=3), (2, 2, 0.9)), _greedy(3, actions))
    into_the_goal = {(1, 2, DOWN), (2, 1, RIGHT)}
    goal = {(2, 2, action) for action in range(4)}
    found = {tuple(int(each) for each in place) for place in np.argwhere(lengths != NEVER)}
    assert found == into_the_goal | goal


TO_THE_RIGHT_THEN_DOWN = [[RIGHT] * 3 + [DOWN]] * 4


def test_among_equally_likely_next_cells_the_intended_one_is_meant(tasks_of: Any) -> None:
    task = tasks_of(Gridworld(size=4), (3, 3, 0.25))  # every direction has a probability of 1/4
    lengths = _lengths(4, task, _greedy(4, TO_THE_RIGHT_THEN_DOWN))
    assert lengths[1, 0, RIGHT] == 5
    assert lengths[2, 1, RIGHT] == 3
    assert lengths[1, 1, LEFT] == 1 + 5
    assert lengths[1, 0, LEFT] == 1 + 5  # staying is as likely as any, and is what was meant


def test_in_a_corner_staying_is_likeliest_below_two_fifths(tasks_of: Any) -> None:
    # two of four directions are walls: staying has 2 (1 - p) / 3, the intended move p; equal at p = 0.4
    for p, length in ((0.39, NEVER), (0.4, 6), (0.41, 6)):
        task = tasks_of(Gridworld(size=4), (3, 3, p))
        lengths = _lengths(4, task, _greedy(4, TO_THE_RIGHT_THEN_DOWN))
        assert lengths[0, 0, RIGHT] == length, p


def test_where_the_intended_cell_is_not_among_the_likeliest_the_lowest_index_is_meant(tasks_of: Any) -> None:
    # p below 1/4 is never drawn; each unintended neighbour has 0.3. Greedy DOWN goes up, to the goal row
    actions = [[LEFT] * 5, *[[DOWN] * 5] * 4]
    lengths = _lengths(5, tasks_of(Gridworld(size=5), (0, 2, 0.1)), _greedy(5, actions))
    assert lengths[2, 2, DOWN] == lengths[2, 2, LEFT] == lengths[2, 2, RIGHT] == 2
    assert lengths[2, 2, UP] == NEVER  # goes left, then up along column 1, and stays at the wall


def test_the_first_of_equal_actions_is_the_greedy_one(tasks_of: Any) -> None:
    lengths = _lengths(3, tasks_of(Gridworld(size=3), (0, 1, 0.9)), np.zeros((1, 9, 4)))  # all go up
    assert lengths[2, 1, UP] == 2
    assert lengths[2, 0, UP] == NEVER


def test_solved_is_what_reaches_the_goal_within_the_horizon(tasks_of: Any) -> None:
    grid = Gridworld(size=4)
    task = tasks_of(grid, (3, 3, 0.9))
    arrives = _greedy(4, TO_THE_RIGHT_THEN_DOWN)
    lost = np.zeros_like(arrives)
    q = np.concatenate([arrives, lost])
    tasks = np.concatenate([task, task])
    assert grid.solved(tasks, q, 6).tolist() == [True, False]
    assert grid.solved(tasks, q, 5).tolist() == [False, False]


@pytest.mark.parametrize("linear", [False, True])
def test_nearness_is_one_at_the_goal_and_falls_with_the_manhattan_distance(
    linear: bool, tasks_of: Any
) -> None:
    grid = Gridworld(size=6)
    goals = (4, 1), (0, 5)
    found = grid.nearness(tasks_of(grid, (*goals[0], 0.7), (*goals[1], 0.9)), 0.9, linear=linear)
    for values, goal in zip(found.reshape(2, 6, 6), goals, strict=True):
        distance = _distance(6, goal)
        np.testing.assert_allclose(values, 1 - distance / 10 if linear else 0.9**distance)


def test_figure_2_of_the_paper(tasks_of: Any) -> None:
    """The orange circle's lengths, 4 and 7, are those of (6, 7), among others. The green circle's, 17 and 5, belong to no cell.

    From goal [8, 9] to goal [4, 2] a length changes by an even number on an open grid: the figure contradicts itself there.
    """
    grid = Gridworld(size=10)
    lengths = []
    for goal in ((8, 9), (4, 2)):
        task = tasks_of(grid, (*goal, 0.75))
        q, _ = grid.solve(task, 0.95)
        lengths.append(_lengths(10, task, q).min(axis=2))
    first, second = lengths
    assert (first[6, 7], second[6, 7]) == (4, 7)
    assert np.argwhere(first == 17).tolist() == [[0, 0]]
    assert second[0, 0] == 6
    assert not ((first == 17) & (second == 5)).any()
