"""Rewards other than 1 at the goal in the compiled loop, against the plain one: to the last bit."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
import reference
import test_learners
import test_loop
import test_posterior
from learner_reference import flipped
from test_learners import ALL, EPISODES, EVERY, GRIDS, TABLES, USUAL, plainly_learned, streams

from qinit_cli.errors import NotAllowed
from qinit_cli.kernels.batch import Learned, Policies, Start, learn
from qinit_cli.kernels.posterior import Hypotheses
from qinit_cli.kernels.tables import Tables
from qinit_cli.kernels.worlds import GOAL, LOST
from qinit_cli.learners.one_step import DoubleQ, ExpectedSarsa, QLearner, Sarsa
from qinit_cli.learners.optimistic import RMax
from qinit_cli.learning import Learning
from qinit_cli.rewards import PaidRange, Payment, ReturnBounds, payment
from qinit_cli.watch import Watch

RULES = {"c": 0.2, "psi0": 0.9, "rho": 0.97, "nu": 0.95}
TOLD = Payment(ReturnBounds(-40.0, 60.0), None, 0.0)
STEP = payment("step", USUAL.gamma)


def paid_tables(tasks: Any = slice(None)) -> Tables:
    rewards = np.random.default_rng(8).uniform(-2, 3, test_loop.tables().after.shape)
    return replace(test_loop.tables(tasks), reward=rewards[tasks])


class PaidTable(test_loop.Table):
    """One task of them, whose step tells its reward; or pays -1, and -1 for ever where it is lost."""

    paid = 0.0

    def __init__(self, *given: Any, step: bool = False) -> None:
        super().__init__(*given)
        self.rewards, self.each = paid_tables().reward[given[1]], step

    def step(self, draw: int, action: int, draws: Any = None) -> bool:
        number, limits = (draw >> 32) * 2.0**-32, np.cumsum(self.probability[self.state, action])
        possible = np.flatnonzero(self.probability[self.state, action])
        outcome = next((one for one in possible if number < limits[one]), possible[-1])
        self.paid = float(self.rewards[self.state, action, outcome])
        reached = super().step(draw, action, draws)
        if self.each:
            self.paid = -1.0 + (STEP.lost if self.lost else 0.0)
        return reached


class PaidGrid(reference.Gridworld):
    """A gridworld where every step pays -1."""

    paid = -1.0


class TablesThatTell(test_learners.WideTables):
    def worlds(self, tasks: Any = slice(None)) -> Any:
        some = paid_tables(tasks)
        return some.worlds(np.zeros((len(some), 4), np.uint64))

    def plain(self, task: int, anywhere: bool, starts: Any) -> Any:
        return PaidTable(test_loop.tables(), task, anywhere, starts)


class TablesByStep(test_learners.WideTables):
    def plain(self, task: int, anywhere: bool, starts: Any) -> Any:
        return PaidTable(test_loop.tables(), task, anywhere, starts, step=True)


class GridsByStep(test_learners.Grids):
    def plain(self, task: int, anywhere: bool, starts: Any) -> Any:
        return PaidGrid(5, int(self.goals[task]), float(self.p[task]), None if anywhere else 0, starts)


def learned_by(family: Any, learning: Learning, start: Start, paid: Payment | None) -> Learned:
    return learn(family.worlds(), learning, start, streams(family.tasks), ALL, Watch(), payment=paid)


CASES: list[tuple[Any, Payment | None, bool, dict[str, Any]]] = [
    (TablesThatTell(), TOLD, True, {"learner": QLearner()}),
    (TablesThatTell(), TOLD, False, {"learner": Sarsa()}),
    (TablesThatTell(), TOLD, False, {"learner": DoubleQ()}),
    (TablesThatTell(), TOLD, False, {"learner": RMax(2), "epsilon": 0.2}),
    (TablesByStep(), STEP, False, {"learner": ExpectedSarsa()}),
    (GridsByStep(), STEP, False, {"learner": QLearner()}),
]


@pytest.mark.parametrize(("family", "paid", "shaped", "settings"), CASES, ids=test_learners.named)
def test_what_steps_pay_is_learned_as_the_plain_loop_learns_it(
    family: Any, paid: Payment, shaped: bool, settings: dict[str, Any]
) -> None:
    phi = test_learners.potential_of(family) if shaped else None
    learning, start = replace(USUAL, **settings), Start(test_learners.table_of(family), phi)
    learned = learned_by(family, learning, start, paid)
    for task in range(family.tasks):
        outcome = plainly_learned(family, learning, start, task)
        test_learners.assert_same(learned, task, outcome)
        if paid is TOLD:
            np.testing.assert_array_equal(learned.returns[task], outcome.returns)
            np.testing.assert_array_equal(learned.evaluation_returns[task], outcome.evaluated)
    assert (learned.returns is None) == (paid is not TOLD)


def test_policies_are_credited_with_the_share_of_the_attainable_return() -> None:
    family, learning = TablesThatTell(), replace(USUAL, episodes=ALL.bins)
    policies = np.random.default_rng(3).integers(0, family.actions, (5, family.states))
    start = Start(test_learners.table_of(family), None, Policies(policies, **RULES))
    learned = learned_by(family, learning, start, TOLD)
    given = streams(family.tasks)
    for task in range(family.tasks):
        choices = Credited(policies, reference.xoshiro(given.choices[task]), learning.gamma, **RULES)
        outcome = reference.learn(
            family.plain(task, True, reference.xoshiro(given.starts[task])),
            learning,
            start.table,
            reference.in_lanes(given.rng[task]),
            every=EVERY,
            evaluation=reference.xoshiro(given.evaluation[task]),
            choices=choices,
            coins=flipped(reference.xoshiro(given.learner[task])),
        )
        test_learners.assert_same(learned, task, outcome)


@pytest.mark.parametrize(("centred", "geometric"), [(False, False), (True, True)])
def test_hypotheses_are_weighed_by_the_errors_of_returns(centred: bool, geometric: bool) -> None:
    family, random = TablesThatTell(), np.random.default_rng(4)
    shares = random.random((5, family.states, family.actions)) * (random.random((5, family.states, 1)) < 0.9)
    rules = {"temperature": 0.05, "floor": 0.05, "excess": 0.0, "cap": 5.0, "freeze": 20, "threshold": 0.05}
    hypotheses = Hypotheses(
        shares, np.full(shares.shape, 0.01), **rules, geometric=geometric, centred=centred, bounds=TOLD.bounds
    )
    table = TOLD.bounds.returns(np.nan_to_num(hypotheses.mean()))
    given, start = streams(family.tasks), Start(table, hypotheses=hypotheses)
    records = replace(ALL, moments=np.array([0, 5, EPISODES]))
    learned = learn(family.worlds(), USUAL, start, given, records, Watch(), payment=TOLD)
    assert learned.weighing is not None
    for task in range(family.tasks):
        weighed = test_posterior.weighed_by(hypotheses, USUAL)
        outcome = reference.learn(
            family.plain(task, True, reference.xoshiro(given.starts[task])),
            USUAL,
            table,
            reference.in_lanes(given.rng[task]),
            every=EVERY,
            evaluation=reference.xoshiro(given.evaluation[task]),
            weighed=weighed,
        )
        np.testing.assert_array_equal(learned.steps[task], outcome.steps)
        np.testing.assert_allclose(learned.q[task], outcome.q, rtol=0, atol=1e-9)
        told = np.array([weighed.history[min(at, len(weighed.history) - 1)] for at in (0, 5, EPISODES)])
        np.testing.assert_allclose(learned.weighing.weights[task], told, rtol=0, atol=1e-9)
        assert learned.weighing.moves[task] == weighed.moves > 2


class Credited(reference.Choices):
    """Choices that are credited with (return - low) / (high - low)."""

    def share(self, length: int, reached: bool, gained: float) -> float:
        return (gained - TOLD.bounds.low) / TOLD.bounds.width


@pytest.mark.parametrize("family", [GRIDS, TABLES])
def test_paying_by_the_goal_is_what_no_payment_is(family: Any) -> None:
    assert payment("goal", 0.95) is None
    start = Start(test_learners.table_of(family))
    one = learned_by(family, USUAL, start, None)
    other = test_learners.learned_by(family, USUAL, start)
    np.testing.assert_array_equal(one.q, other.q)


def test_a_world_that_notes_no_rewards_is_refused() -> None:
    with pytest.raises(ValueError, match="TableWorld notes no rewards"):
        learned_by(TABLES, USUAL, Start(test_learners.table_of(TABLES)), TOLD)


def test_the_bounds_of_a_return_come_from_the_least_and_the_largest_rewards() -> None:
    # 0 on the way, -1 or 1.5 at an end: a hand of Blackjack
    assert PaidRange((0.0, 0.0), (-1.0, 1.5)).bounds(0.9) == ReturnBounds(-1.0, 1.5)
    # -1 or -10 on the way, 20 or -10 at an end: Taxi, where -10 for ever is the worst
    assert PaidRange((-10.0, -1.0), (-10.0, 20.0)).bounds(0.5) == ReturnBounds(-20.0, 20.0)
    # 1 on the way and at the end: the pole that is kept up
    assert PaidRange((1.0, 1.0), (1.0, 1.0)).bounds(0.75) == ReturnBounds(0.0, 4.0)
    assert payment("step", 0.75).bounds == ReturnBounds(-4.0, 0.0)
    assert payment("step", 0.75).lost - 1 == -4.0  # the reward of the last step, and -1 for ever
    with pytest.raises(ValueError, match="give --gamma below 1"):
        payment("step", 1.0)


def test_a_gain_is_what_a_reward_adds_to_the_share_of_the_attainable_return() -> None:
    after = np.array([[[[1, GOAL]], [[1, LOST]]]], np.int32)  # two states, an action, two outcomes
    half, open = np.full(after.shape, 0.5), np.ones((1, 2), bool)
    rewards = np.array([[[[-1.0, 5.0]], [[2.0, -3.0]]]])
    tables = Tables(after, half, np.array([[1.0, 0.0]]), open, rewards)
    # with gamma 0.5 and returns from -4 to 6 a step that goes on adds (r + 2) / 10, one that ends (r + 4) / 10
    np.testing.assert_allclose(
        tables.gains(ReturnBounds(-4.0, 6.0), 0.5), [[[[0.1, 0.9]], [[0.4, 0.1]]]], rtol=0, atol=1e-15
    )
    with pytest.raises(NotAllowed, match="the tables have no rewards"):
        test_loop.tables().gains(ReturnBounds(-4.0, 6.0), 0.5)
