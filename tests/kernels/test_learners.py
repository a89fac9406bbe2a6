"""Every learner, exploration and schedule in the compiled loop, against the plain ones: to the last bit."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
import reference
import test_loop
from learner_reference import flipped

from qinit_cli.grid_map import open_map
from qinit_cli.kernels import random_streams as rng
from qinit_cli.kernels.batch import LaneStreams, Learned, Policies, Records, Start, learn
from qinit_cli.kernels.gridworld import Gridworlds
from qinit_cli.kernels.mountain_car import MountainCars
from qinit_cli.kernels.python_steps import PythonWorlds
from qinit_cli.kernels.worlds import CUT, GOAL
from qinit_cli.learners.exploration import Boltzmann, Ucb
from qinit_cli.learners.one_step import DoubleQ, ExpectedSarsa, QLearner, Sarsa, Still
from qinit_cli.learners.optimistic import DelayedQ, RMax
from qinit_cli.learners.traces import QLambda, SarsaLambda
from qinit_cli.learning import Learning
from qinit_cli.schedules import ByVisits, Exponential, Linear
from qinit_cli.watch import Watch

EPISODES, EVERY = 48, 7
ALL = Records(
    EPISODES, visits=True, td_var=True, evaluate_every=EVERY
)  # one set of records: few loops are compiled
USUAL = Learning(alpha=0.1, gamma=0.95, epsilon=0.3, episodes=EPISODES, horizon=25, start="anywhere")
VISITS, FALLING, RISING = ByVisits(0.7), Exponential(1.0, 0.9, 0.05), Linear(0.05, 0.4, 30)


def streams(tasks: int) -> LaneStreams:
    def sequences(kind: int) -> list[np.random.SeedSequence]:
        return [np.random.SeedSequence(21, spawn_key=(kind, task)) for task in range(tasks)]

    return LaneStreams(rng.lane_seeds(sequences(0)), *(rng.seeds(sequences(kind)) for kind in (1, 2, 3, 4)))


class Grids:
    """Seven gridworlds of 5 x 5."""

    tasks, states, actions = 7, 25, 4
    goals, p = np.array([24, 7, 1, 22, 20, 8, 17]), np.array([0.6, 0.75, 0.9, 1.0, 0.25, 0.8, 0.7])

    def worlds(self, tasks: Any = slice(None)) -> Gridworlds:
        return Gridworlds(open_map(5).moves, self.goals[tasks], self.p[tasks])

    def plain(self, task: int, anywhere: bool, starts: Any) -> Any:
        return reference.Gridworld(
            5, int(self.goals[task]), float(self.p[task]), None if anywhere else 0, starts
        )


class WideTables:
    """Tables of six actions, which are more than a vector holds."""

    tasks, states, actions = test_loop.TASKS, test_loop.STATES, test_loop.ACTIONS

    def worlds(self, tasks: Any = slice(None)) -> Any:
        return test_loop.worlds(tasks)

    def plain(self, task: int, anywhere: bool, starts: Any) -> Any:
        return test_loop.Table(test_loop.tables(), task, anywhere, starts)


class Cars:
    """Ten Mountain Cars, eight of which move at once."""

    eta = np.array([0.0, 0.01, -0.02, 0.005, 0.03, -0.001, 0.0, 0.015, -0.01, 0.02])
    tasks, states, actions = len(eta), 36, 3

    def worlds(self, tasks: Any = slice(None)) -> MountainCars:
        return MountainCars(self.eta[tasks], bins=6)

    def plain(self, task: int, anywhere: bool, starts: Any) -> Any:
        return reference.MountainCar(
            6, float(self.eta[task]), 0.0, "anywhere" if anywhere else "point", starts
        )


class Corridor:
    """Five cells, the goal behind the last; the world itself cuts an episode off after nine steps."""

    def start(self, seed: int) -> int:
        self.cell = self.time = 0
        return 0

    def step(self, action: int) -> int:
        self.time += 1
        self.cell = max(self.cell + (1 if action else -1), 0)
        return GOAL if self.cell == 5 else CUT - self.cell if self.time == 9 else self.cell


class PlainCorridor(Corridor):
    """The same for the plain loop."""

    def reset(self) -> None:
        self.state, self.cut = self.start(0), False

    def reset_to_target(self, draws: Any) -> None:
        self.reset()

    def step(self, draw: int, action: int, draws: Any = None) -> bool:
        code = super().step(action)
        self.cut, self.state = code <= CUT, self.cell
        return code == GOAL


class Corridors:
    tasks, states, actions = 3, 5, 2

    def worlds(self, tasks: Any = slice(None)) -> PythonWorlds:
        count = len(np.arange(self.tasks)[tasks])
        return PythonWorlds(lambda task, _: Corridor(), 5, 2, np.ones((count, 4), np.uint64))

    def plain(self, task: int, anywhere: bool, starts: Any) -> Any:
        world = PlainCorridor()
        world.states, world.actions = self.states, self.actions
        return world


GRIDS, TABLES, CARS, CORRIDORS = Grids(), WideTables(), Cars(), Corridors()


def table_of(family: Any) -> np.ndarray:
    """With ties in it."""
    return np.random.default_rng(5).integers(0, 3, (family.states, family.actions)) / 8


def potential_of(family: Any) -> np.ndarray:
    return np.random.default_rng(6).random((family.tasks, family.states))


def learned_by(
    family: Any, learning: Learning, start: Start, tasks: list[int] | None = None, lanes: int | None = None
) -> Learned:
    given = streams(family.tasks)
    if tasks is not None:
        given = reference.part(given, tasks)
        phi = start.potential if start.potential is None else start.potential[tasks]
        start = replace(start, potential=phi)
    worlds = family.worlds(slice(None) if tasks is None else tasks)
    return learn(worlds, learning, start, given, ALL, Watch(), lanes)


def plainly_learned(
    family: Any, learning: Learning, start: Start, task: int, choices: dict[str, Any] | None = None
) -> reference.Outcome:
    given = streams(family.tasks)
    world = family.plain(task, learning.start == "anywhere", reference.xoshiro(given.starts[task]))
    choosing = None
    if choices is not None:
        draws = reference.xoshiro(given.choices[task])
        choosing = reference.Choices(start.policies.actions, draws, learning.gamma, **choices)
    return reference.learn(
        world,
        learning,
        start.table,
        reference.in_lanes(given.rng[task]),
        None if start.potential is None else start.potential[task],
        EVERY,
        reference.xoshiro(given.evaluation[task]),
        choosing,
        explore_while_following=choices is not None and start.policies.explore_while_following,
        coins=flipped(reference.xoshiro(given.learner[task])),
        known_at=start.known_at,
        kind=getattr(family, "kind", list),
    )


def assert_same(learned: Learned, place: int, outcome: reference.Outcome) -> None:
    test_loop.assert_same(learned, place, outcome)
    lengths, reached = learned.evaluation_steps[place], learned.evaluation_reached[place]
    assert list(zip(lengths, reached, strict=True)) == outcome.evaluation


def assert_plain(
    family: Any, learning: Learning, start: Start, choices: dict[str, Any] | None = None
) -> list[reference.Outcome]:
    """Learned together, more than there are lanes, and two alone, fewer: both as the plain loop learns them."""
    whole, two = learned_by(family, learning, start), learned_by(family, learning, start, [2, 0])
    outcomes = [plainly_learned(family, learning, start, task, choices) for task in range(family.tasks)]
    for task, outcome in enumerate(outcomes):
        assert_same(whole, task, outcome)
    assert_same(two, 0, outcomes[2])
    assert_same(two, 1, outcomes[0])
    return outcomes


# A loop takes 15 s to compile for each world, learner, exploration, kind of step size and of epsilon, shaped or not: each of
# those with narrow rows and with wide ones, but not their product. What test_convergence.py learns with is among them.
CASES: list[tuple[Any, bool, dict[str, Any]]] = [
    (GRIDS, True, {"learner": Sarsa(), "explore": Boltzmann(0.1), "alpha": RISING}),
    (GRIDS, False, {"learner": ExpectedSarsa(), "explore": Ucb(0.2)}),
    (GRIDS, True, {"learner": DoubleQ(), "alpha": VISITS}),
    (GRIDS, True, {"learner": QLambda(0.8)}),
    (GRIDS, True, {"learner": QLambda(0.95, "accumulating", 0.01)}),
    (GRIDS, True, {"learner": SarsaLambda(0.8), "epsilon": Linear(0.5, 0.0, 30)}),
    (GRIDS, True, {"learner": SarsaLambda(0.95, "accumulating", 0.01), "epsilon": FALLING}),
    (GRIDS, False, {"learner": DelayedQ(2, 0.01), "epsilon": 0.0}),
    (GRIDS, False, {"learner": RMax(2), "epsilon": 0.0}),
    (GRIDS, False, {"learner": Still()}),
    (TABLES, False, {"learner": QLearner(), "alpha": VISITS, "epsilon": FALLING}),
    (TABLES, False, {"learner": DoubleQ(), "alpha": VISITS, "epsilon": FALLING}),
    (TABLES, False, {"learner": Sarsa(), "alpha": VISITS, "epsilon": FALLING}),
    (TABLES, False, {"learner": ExpectedSarsa(), "alpha": VISITS, "epsilon": FALLING}),
    (TABLES, True, {"learner": ExpectedSarsa(), "explore": Boltzmann(0.1)}),
    (TABLES, False, {"learner": QLambda(0.8), "alpha": Exponential(0.5, 0.95, 0.1)}),
    (TABLES, False, {"learner": DelayedQ(2, 0.01), "epsilon": 0.0}),
    (TABLES, False, {"learner": RMax(2), "epsilon": 0.0}),
    (CARS, False, {"learner": SarsaLambda(0.9), "horizon": 120}),
    (CORRIDORS, False, {"learner": Sarsa(), "start": "fixed"}),
]


def named(case: Any) -> str | None:
    if isinstance(case, dict):
        return "-".join(str(value).replace(":", " ") for value in case.values())
    return "" if isinstance(case, bool) else type(case).__name__


@pytest.mark.parametrize(("family", "shaped", "settings"), CASES, ids=named)
def test_a_compiled_learner_equals_the_plain_one_to_the_last_bit(
    family: Any, shaped: bool, settings: dict[str, Any]
) -> None:
    start = Start(table_of(family), potential_of(family) if shaped else None)
    outcomes = assert_plain(family, replace(USUAL, **settings), start)
    assert any(any(outcome.reached) for outcome in outcomes)
    assert not all(all(outcome.reached) for outcome in outcomes)


@pytest.mark.parametrize("exploring", [False, True], ids=["following alone", "exploring while following"])
def test_sarsa_learns_from_the_actions_of_policies_that_are_followed_and_ucb_counts_them(
    exploring: bool,
) -> None:
    """UCB never says that a step explores, so policies are followed whether or not one may explore while following them."""
    policies = np.random.default_rng(3).integers(0, GRIDS.actions, (5, GRIDS.states))
    rules = {"c": 0.2, "psi0": 0.9, "rho": 0.97, "nu": 0.95}
    start = Start(table_of(GRIDS), None, Policies(policies, **rules, explore_while_following=exploring))
    assert_plain(GRIDS, replace(USUAL, learner=Sarsa(), explore=Ucb(0.2)), start, rules)


@pytest.mark.parametrize(
    ("traces", "one_step", "epsilon"),
    [
        (QLambda(0.0), QLearner(), 0.3),
        (QLambda(0.0, "accumulating"), QLearner(), 0.3),
        (SarsaLambda(0.0), Sarsa(), FALLING),
        (SarsaLambda(0.0, "accumulating"), Sarsa(), FALLING),
    ],
    ids=str,
)
def test_with_lambda_zero_a_learner_with_traces_is_the_one_of_one_step(
    traces: Any, one_step: Any, epsilon: Any
) -> None:
    start, learning = Start(table_of(GRIDS), potential_of(GRIDS)), replace(USUAL, epsilon=epsilon)
    learned = learned_by(GRIDS, replace(learning, learner=traces), start)
    for task in range(GRIDS.tasks):
        assert_same(learned, task, plainly_learned(GRIDS, replace(learning, learner=one_step), start, task))


def test_a_task_without_an_end_leaves_nothing_to_the_next_in_its_lane() -> None:
    """Episodes of one step, each cut off: what Sarsa's last one waits for never comes."""
    learning = replace(USUAL, learner=Sarsa(), alpha=VISITS, epsilon=FALLING, horizon=1)
    whole = learned_by(TABLES, learning, Start(table_of(TABLES)))
    np.testing.assert_array_equal(whole.visits.sum(axis=(1, 2)), EPISODES)


def test_double_q_learning_without_coins_is_refused() -> None:
    bare = replace(streams(TABLES.tasks), learner=None)
    learning = replace(USUAL, learner=DoubleQ())
    with pytest.raises(ValueError, match="no streams of its own"):
        learn(TABLES.worlds(), learning, Start(table_of(TABLES)), bare, ALL, Watch())
