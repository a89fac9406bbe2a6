"""The compiled gridworld loop against the plain reference, and against itself in other batches."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
import reference

from qinit_cli.grid_map import open_map
from qinit_cli.kernels import random_streams as rng
from qinit_cli.kernels.batch import LaneStreams, Learned, Policies, Records, Start, learn
from qinit_cli.kernels.gridworld import Gridworlds
from qinit_cli.learning import Learning
from qinit_cli.watch import Watch

SIZE = 6
GOALS = np.array([35, 14, 1, 22, 30, 8, 17])
P = np.array([0.6, 0.75, 0.9, 1.0, 0.25, 0.8, 0.7])
EXPLORING = Learning(alpha=0.1, gamma=0.95, epsilon=0.5, episodes=60, horizon=40, start="anywhere")
GREEDY = Learning(alpha=0.2, gamma=0.9, epsilon=0.05, episodes=60, horizon=25, start="fixed")
ALL = Records(bins=60, visits=True, td_var=True)


def probability(seed: int, tasks: int) -> LaneStreams:
    def streams(kind: int) -> list[np.random.SeedSequence]:
        return [np.random.SeedSequence(seed, spawn_key=(kind, task)) for task in range(tasks)]

    return LaneStreams(rng.lane_seeds(streams(0)), *(rng.seeds(streams(kind)) for kind in (1, 2, 3)))


def worlds(tasks: slice | list[int] = slice(None)) -> Gridworlds:
    return Gridworlds(open_map(SIZE).moves, GOALS[tasks], P[tasks])


def table(seed: int = 5) -> np.ndarray:
    """A start table with ties in it."""
    return np.random.default_rng(seed).integers(0, 3, (SIZE**2, 4)) / 8


def potential(tasks: int) -> np.ndarray:
    return np.random.default_rng(6).random((tasks, SIZE**2))


def expected(task: int, learning: Learning, start: Start, given: LaneStreams) -> reference.Outcome:
    fixed = 0 if learning.start == "fixed" else None
    starts = reference.xoshiro(given.starts[task])
    world = reference.Gridworld(SIZE, int(GOALS[task]), float(P[task]), fixed, starts)
    phi = (
        None
        if start.potential is None
        else np.atleast_2d(start.potential)[task % len(np.atleast_2d(start.potential))]
    )
    return reference.learn(world, learning, start.table, reference.in_lanes(given.rng[task]), phi)


@pytest.mark.parametrize("learning", [EXPLORING, GREEDY], ids=["exploring", "greedy"])
@pytest.mark.parametrize("exploring", [False, True], ids=["following alone", "exploring while following"])
def test_evaluation_and_policies_equal_the_plain_ones(learning: Learning, exploring: bool) -> None:
    given, policies = probability(11, len(GOALS)), np.random.default_rng(3).integers(0, 4, (5, SIZE**2))
    rules = {"c": 0.2, "psi0": 0.9, "rho": 0.97, "nu": 0.95}
    start = Start(table(), None, Policies(policies, **rules, explore_while_following=exploring))
    learned = learn(worlds(), learning, start, given, dataclasses.replace(ALL, evaluate_every=7), Watch())
    for task in range(len(GOALS)):
        starts, fixed = reference.xoshiro(given.starts[task]), 0 if learning.start == "fixed" else None
        outcome = reference.learn(
            reference.Gridworld(SIZE, int(GOALS[task]), float(P[task]), fixed, starts),
            learning,
            start.table,
            reference.in_lanes(given.rng[task]),
            every=7,
            evaluation=reference.xoshiro(given.evaluation[task]),
            choices=reference.Choices(
                policies, reference.xoshiro(given.choices[task]), learning.gamma, **rules
            ),
            explore_while_following=exploring,
        )
        assert_same(learned, task, outcome)
        np.testing.assert_array_equal(
            learned.evaluation_steps[task], [length for length, _ in outcome.evaluation]
        )
        np.testing.assert_array_equal(
            learned.evaluation_reached[task], [reached for _, reached in outcome.evaluation]
        )


def test_policies_without_streams_are_refused() -> None:
    bare = LaneStreams(probability(1, len(GOALS)).rng, probability(1, len(GOALS)).starts)
    start = Start(table(), None, Policies(np.zeros((2, SIZE**2), np.int64)))
    with pytest.raises(ValueError, match="streams of their own"):
        learn(worlds(), EXPLORING, start, bare, ALL, Watch())


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
    given = probability(1, len(GOALS))
    start = Start(table(), phi)
    learned = learn(worlds(), learning, start, given, ALL, Watch())
    for task in range(len(GOALS)):
        assert_same(learned, task, expected(task, learning, start, given))


@pytest.mark.parametrize("lanes", [1, 2, 3, 4, 5, 9])
def test_a_task_learns_the_same_whatever_learns_beside_it(lanes: int) -> None:
    given = probability(2, len(GOALS))
    whole = learn(worlds(), EXPLORING, Start(table()), given, ALL, Watch(), lanes=lanes)
    for tasks in ([3], [6, 1], [5, 4, 3, 2, 0]):
        some = learn(worlds(tasks), EXPLORING, Start(table()), reference.part(given, tasks), ALL, Watch())
        for name in ("q", "visits", "td_var", "steps", "reached", "step_count"):
            np.testing.assert_array_equal(getattr(some, name), getattr(whole, name)[tasks])


def test_records_evaluation_and_no_policies_change_no_bit_of_what_is_learned() -> None:
    given = probability(3, len(GOALS))
    full = learn(worlds(), EXPLORING, Start(table()), given, ALL, Watch())
    start = Start(table(), None, Policies(np.empty((0, SIZE**2), np.int64)))
    bare = learn(worlds(), EXPLORING, start, given, Records(bins=7, evaluate_every=60), Watch())
    assert bare.visits is None
    assert bare.td_var is None
    assert full.evaluation_steps is None
    assert bare.evaluation_steps is not None
    assert bare.evaluation_steps.shape == (len(GOALS), 2)
    np.testing.assert_array_equal(bare.q, full.q)
    bins = np.arange(60) * 7 // 60
    for binned, each in ((bare.steps, full.steps), (bare.reached, full.reached)):
        np.testing.assert_array_equal(binned, np.stack([np.bincount(bins, row, 7) for row in each]))


class StoppedAtOnce(Watch):
    """Says stop as soon as something was learned."""

    def add(self, steps: int, tasks: float = 0.0, finished: int = 0) -> None:
        super().add(steps, tasks, finished)
        self.stop()


def test_stopping_keeps_the_tasks_that_are_done_and_tells_which() -> None:
    many = [task % len(GOALS) for task in range(40)]
    given = probability(4, len(many))
    longer = dataclasses.replace(EXPLORING, episodes=1500)
    watch = StoppedAtOnce()
    some = learn(worlds(many), longer, Start(table()), given, Records(bins=10), watch)
    whole = learn(worlds(many), longer, Start(table()), given, Records(bins=10), Watch())
    assert whole.finished.all()
    assert 0 < some.finished.sum() < len(many)
    for name in ("q", "steps", "reached", "step_count"):
        np.testing.assert_array_equal(getattr(some, name)[some.finished], getattr(whole, name)[some.finished])
    assert some.step_count[some.finished].sum() <= watch.steps < whole.step_count.sum()


def test_every_step_is_counted_once_and_every_episode_is_in_one_bin() -> None:
    learned = learn(worlds(), EXPLORING, Start(table()), probability(5, len(GOALS)), ALL, watch := Watch())
    assert learned.visits is not None
    np.testing.assert_array_equal(learned.visits.sum(axis=(1, 2)), learned.step_count)
    np.testing.assert_array_equal(learned.steps.sum(axis=1), learned.step_count)
    assert watch.steps == learned.step_count.sum()
    assert learned.seconds.sum() > 0
    assert not learned.visits[np.arange(len(GOALS)), GOALS].any()


def test_long_learning_comes_near_the_exact_table() -> None:
    """V*(0,0) of the paper's grid is known; constant alpha stays within some per cent of it."""
    task = Gridworlds(open_map(30).moves, np.full(4, 20 * 30 + 20), np.full(4, 0.75))
    source = Learning(alpha=0.1, gamma=0.95, epsilon=0.5, episodes=40_000, horizon=1_000, start="anywhere")
    learned = learn(task, source, Start(np.zeros((900, 4))), probability(6, 4), Records(bins=10), Watch())
    np.testing.assert_allclose(learned.q[:, 0].max(axis=1), 0.056768479844764, rtol=0.1)


def test_starts_anywhere_are_uniform_over_the_cells_but_the_goal() -> None:
    one_step = Learning(alpha=0.1, gamma=0.9, epsilon=1.0, episodes=36_000, horizon=1, start="anywhere")
    counted = Records(bins=1, visits=True, td_var=True)
    learned = learn(worlds([1]), one_step, Start(table()), probability(7, 1), counted, Watch())
    assert learned.visits is not None
    visits = learned.visits[0]
    assert not visits[GOALS[1]].any()
    expected_visits = np.full((SIZE**2 - 1) * 4, 36_000 / (SIZE**2 - 1) / 4)
    others = np.delete(visits, GOALS[1], axis=0).ravel()
    chi_square = ((others - expected_visits) ** 2 / expected_visits).sum()
    degrees = len(others) - 1
    assert abs(chi_square - degrees) < 5 * np.sqrt(2 * degrees)


@pytest.mark.parametrize("p", [0.6, 0.9])
def test_the_agent_goes_where_it_meant_to_with_probability_p(p: float) -> None:
    """Episodes of one step from a corner, the goal beside it."""
    one_step = Learning(alpha=1.0, gamma=1.0, epsilon=1.0, episodes=200_000, horizon=1, start="fixed")
    task = Gridworlds(open_map(2).moves, np.array([1]), np.array([p]))
    learned = learn(task, one_step, Start(np.zeros((4, 4))), probability(8, 1), Records(bins=1), Watch())
    # the goal is to the right: reached by meaning it, or by slipping from one of the three other moves
    expected_share = 0.25 * p + 0.75 * (1 - p) / 3
    assert learned.reached.sum() / 200_000 == pytest.approx(expected_share, abs=0.005)


def test_shaped_learning_equals_unshaped_learning_that_starts_from_the_potential() -> None:
    """Wiewiora (2003). With epsilon 1 both take the same steps whatever they have learned."""
    wandering = dataclasses.replace(EXPLORING, epsilon=1.0)
    phi = potential(len(GOALS))
    shaped = learn(worlds(), wandering, Start(table(), phi), probability(10, len(GOALS)), ALL, Watch())
    phi[np.arange(len(GOALS)), GOALS] = 0.0
    plain = learn(
        worlds(), wandering, Start(table() + phi[:, :, None]), probability(10, len(GOALS)), ALL, Watch()
    )
    np.testing.assert_allclose(shaped.q + phi[:, :, None], plain.q, rtol=0, atol=1e-12)
    np.testing.assert_array_equal(shaped.steps, plain.steps)


def test_a_potential_of_zero_changes_no_bit() -> None:
    shaped = learn(
        worlds(), EXPLORING, Start(table(), np.zeros(SIZE**2)), probability(1, len(GOALS)), ALL, Watch()
    )
    plain = learn(worlds(), EXPLORING, Start(table()), probability(1, len(GOALS)), ALL, Watch())
    np.testing.assert_array_equal(shaped.q, plain.q)


def test_a_start_on_the_goal_is_refused() -> None:
    with pytest.raises(ValueError, match="start and a goal"):
        Gridworlds(open_map(3).moves, np.array([4, 0]), np.array([0.7, 0.7]))


def test_tables_of_another_shape_are_refused() -> None:
    with pytest.raises(ValueError, match="start table has shape"):
        learn(worlds(), EXPLORING, Start(np.zeros((5, 4))), probability(9, len(GOALS)), ALL, Watch())
