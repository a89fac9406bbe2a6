"""Weighing tables while learning: the compiled loops against the plain reference, which changes the whole table at once."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np
import pytest
import reference
from scipy import stats

from qinit_cli.grid_map import open_map
from qinit_cli.kernels import random_streams as rng
from qinit_cli.kernels.batch import LaneStreams, Learned, Records, Start, Weighing, learn
from qinit_cli.kernels.compiled import lean
from qinit_cli.kernels.gridworld import Gridworlds
from qinit_cli.kernels.gridworld_exact import solve
from qinit_cli.kernels.mountain_car import MountainCars
from qinit_cli.kernels.posterior import Hypotheses
from qinit_cli.kernels.reals import load_reals, total
from qinit_cli.learners.one_step import Sarsa
from qinit_cli.learning import Learning
from qinit_cli.schedules import Linear
from qinit_cli.watch import Watch

SIZE, BINS = 6, 6
MOVES = open_map(SIZE).moves
GOALS = np.array([35, 14, 1, 22, 30, 8, 17, 33, 5])
P = np.array([0.6, 0.75, 0.9, 1.0, 0.25, 0.8, 0.7, 0.65, 0.85])
ETA = np.array([0.0, 0.01, -0.02, 0.005, 0.03, -0.001, 0.0, 0.015, -0.01, 0.02])
GRID = Learning(alpha=0.1, gamma=0.95, epsilon=0.2, episodes=40, horizon=40, start="anywhere")
CAR = Learning(alpha=0.1, gamma=0.99, epsilon=0.3, episodes=20, horizon=150, start="anywhere")
RULES: list[dict[str, Any]] = [
    {
        "temperature": 0.05,
        "floor": 0.01,
        "excess": 0.0,
        "cap": 25.0,
        "centred": False,
        "freeze": 5,
        "threshold": 0.05,
    },
    {
        "temperature": 0.5,
        "floor": 0.05,
        "excess": 4.0,
        "cap": 25.0,
        "centred": False,
        "freeze": 1,
        "threshold": 0.05,
    },
    {
        "temperature": 0.01,
        "floor": 0.1,
        "excess": 0.5,
        "cap": 3.0,
        "centred": True,
        "freeze": 0,
        "threshold": 0.001,
    },
]
ALL = Records(40, True, True)
MOMENTS = np.array([0, 1, 2, 5, 20])


def probability(seed: int, tasks: int) -> LaneStreams:
    def streams(kind: int) -> list[np.random.SeedSequence]:
        return [np.random.SeedSequence(seed, spawn_key=(kind, task)) for task in range(tasks)]

    return LaneStreams(rng.lane_seeds(streams(0)), *(rng.seeds(streams(kind)) for kind in (1, 2)))


def part(given: LaneStreams, tasks: list[int]) -> LaneStreams:
    assert given.evaluation is not None
    return LaneStreams(given.rng[tasks], given.starts[tasks], given.evaluation[tasks])


def grid_hypotheses(rules: dict[str, Any], geometric: bool, tables: int = 11) -> Hypotheses:
    """Exact tables of other goals, one pair unknown to all, more than eight of them."""
    random = np.random.default_rng(4)
    q, td_var = (np.empty((tables, SIZE**2, 4)) for _ in range(2))
    goals, p = random.integers(1, SIZE**2, tables), random.uniform(0.5, 0.9, tables)
    solve(MOVES, goals[:, None], p[:, None], GRID.gamma, 1e-12, q, td_var)
    q[:, 7, 2] = 0.0
    return Hypotheses(q, td_var, **rules, geometric=geometric)


def car_hypotheses(rules: dict[str, Any], geometric: bool) -> Hypotheses:
    random = np.random.default_rng(4)
    q = random.uniform(0.2, 0.9, (5, BINS**2, 3)) * (random.random((5, BINS**2, 3)) > 0.2)
    return Hypotheses(q, random.uniform(0, 0.05, q.shape), **rules, geometric=geometric)


def start_of(hypotheses: Hypotheses) -> Start:
    return Start(np.nan_to_num(hypotheses.mean()), hypotheses=hypotheses)


def learned_from(
    worlds: Any, learning: Learning, hypotheses: Hypotheses, given: LaneStreams, lanes: int | None = None
) -> tuple[Learned, Weighing]:
    """With every record, so that few loops are compiled."""
    records = Records(learning.episodes, True, True, 7, np.append(MOMENTS, learning.episodes))
    learned = learn(worlds, learning, start_of(hypotheses), given, records, Watch(), lanes)
    assert learned.weighing is not None
    return learned, learned.weighing


def weighed_by(hypotheses: Hypotheses, learning: Learning) -> reference.Weighed:
    fields = {field.name: getattr(hypotheses, field.name) for field in dataclasses.fields(hypotheses)}
    tables = fields.pop("q")
    return reference.Weighed(tables, gamma=learning.gamma, **fields)


def assert_same(
    learned: Learned, weighing: Weighing, task: int, outcome: reference.Outcome, weighed: reference.Weighed
) -> None:
    np.testing.assert_array_equal(learned.steps[task], outcome.steps)
    np.testing.assert_array_equal(learned.reached[task], outcome.reached)
    np.testing.assert_array_equal(learned.visits[task], outcome.visits)  # type: ignore[index]
    np.testing.assert_allclose(
        weighing.weights[task], np.array(weighed.history)[[*MOMENTS, -1]], rtol=0, atol=1e-12
    )
    assert (weighing.moves[task], weighing.frozen[task]) == (weighed.moves, weighed.frozen)


def assert_the_gridworld_weighs_plainly(learning: Learning, hypotheses: Hypotheses) -> None:
    given = probability(1, len(GOALS))
    learned, weighing = learned_from(Gridworlds(MOVES, GOALS, P), learning, hypotheses, given)
    assert weighing.moves.min() > 0
    for task in range(len(GOALS)):
        weighed = weighed_by(hypotheses, learning)
        np.testing.assert_allclose(start_of(hypotheses).table, weighed.start, rtol=1e-14)
        starts = reference.xoshiro(given.starts[task])
        world = reference.Gridworld(SIZE, int(GOALS[task]), float(P[task]), None, starts)
        dice_, evaluation = reference.in_lanes(given.rng[task]), reference.xoshiro(given.evaluation[task])  # type: ignore[index]
        outcome = reference.learn(
            world, learning, weighed.start, dice_, every=7, evaluation=evaluation, weighed=weighed
        )
        assert_same(learned, weighing, task, outcome, weighed)
        np.testing.assert_allclose(learned.q[task], outcome.q, rtol=0, atol=1e-12)
        lengths = [length for length, _ in outcome.evaluation]
        np.testing.assert_array_equal(learned.evaluation_steps[task], lengths)  # type: ignore[index]


@pytest.mark.parametrize("geometric", [False, True], ids=["arithmetic", "geometric"])
@pytest.mark.parametrize("rules", RULES, ids=["weak", "strong", "never frozen"])
def test_the_gridworld_weighs_as_the_plain_reference_does(rules: dict[str, Any], geometric: bool) -> None:
    assert_the_gridworld_weighs_plainly(GRID, grid_hypotheses(rules, geometric))


@pytest.mark.parametrize("geometric", [False, True], ids=["arithmetic", "geometric"])
@pytest.mark.parametrize("rules", RULES, ids=["weak", "strong", "never frozen"])
def test_mountain_car_weighs_as_the_plain_reference_does(rules: dict[str, Any], geometric: bool) -> None:
    given, hypotheses = probability(2, len(ETA)), car_hypotheses(rules, geometric)
    learned, weighing = learned_from(MountainCars(ETA, bins=BINS), CAR, hypotheses, given)
    assert weighing.moves.min() > 0
    for task, eta in enumerate(ETA):
        weighed, starts = weighed_by(hypotheses, CAR), reference.xoshiro(given.starts[task])
        world = reference.MountainCar(BINS, float(eta), 0.0, "anywhere", starts)
        evaluation = reference.xoshiro(given.evaluation[task])  # type: ignore[index]
        dice_ = reference.in_lanes(given.rng[task])
        outcome = reference.learn(
            world, CAR, weighed.start, dice_, every=7, evaluation=evaluation, weighed=weighed
        )
        assert_same(learned, weighing, task, outcome, weighed)
        np.testing.assert_allclose(learned.q[task], outcome.q, rtol=0, atol=1e-12)


def test_sarsas_updates_weigh_their_steps_when_the_next_action_is_known() -> None:
    """What is left of a start is the product of 1 - alpha, which changes here."""
    learning = dataclasses.replace(GRID, learner=Sarsa(), alpha=Linear(0.3, 0.05, 30))
    assert_the_gridworld_weighs_plainly(learning, grid_hypotheses(RULES[0], False))


@pytest.mark.parametrize("lanes", [1, 3, 4, 9])
def test_a_gridworld_weighs_the_same_whatever_learns_beside_it(lanes: int) -> None:
    given, hypotheses = probability(3, len(GOALS)), grid_hypotheses(RULES[0], geometric=False)
    whole, weighing = learned_from(Gridworlds(MOVES, GOALS, P), GRID, hypotheses, given, lanes)
    for tasks in ([3], [6, 1], [8, 5, 4, 3, 2, 0]):
        some, few = learned_from(
            Gridworlds(MOVES, GOALS[tasks], P[tasks]), GRID, hypotheses, part(given, tasks)
        )
        for name in ("q", "visits", "steps", "reached", "step_count"):
            np.testing.assert_array_equal(getattr(some, name), getattr(whole, name)[tasks])
        for name in ("weights", "moves", "frozen"):
            np.testing.assert_array_equal(getattr(few, name), getattr(weighing, name)[tasks])


def test_a_car_weighs_the_same_whatever_learns_beside_it() -> None:
    given, hypotheses = probability(4, len(ETA)), car_hypotheses(RULES[0], geometric=True)
    whole, weighing = learned_from(MountainCars(ETA, bins=BINS), CAR, hypotheses, given, 16)
    for tasks in ([9], [2, 7, 0]):
        some, few = learned_from(MountainCars(ETA[tasks], bins=BINS), CAR, hypotheses, part(given, tasks))
        np.testing.assert_array_equal(some.q, whole.q[tasks])
        np.testing.assert_array_equal(some.steps, whole.steps[tasks])
        np.testing.assert_array_equal(few.weights, weighing.weights[tasks])


def test_without_evidence_learning_is_plain_learning_from_the_mean() -> None:
    hypotheses = grid_hypotheses(RULES[0] | {"temperature": 0.0}, geometric=False)
    given, worlds = probability(5, len(GOALS)), Gridworlds(MOVES, GOALS, P)
    learned, weighing = learned_from(worlds, GRID, hypotheses, given)
    plain = learn(worlds, GRID, Start(start_of(hypotheses).table), given, ALL, Watch())
    np.testing.assert_array_equal(learned.q, plain.q)
    np.testing.assert_array_equal(learned.steps, plain.steps)
    np.testing.assert_array_equal(weighing.weights, np.full_like(weighing.weights, 1 / 11))
    assert not weighing.moves.any()


def test_the_target_among_the_hypotheses_is_found_and_its_table_learned_from() -> None:
    q, td_var = (np.empty((len(GOALS), SIZE**2, 4)) for _ in range(2))
    solve(MOVES, GOALS[:, None], P[:, None], GRID.gamma, 1e-12, q, td_var)
    hypotheses = Hypotheses(q, td_var, **RULES[0] | {"temperature": 0.5, "freeze": 30}, geometric=False)
    _, weighing = learned_from(Gridworlds(MOVES, GOALS, P), GRID, hypotheses, probability(6, len(GOALS)))
    np.testing.assert_array_equal(weighing.weights[:, -1].argmax(axis=1), np.arange(len(GOALS)))
    assert np.median(weighing.weights[np.arange(len(GOALS)), -1, np.arange(len(GOALS))]) > 0.99


def test_what_only_refuted_tables_know_is_still_their_mean() -> None:
    """The target's own table does not know its goal: of that cell the other's values stay, however little it weighs."""
    q, td_var = (np.empty((2, SIZE**2, 4)) for _ in range(2))
    solve(MOVES, GOALS[:2, None], P[:2, None], GRID.gamma, 1e-12, q, td_var)
    hypotheses = Hypotheses(
        q, td_var, **RULES[0] | {"temperature": 1e6, "cap": 1e6, "freeze": 0}, geometric=False
    )
    worlds = Gridworlds(MOVES, GOALS[:1], P[:1])
    learned, weighing = learned_from(worlds, GRID, hypotheses, part(probability(6, 1), [0]))
    assert weighing.weights[0, -1, 0] == 1.0
    assert weighing.weights[0, -1, 1] < 1e-250
    np.testing.assert_allclose(learned.q[0, GOALS[0]], q[1, GOALS[0]], rtol=1e-12)


def test_a_corrected_table_is_what_learning_from_the_last_start_would_hold() -> None:
    """Where targets do not depend on the table: no discounted future, every step explores, episodes of one step."""
    blind = Learning(alpha=0.3, gamma=1e-300, epsilon=1.0, episodes=200, horizon=1, start="anywhere")
    hypotheses = grid_hypotheses(RULES[2] | {"threshold": 0.0}, geometric=False)
    given, worlds = probability(7, len(GOALS)), Gridworlds(MOVES, GOALS, P)
    learned, weighing = learned_from(worlds, blind, hypotheses, given)
    assert weighing.moves.min() > 20
    for task in range(len(GOALS)):
        weight = weighing.weights[task, -1][:, None, None] * (hypotheses.q > 0)
        with np.errstate(invalid="ignore"):
            last = np.nan_to_num((weight * hypotheses.q).sum(axis=0) / weight.sum(axis=0))
        alone = Gridworlds(MOVES, GOALS[[task]], P[[task]])
        plain = learn(alone, blind, Start(last), part(given, [task]), Records(200, True, True), Watch())
        np.testing.assert_allclose(learned.q[task], plain.q[0], rtol=0, atol=1e-12)


@pytest.mark.parametrize("geometric", [False, True], ids=["arithmetic", "geometric"])
def test_the_mean_is_scipys_over_the_tables_that_know_the_pair(geometric: bool) -> None:
    hypotheses = grid_hypotheses(RULES[0], geometric)
    mean = hypotheses.mean()
    for state, action in ((0, 0), (20, 3), (13, 1)):
        known = hypotheses.q[:, state, action][hypotheses.q[:, state, action] > 0]
        expected = stats.gmean(known) if geometric else known.mean()
        assert mean[state, action] == pytest.approx(expected, rel=1e-13)
    assert np.isnan(mean[7, 2])


def test_hypotheses_of_another_shape_are_refused() -> None:
    hypotheses = grid_hypotheses(RULES[0], geometric=False)
    wrong = dataclasses.replace(hypotheses, td_var=hypotheses.td_var[:3])
    with pytest.raises(ValueError, match="hypotheses' TD variance has shape"):
        learn(Gridworlds(MOVES, GOALS, P), GRID, start_of(wrong), probability(1, len(GOALS)), ALL, Watch())


@lean
def summed(numbers, out):  # type: ignore[no-untyped-def]
    out[0] = total(load_reals(numbers, 0))


def test_eight_numbers_are_summed_in_a_fixed_order() -> None:
    numbers, out = np.random.default_rng(1).normal(size=8) * 10.0 ** np.arange(8), np.empty(1)
    summed(numbers, out)
    fours = numbers[:4] + numbers[4:]
    twos = fours[:2] + fours[2:]
    assert out[0] == twos[0] + twos[1]
