"""Learners come to what theory says of them: exact tables by quantecon, and the cliff of Sutton & Barto (2018), example 6.6."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import pytest
import test_learners
import test_loop
from quantecon.markov import DiscreteDP

from qinit_cli.kernels.batch import Learned, Records, Start, learn
from qinit_cli.kernels.tables import Tables
from qinit_cli.kernels.worlds import GOAL, LOST
from qinit_cli.learners.one_step import DoubleQ, ExpectedSarsa, QLearner, Sarsa
from qinit_cli.learners.optimistic import DelayedQ, RMax
from qinit_cli.learning import Learning
from qinit_cli.schedules import ByVisits, Exponential
from qinit_cli.watch import Watch

GAMMA, EPISODES, TASKS = 0.9, 200_000, test_loop.TASKS
OPEN = test_loop.STATES - 1  # nobody acts in the last state
# Exponents above 1/2 and at most 1: the sum of step sizes diverges, that of their squares does not (Robbins & Monro, 1951)
USUAL = Learning(
    alpha=ByVisits(0.7),
    gamma=GAMMA,
    epsilon=Exponential(0.6, 1.0, 0.6),  # a schedule, so that the loops are those of test_learners.py
    episodes=EPISODES,
    horizon=20,
    start="anywhere",
)
# After n updates the step size is n^-0.7, and a value deviates by about the root of half of that times its target's variance,
# which is at most 1/4: 0.021 after the 3,000 that every pair has. Three of those, since the largest of 48 is looked at.
LEAST_UPDATES, TOLERANCE = 3_000, 0.063


@cache
def problem(task: int) -> DiscreteDP:
    """A table's task as quantecon takes it, the goal and being lost as two more states that stay."""
    tables = test_loop.tables()
    after, odds = tables.after[task], tables.probability[task]
    states, actions, _ = after.shape
    flows = np.zeros((states + 2, actions, states + 2))
    for state in range(states):
        for action in range(actions):
            there = after[state, action]
            np.add.at(
                flows[state, action], np.where(there < 0, states - 1 - there, there), odds[state, action]
            )
    flows[states:, :, states:] = np.eye(2)[:, None, :]
    rewards = flows[:, :, states].copy()
    rewards[states:] = 0
    return DiscreteDP(rewards, flows, GAMMA)


def exact(task: int) -> tuple[np.ndarray, np.ndarray]:
    """Q* (S, A) and V* (S,) of the states where one acts."""
    given = problem(task)
    value = given.solve(method="policy_iteration").v
    return (given.R + GAMMA * given.Q @ value)[:OPEN], value[:OPEN]


def exploring(task: int, epsilon: float) -> np.ndarray:
    """The table (S, A) that is right for a policy which is epsilon-greedy in it: (1 - epsilon) of the largest value counts, and
    epsilon of the mean."""
    given = problem(task)
    value = np.zeros(len(given.R))
    for _ in range(500):
        q = given.R + GAMMA * given.Q @ value
        value = (1 - epsilon) * q.max(axis=1) + epsilon * q.mean(axis=1)
    return q[:OPEN]


def loss(task: int, q: np.ndarray) -> float:
    """What the greedy policy of q earns less than the best, in the state where that is most."""
    policy = np.append(q.argmax(axis=1), np.zeros(3, int))
    return float((exact(task)[1] - problem(task).evaluate_policy(policy)[:OPEN]).max())


def learned_by(learner: Any, start: float = 0.0, **settings: Any) -> Learned:
    learning = replace(USUAL, learner=learner, **settings)
    table = np.full((test_loop.STATES, test_loop.ACTIONS), start)
    records = Records(1, visits=True, td_var=True, evaluate_every=EPISODES)
    return learn(test_loop.worlds(), learning, Start(table), test_learners.streams(TASKS), records, Watch())


@pytest.mark.parametrize("learner", [QLearner(), DoubleQ()], ids=str)
def test_off_policy_learners_come_to_the_exact_table(learner: Any) -> None:
    learned = learned_by(learner)
    assert learned.visits[:, :OPEN].min() > LEAST_UPDATES
    for task in range(TASKS):
        np.testing.assert_allclose(learned.q[task, :OPEN], exact(task)[0], rtol=0, atol=TOLERANCE)


@pytest.mark.parametrize("learner", [Sarsa(), ExpectedSarsa()], ids=str)
def test_on_policy_learners_come_to_the_table_of_the_policy_that_explores(learner: Any) -> None:
    learned = learned_by(learner)
    assert learned.visits[:, :OPEN].min() > LEAST_UPDATES
    for task in range(TASKS):
        right = exploring(task, 0.6)
        assert np.abs(right - exact(task)[0]).max() > 2 * TOLERANCE  # no table is near both
        np.testing.assert_allclose(learned.q[task, :OPEN], right, rtol=0, atol=TOLERANCE)


@pytest.mark.parametrize("learner", [Sarsa(), ExpectedSarsa()], ids=str)
def test_on_policy_learners_come_to_the_exact_values_as_exploring_ends(learner: Any) -> None:
    learned = learned_by(learner, epsilon=Exponential(1.0, 0.001 ** (1 / EPISODES), 0.0))
    for task in range(TASKS):
        values = learned.q[task, :OPEN].max(axis=1)
        np.testing.assert_allclose(values, exact(task)[1], rtol=0, atol=TOLERANCE)
        assert loss(task, learned.q[task, :OPEN]) < TOLERANCE


@pytest.mark.parametrize("learner", [DelayedQ(m=100), RMax(known=100)], ids=str)
def test_optimistic_learners_come_near_the_best_policy_without_exploring(learner: Any) -> None:
    learned = learned_by(learner, start=1.0, alpha=0.1, epsilon=0.0)
    for task in range(TASKS):
        assert loss(task, learned.q[task, :OPEN]) < 0.05
        assert loss(task, -learned.q[task, :OPEN]) > 0.5  # the worst policy's: something can be lost here


ROWS, COLUMNS = 4, 12
MOVES = np.array([(-1, 0), (1, 0), (0, -1), (0, 1), (0, 0)])  # and staying, which makes rows wide as above


def cliffs(tasks: int) -> Tables:
    """From the lower left corner to the lower right; who steps on a cell between them falls, and is lost."""
    cells = np.arange(ROWS * COLUMNS)
    places = np.stack(divmod(cells, COLUMNS), axis=1)[:, None] + MOVES
    row, column = np.clip(places, 0, [ROWS - 1, COLUMNS - 1]).transpose(2, 0, 1)
    after = row * COLUMNS + column
    after = np.where((row == ROWS - 1) & (column > 0), np.where(column == COLUMNS - 1, GOAL, LOST), after)
    after = np.tile(after[None, :, :, None], (tasks, 1, 1, 1)).astype(np.int32)
    start = (cells == (ROWS - 1) * COLUMNS).astype(float)
    return Tables(after, np.ones(after.shape), np.tile(start, (tasks, 1)), np.tile(cells <= 36, (tasks, 1)))


def greedy_way(q: np.ndarray, after: np.ndarray) -> list[int]:
    """The cells that the greedy way from the start leaves, until it ends or has lasted too long."""
    cell, way = (ROWS - 1) * COLUMNS, []
    while cell >= 0 and len(way) < 100:
        way.append(int(cell))
        cell = after[cell, q[cell].argmax(), 0]
    return way


def on_the_cliff(learner: Any, tasks: int = 3) -> tuple[list[list[int]], float]:
    """The greedy ways, and the share of the later episodes that reached the goal, exploring."""
    learning = replace(USUAL, learner=learner, gamma=0.95, epsilon=Exponential(0.3, 1.0, 0.3), horizon=200)
    tables = cliffs(tasks)
    worlds = tables.worlds(np.zeros((tasks, 4), np.uint64))
    records = Records(2, visits=True, td_var=True, evaluate_every=EPISODES)
    start = Start(np.zeros((ROWS * COLUMNS, len(MOVES))))
    learned = learn(worlds, learning, start, test_learners.streams(tasks), records, Watch())
    ways = [greedy_way(q, tables.after[0]) for q in learned.q]
    return ways, float(learned.reached[:, 1].mean() / (EPISODES // 2))


def test_sarsa_keeps_away_from_the_cliff_and_q_learning_walks_along_its_edge() -> None:
    """Sutton & Barto (2018), example 6.6, with a reward for arriving, discounted, in place of costs for steps and falls."""
    edge = list(range(2 * COLUMNS + 1, 3 * COLUMNS - 1))  # the cells above those from which one falls
    along, q_learnings = on_the_cliff(QLearner())
    away, sarsas = on_the_cliff(Sarsa())
    for shortest in along:
        assert shortest == [3 * COLUMNS, 2 * COLUMNS, *edge, 3 * COLUMNS - 1]
    for safe in away:
        assert 15 <= len(safe) <= 17  # by one of the two rows farther up
        assert not set(safe) & set(edge)
    assert sarsas > q_learnings
