"""The loop that any compiled step runs in, through tables of transitions: against the plain reference, to the last bit."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
import reference

from qinit_cli.grid_map import open_map
from qinit_cli.kernels import random_streams as rng
from qinit_cli.kernels.batch import LaneStreams, Learned, Policies, Records, Start, learn
from qinit_cli.kernels.gridworld import Gridworlds
from qinit_cli.kernels.posterior import Hypotheses
from qinit_cli.kernels.tables import Tables
from qinit_cli.kernels.worlds import GOAL, LOST
from qinit_cli.learning import Learning
from qinit_cli.watch import Watch

TASKS, STATES, ACTIONS, OUTCOMES = 6, 9, 6, 3
EXPLORING = Learning(alpha=0.1, gamma=0.95, epsilon=0.5, episodes=60, horizon=40, start="anywhere")
GREEDY = Learning(alpha=0.2, gamma=0.9, epsilon=0.05, episodes=60, horizon=25, start="fixed")
ALL = Records(bins=60, visits=True, td_var=True)


def tables(tasks: slice | list[int] = slice(None)) -> Tables:
    """Random ones, with ways that end well and badly, an outcome of probability 0, and a state where nobody acts."""
    random = np.random.default_rng(3)
    after = random.integers(-2, STATES - 1, (TASKS, STATES, ACTIONS, OUTCOMES)).astype(np.int32)
    probability = random.dirichlet(np.ones(OUTCOMES), (TASKS, STATES, ACTIONS))
    probability[:, 0, 0] = 0.25, 0.0, 0.75
    start = np.zeros((TASKS, STATES))
    start[:, [1, 4]] = 0.25, 0.75
    open = np.ones((TASKS, STATES), bool)
    open[:, STATES - 1] = False
    return Tables(after[tasks], probability[tasks], start[tasks], open[tasks])


class Table:
    """One task, stepped through in plain Python."""

    def __init__(self, all_of_them: Tables, task: int, anywhere: bool, starts) -> None:
        self.after, self.probability = all_of_them.after[task], all_of_them.probability[task]
        self.start, self.open = all_of_them.start[task], np.flatnonzero(all_of_them.open[task])
        self.anywhere, self.starts = anywhere, starts
        self.states, self.actions, self.state, self.lost = STATES, ACTIONS, 0, False

    def reset(self) -> None:
        self.lost = False
        if self.anywhere:
            self.state = int(self.open[(next(self.starts) >> 32) * len(self.open) >> 32])
        else:
            self.reset_to_target(self.starts)

    def reset_to_target(self, draws) -> None:
        self.lost = False
        number, total = reference.unit(next(draws)), 0.0
        for state in np.flatnonzero(self.start):
            total += self.start[state]
            self.state = int(state)
            if number < total:
                return

    def step(self, draw: int, action: int, draws=None) -> bool:
        number, total = (draw >> 32) * 2.0**-32, 0.0
        for outcome in np.flatnonzero(self.probability[self.state, action]):
            total += self.probability[self.state, action, outcome]
            after = int(self.after[self.state, action, outcome])
            if number < total:
                break
        self.lost = after == LOST
        if after >= 0:
            self.state = after
        return after == GOAL


def probability(seed: int, tasks: int) -> LaneStreams:
    def streams(kind: int) -> list[np.random.SeedSequence]:
        return [np.random.SeedSequence(seed, spawn_key=(kind, task)) for task in range(tasks)]

    return LaneStreams(rng.lane_seeds(streams(0)), *(rng.seeds(streams(kind)) for kind in (1, 2, 3)))


def worlds(tasks: slice | list[int] = slice(None)):
    some = tables(tasks)
    return some.worlds(np.zeros((len(some), 4), np.uint64))


def start_table() -> np.ndarray:
    """With ties in it."""
    return np.random.default_rng(5).integers(0, 3, (STATES, ACTIONS)) / 8


def assert_same(learned: Learned, task: int, outcome: reference.Outcome) -> None:
    assert learned.finished[task]
    np.testing.assert_array_equal(learned.q[task], outcome.q)
    np.testing.assert_array_equal(learned.visits[task], outcome.visits)
    np.testing.assert_array_equal(learned.td_var[task], outcome.td_var)
    np.testing.assert_array_equal(learned.steps[task], outcome.steps)
    np.testing.assert_array_equal(learned.reached[task], outcome.reached)
    assert learned.step_count[task] == sum(outcome.steps)


@pytest.mark.parametrize("learning", [EXPLORING, GREEDY], ids=["exploring", "greedy"])
@pytest.mark.parametrize("shaped", [False, True])
def test_the_compiled_loop_equals_the_plain_one_to_the_last_bit(learning: Learning, shaped: bool) -> None:
    given = probability(1, TASKS)
    phi = np.random.default_rng(6).random((TASKS, STATES)) if shaped else None
    learned = learn(worlds(), learning, Start(start_table(), phi), given, ALL, Watch())
    for task in range(TASKS):
        starts = reference.xoshiro(given.starts[task])
        world = Table(tables(), task, learning.start == "anywhere", starts)
        own = None if phi is None else phi[task]
        outcome = reference.learn(world, learning, start_table(), reference.in_lanes(given.rng[task]), own)
        assert_same(learned, task, outcome)


@pytest.mark.parametrize("exploring", [False, True], ids=["following alone", "exploring while following"])
def test_evaluation_and_policies_equal_the_plain_ones(exploring: bool) -> None:
    given, policies = probability(11, TASKS), np.random.default_rng(3).integers(0, ACTIONS, (5, STATES))
    rules = {"c": 0.2, "psi0": 0.9, "rho": 0.97, "nu": 0.95}
    start = Start(start_table(), None, Policies(policies, **rules, explore_while_following=exploring))
    learned = learn(worlds(), EXPLORING, start, given, dataclasses.replace(ALL, evaluate_every=7), Watch())
    for task in range(TASKS):
        outcome = reference.learn(
            Table(tables(), task, True, reference.xoshiro(given.starts[task])),
            EXPLORING,
            start.table,
            reference.in_lanes(given.rng[task]),
            every=7,
            evaluation=reference.xoshiro(given.evaluation[task]),
            choices=reference.Choices(
                policies, reference.xoshiro(given.choices[task]), EXPLORING.gamma, **rules
            ),
            explore_while_following=exploring,
        )
        assert_same(learned, task, outcome)
        told = list(zip(learned.evaluation_steps[task], learned.evaluation_reached[task], strict=True))
        assert told == outcome.evaluation


@pytest.mark.parametrize("lanes", [1, 3, 8])
def test_a_task_learns_the_same_whatever_learns_beside_it(lanes: int) -> None:
    given = probability(2, TASKS)
    whole = learn(worlds(), EXPLORING, Start(start_table()), given, ALL, Watch(), lanes=lanes)
    for tasks in ([3], [5, 1], [4, 3, 2, 0]):
        some = learn(
            worlds(tasks), EXPLORING, Start(start_table()), reference.part(given, tasks), ALL, Watch()
        )
        for name in ("q", "visits", "td_var", "steps", "reached", "step_count"):
            np.testing.assert_array_equal(getattr(some, name), getattr(whole, name)[tasks])


def test_every_step_is_counted_once() -> None:
    learned = learn(worlds(), EXPLORING, Start(start_table()), probability(5, TASKS), ALL, watch := Watch())
    np.testing.assert_array_equal(learned.visits.sum(axis=(1, 2)), learned.step_count)
    np.testing.assert_array_equal(learned.steps.sum(axis=1), learned.step_count)
    assert watch.steps == learned.step_count.sum()


SIZE, GOALS, P = 6, np.array([35, 14, 1, 22]), np.array([0.6, 0.75, 0.9, 0.8])


def gridworlds_as_tables() -> Tables:
    """Gridworlds written as tables, the ways of a step in the order in which the gridworld's draws slip."""
    moves = open_map(SIZE).moves.astype(np.int32)
    ways = np.stack([moves[:, (np.arange(4) + action) % 4] for action in range(4)], axis=1)
    after = np.where(ways == GOALS[:, None, None, None], GOAL, ways).astype(np.int32)
    slips = np.stack([P, (1 - P) / 3, (1 - P) / 3, (1 - P) / 3], axis=1)
    odds = np.broadcast_to(slips[:, None, None], after.shape)
    cells = np.arange(SIZE**2)
    return Tables(after, odds, np.tile(cells == 0, (4, 1)).astype(float), cells != GOALS[:, None])


@pytest.mark.parametrize("weighing", [False, True])
def test_a_gridworld_written_as_a_table_learns_what_the_gridworlds_own_loop_learns(weighing: bool) -> None:
    given, random = probability(8, 4), np.random.default_rng(2)
    q = random.uniform(0.1, 0.9, (5, SIZE**2, 4)) * (random.random((5, SIZE**2, 4)) > 0.1)
    rules = {"temperature": 0.05, "floor": 0.01, "excess": 0.5, "cap": 25.0, "freeze": 9, "threshold": 0.05}
    hypotheses = Hypotheses(q, random.uniform(0, 0.05, q.shape), **rules, geometric=False, centred=True)
    start = Start(np.nan_to_num(hypotheses.mean()), hypotheses=hypotheses if weighing else None)
    records = dataclasses.replace(ALL, moments=np.array([0, 1, 5, 60]))
    tabled = gridworlds_as_tables().worlds(np.zeros((4, 4), np.uint64))
    by_table, by_loop = (
        learn(world, EXPLORING, start, given, records, Watch())
        for world in (tabled, Gridworlds(open_map(SIZE).moves, GOALS, P))
    )
    for name in ("q", "visits", "td_var", "steps", "reached", "step_count"):
        np.testing.assert_array_equal(getattr(by_table, name), getattr(by_loop, name))
    if weighing:
        assert by_table.weighing.moves.min() > 0
        for name in ("weights", "moves", "frozen"):
            np.testing.assert_array_equal(getattr(by_table.weighing, name), getattr(by_loop.weighing, name))


def test_a_policy_may_take_any_of_300_actions() -> None:
    after = np.full((1, 2, 300, 1), LOST, np.int32)
    start, open = np.array([[1.0, 0.0]]), np.ones((1, 2), bool)
    there = Tables(after, np.ones(after.shape), start, open).worlds(np.zeros((1, 4), np.uint64))
    policies = Policies(np.full((1, 2), 299), rho=1.0, nu=1.0)
    learning = dataclasses.replace(GREEDY, epsilon=0.0)
    learned = learn(
        there, learning, Start(np.zeros((2, 300)), None, policies), probability(1, 1), ALL, Watch()
    )
    assert learned.visits is not None
    assert learned.visits[0, 0, 299] == learned.visits.sum() == GREEDY.episodes
