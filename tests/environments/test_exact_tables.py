from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from quantecon.markov import DiscreteDP

from qinit_cli.environments.gridworld import Gridworld

GRID = Gridworld(size=7)
TASKS = (
    (4, 5, 0.75),
    (3, 3, 0.6),
    (0, 0, 0.9),
    (0, 6, 0.62),
    (6, 0, 0.8),
    (6, 6, 0.7),
    (0, 3, 0.25),
    (5, 1, 1.0),
)


@pytest.mark.parametrize("drawn", TASKS, ids=str)
@pytest.mark.parametrize("gamma", [0.95, 0.6])
def test_exact_tables_are_those_of_an_independent_solver(
    drawn: tuple[int, int, float], gamma: float, tasks_of: Any, model: Any
) -> None:
    q, _ = GRID.solve(tasks_of(GRID, drawn), gamma)
    grid = model(GRID.size, drawn[:2], drawn[2])
    solver = DiscreteDP(grid.rewards(), grid.transitions(), gamma)
    value = solver.solve(method="policy_iteration").v
    expected = grid.rewards() + gamma * grid.transitions() @ value
    np.testing.assert_allclose(q[0], expected, rtol=0, atol=1e-9)


def test_values_that_are_smaller_than_the_tolerance_are_exact_too(tasks_of: Any) -> None:
    grid, gamma, p = Gridworld(size=30), 0.5, 0.7
    q, _ = grid.solve(tasks_of(grid, (20, 20, p)), gamma)
    goal, value = 20 * 30 + 20, q[0].max(axis=1)
    rows, columns = np.divmod(np.arange(900), 30)
    ways = [(np.clip(rows + down, 0, 29), columns) for down in (-1, 1)]
    ways += [(rows, np.clip(columns + right, 0, 29)) for right in (-1, 1)]
    cells = np.stack([row * 30 + column for row, column in ways], axis=1)
    worth = np.where(cells == goal, 1.0, gamma * value[cells])
    expected = (p - 0.1) * worth + 0.1 * worth.sum(axis=1, keepdims=True)
    elsewhere = np.arange(900) != goal
    assert value[elsewhere].min() < 1e-13
    # from V(s) = max Q(s, a): a table that had not settled would not give itself back
    np.testing.assert_allclose(expected.max(axis=1)[elsewhere], value[elsewhere], rtol=1e-9)


def test_the_known_value_of_the_papers_grid(tasks_of: Any) -> None:
    grid = Gridworld()
    q, _ = grid.solve(tasks_of(grid, (20, 20, 0.75)), 0.95)
    assert grid.start_value(q)[0] == pytest.approx(0.056768479844764, abs=1e-12)


def test_a_sure_move_makes_values_powers_of_gamma(tasks_of: Any) -> None:
    q, _ = GRID.solve(tasks_of(GRID, (4, 5, 1.0)), 0.95)
    rows, columns = np.indices((7, 7))
    distance = (abs(rows - 4) + abs(columns - 5)).ravel()
    elsewhere = distance > 0
    np.testing.assert_allclose(q[0].max(axis=1)[elsewhere], 0.95 ** (distance - 1.0)[elsewhere], rtol=1e-12)


def test_without_discount_every_value_is_one(tasks_of: Any) -> None:
    grid = Gridworld(size=4)
    q, _ = grid.solve(tasks_of(grid, (2, 1, 0.7)), 1.0)
    elsewhere = np.arange(16) != 2 * 4 + 1
    np.testing.assert_allclose(q[0, elsewhere], 1.0, rtol=0, atol=1e-9)


def test_nothing_is_to_be_had_at_the_goal(tasks_of: Any) -> None:
    q, td_var = GRID.solve(tasks_of(GRID, (2, 3, 0.8)), 0.95)
    assert not q[0, 2 * 7 + 3].any()
    assert not td_var[0, 2 * 7 + 3].any()


def test_tasks_of_a_batch_do_not_touch_each_other(tasks_of: Any) -> None:
    together, _ = GRID.solve(tasks_of(GRID, *TASKS), 0.95)
    alone = np.concatenate([GRID.solve(tasks_of(GRID, one), 0.95)[0] for one in TASKS])
    np.testing.assert_array_equal(together, alone)


@pytest.mark.parametrize("drawn", TASKS[:6], ids=str)
def test_td_variance_is_the_expectation_of_the_squared_error(
    drawn: tuple[int, int, float], tasks_of: Any, model: Any
) -> None:
    gamma = 0.95
    q, td_var = GRID.solve(tasks_of(GRID, drawn), gamma)
    grid = model(GRID.size, drawn[:2], drawn[2])
    worth = gamma * q[0].max(axis=1)
    worth[grid.goal_cell] = 1
    expected = np.empty_like(td_var[0])
    for cell in range(GRID.size**2):
        for action in range(4):
            error = worth - q[0, cell, action]
            expected[cell, action] = grid.transitions()[cell, action] @ error**2
    expected[grid.goal_cell] = 0
    np.testing.assert_allclose(td_var[0], expected, rtol=1e-9, atol=1e-15)


def _value_of_exploring(grid: Any, q: Any, gamma: float, epsilon: float) -> float:
    """From the cell (0, 0), by a linear solve of the chain."""
    best = q == q.max(axis=1, keepdims=True)
    probability = epsilon / 4 + (1 - epsilon) * best / best.sum(axis=1, keepdims=True)
    chain = np.einsum("sa,sat->st", probability, grid.transitions())
    reward = (probability * grid.rewards()).sum(axis=1)
    reward[grid.goal_cell] = 0
    return float(np.linalg.solve(np.eye(len(chain)) - gamma * chain, reward)[0])


@pytest.mark.parametrize("epsilon", [0.0, 0.1, 1.0])
@pytest.mark.parametrize("drawn", [(4, 5, 0.75), (6, 6, 0.6), (0, 1, 0.9)], ids=str)
def test_the_value_of_exploring_solves_its_linear_equations(
    drawn: tuple[int, int, float], epsilon: float, tasks_of: Any, model: Any
) -> None:
    tasks = tasks_of(GRID, drawn)
    learning = replace(GRID.target_learning, epsilon=epsilon)
    q, _ = GRID.solve(tasks, learning.gamma)
    expected = _value_of_exploring(
        model(GRID.size, drawn[:2], drawn[2]), q[0], learning.gamma, learning.epsilon
    )
    assert GRID.exploring_value(tasks, q, learning)[0] == pytest.approx(expected, rel=1e-9)


def test_tied_actions_are_shared_equally_in_the_value_of_exploring(tasks_of: Any, model: Any) -> None:
    probability = np.random.default_rng(5)
    tied = probability.integers(0, 2, (1, GRID.size**2, 4)).astype(float)
    assert ((tied == tied.max(axis=2, keepdims=True)).sum(axis=2) > 1).any()
    found = GRID.exploring_value(tasks_of(GRID, (3, 2, 0.7)), tied, GRID.target_learning)[0]
    learning = GRID.target_learning
    expected = _value_of_exploring(model(7, (3, 2), 0.7), tied[0], learning.gamma, learning.epsilon)
    assert found == pytest.approx(expected, rel=1e-9)


def test_acting_greedily_on_exact_tables_is_worth_their_value(tasks_of: Any) -> None:
    tasks = tasks_of(GRID, (4, 5, 0.75))
    q, _ = GRID.solve(tasks, 0.95)
    greedy = GRID.exploring_value(tasks, q, replace(GRID.target_learning, epsilon=0.0))
    np.testing.assert_allclose(greedy, GRID.start_value(q), rtol=1e-11)


def test_exploring_costs_something(tasks_of: Any) -> None:
    tasks = tasks_of(GRID, (4, 5, 0.75))
    q, _ = GRID.solve(tasks, 0.95)
    assert GRID.exploring_value(tasks, q, GRID.target_learning)[0] < GRID.start_value(q)[0]
