"""Exact tables of transition tables, against the gridworld's own, quantecon, and answers worked out by hand."""

from __future__ import annotations

import numpy as np
import pytest
import quantecon

from qinit_cli.environments.family import draw_tasks
from qinit_cli.environments.gridworld import Gridworld
from qinit_cli.grid_map import open_map
from qinit_cli.kernels import tables_exact
from qinit_cli.kernels.tables import Tables
from qinit_cli.kernels.worlds import GOAL, LOST
from qinit_cli.learning import Learning
from qinit_cli.seeding import Stream

GAMMA, TOLERANCE = 0.95, 1e-12
FAMILY = Gridworld(size=6, goals="uniform")
TASKS = draw_tasks(FAMILY, 0, Stream.SOURCE_TASK, np.arange(4))


def gridworlds() -> Tables:
    """Gridworld tasks as anybody would write their tables."""
    goal = TASKS["goal_row"] * FAMILY.size + TASKS["goal_col"]
    moves = open_map(FAMILY.size).moves.astype(np.int32)
    ways = np.broadcast_to(moves[:, None, :], (len(moves), 4, 4))  # whatever is meant, four ways are possible
    after = np.where(ways == goal[:, None, None, None], GOAL, ways).astype(np.int32)
    p = TASKS["p"][:, None, None]
    probability = np.broadcast_to((p * np.eye(4) + (1 - p) / 3 * (1 - np.eye(4)))[:, None], after.shape)
    start = np.zeros((len(TASKS), len(moves)))
    start[:, 0] = 1
    return Tables(after, probability, start, np.arange(len(moves)) != goal[:, None])


def solved(tables: Tables, gamma: float = GAMMA) -> tuple[np.ndarray, np.ndarray]:
    q = np.empty(tables.after.shape[:3])
    td_var = np.empty_like(q)
    tables_exact.solve(tables.after, tables.probability, tables.open, None, gamma, TOLERANCE, q, td_var)
    return q, td_var


def test_a_gridworld_written_as_a_table_has_the_gridworlds_exact_tables() -> None:
    q, td_var = solved(gridworlds())
    exact, exact_var = FAMILY.solve(TASKS, GAMMA)
    np.testing.assert_allclose(q, exact, rtol=1e-8, atol=0)
    np.testing.assert_allclose(td_var, exact_var, rtol=1e-6, atol=1e-15)


def test_its_path_lengths_are_the_gridworlds_too() -> None:
    tables, (exact, _) = gridworlds(), FAMILY.solve(TASKS, GAMMA)
    eopl = np.empty(exact.shape, np.int32)
    tables_exact.path_lengths(tables.after, tables.probability, tables.open, exact, eopl)
    expected = FAMILY.path_lengths(TASKS, exact, 1000)
    np.testing.assert_array_equal(eopl[tables.open], expected[tables.open])


def test_exploring_is_worth_what_it_is_in_the_gridworld() -> None:
    tables, (exact, _) = gridworlds(), FAMILY.solve(TASKS, GAMMA)
    value = np.empty(exact.shape[:2])
    tables_exact.exploring_value(
        tables.after, tables.probability, tables.open, None, GAMMA, 0.1, TOLERANCE, exact, value
    )
    learning = Learning(alpha=0.1, gamma=GAMMA, epsilon=0.1, episodes=1, horizon=1, start="fixed")
    np.testing.assert_allclose(value[:, 0], FAMILY.exploring_value(TASKS, exact, learning), rtol=1e-9)


def test_quantecon_finds_the_same_values_where_a_way_can_be_lost() -> None:
    """Random tables; quantecon is given the two ends as absorbing states."""
    random = np.random.default_rng(7)
    states, actions = 12, 5
    after = random.integers(-2, states, (1, states, actions, 3)).astype(np.int32)
    probability = random.dirichlet(np.ones(3), (1, states, actions))
    open = np.ones((1, states), bool)
    q, _ = solved(Tables(after, probability, np.eye(1, states), open))
    flows = np.zeros((states + 2, actions, states + 2))
    for state in range(states):
        for action in range(actions):
            for there, odds in zip(after[0, state, action], probability[0, state, action], strict=True):
                flows[state, action, there if there >= 0 else states - 1 - there] += odds
    flows[states:, :, states:] = np.eye(2)[:, None, :]
    rewards = flows[:, :, states].copy()
    rewards[states:] = 0
    problem = quantecon.markov.DiscreteDP(rewards, flows, GAMMA)
    value = problem.solve(method="policy_iteration").v[:states]
    np.testing.assert_allclose(q[0].max(axis=1), value, rtol=1e-9)


def chain() -> Tables:
    """0 -> 1 -> 2 -> goal by action 0, each step with probability 0.9, else lost; action 1 stays for ever."""
    after = np.array([[[[1, LOST], [0, 0]], [[2, LOST], [1, 1]], [[GOAL, LOST], [2, 2]]]], np.int32)
    probability = np.tile([[[0.9, 0.1], [1.0, 0.0]]], (1, 3, 1, 1))
    return Tables(after, probability, np.eye(1, 3), np.ones((1, 3), bool))


def test_a_chain_is_worth_what_one_computes_by_hand() -> None:
    q, td_var = solved(chain())
    v = [0.9 * (0.9 * GAMMA) ** 2, 0.9 * 0.9 * GAMMA, 0.9]
    np.testing.assert_allclose(q[0], [[v[0], GAMMA * v[0]], [v[1], GAMMA * v[1]], [v[2], GAMMA * v[2]]])
    # the last step's target is 1 with probability 0.9, else 0
    np.testing.assert_allclose(td_var[0, 2], [0.9 * 0.1, 0.0], atol=1e-15)
    eopl = np.empty((1, 3, 2), np.int32)
    tables_exact.path_lengths(chain().after, chain().probability, chain().open, q, eopl)
    np.testing.assert_array_equal(eopl[0], [[3, 4], [2, 3], [1, 2]])


@pytest.mark.parametrize(("horizon", "share"), [(2, 0.0), (3, 0.729), (50, 0.729)])
def test_greedy_episodes_arrive_as_often_as_one_computes_by_hand(horizon: int, share: float) -> None:
    tables, (q, _) = chain(), solved(chain())
    found = np.empty(1)
    tables_exact.arrival(tables.after, tables.probability, tables.start, q, horizon, found)
    assert found[0] == pytest.approx(share)


def test_the_likeliest_way_is_followed_and_one_that_does_not_arrive_leaves_nothing() -> None:
    tables, (q, _) = chain(), solved(chain())
    visits = np.empty((1, 3), np.int32)
    tables_exact.greedy_visits(tables.after, tables.probability, tables.start, q, 3, visits)
    np.testing.assert_array_equal(visits[0], [1, 1, 1])
    tables_exact.greedy_visits(tables.after, tables.probability, tables.start, q, 2, visits)
    np.testing.assert_array_equal(visits[0], [0, 0, 0])


def test_the_nearest_way_counts_steps_and_no_way_is_none() -> None:
    tables, steps = chain(), np.empty(1, np.int64)
    tables_exact.distances(tables.after, tables.probability, tables.start, steps)
    assert steps[0] == 3
    shut = np.where(tables.after == GOAL, LOST, tables.after)
    tables_exact.distances(shut, tables.probability, tables.start, steps)
    assert steps[0] == tables_exact.NEVER


def test_equally_likely_states_are_told_apart_by_the_lowest_and_the_goal_comes_first() -> None:
    after = np.array([[[[2, 1], [LOST, 1], [LOST, GOAL]], [[1, 1]] * 3, [[GOAL, GOAL]] * 3]], np.int32)
    q = np.zeros((1, 3, 3))
    eopl = np.empty((1, 3, 3), np.int32)
    even = np.full(after.shape, 0.5)
    tables_exact.path_lengths(after, even, np.ones((1, 3), bool), q, eopl)
    np.testing.assert_array_equal(eopl[0], [[-1, -1, 1], [-1] * 3, [1] * 3])
