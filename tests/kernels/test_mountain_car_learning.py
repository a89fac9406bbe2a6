"""The compiled Mountain Car against the plain reference and against Gymnasium's."""

from __future__ import annotations

import dataclasses
import math
from itertools import count

import gymnasium
import numpy as np
import pytest
import reference
from gymnasium.envs.classic_control import mountain_car as theirs

from qinit_cli.kernels import random_streams as rng
from qinit_cli.kernels.batch import LaneStreams, Learned, Policies, Records, Start, learn
from qinit_cli.kernels.compiled import lean
from qinit_cli.kernels.cosine import cosine
from qinit_cli.kernels.mountain_car import PUSHES, MountainCars, bin_of, is_done, moved
from qinit_cli.kernels.reals import load_reals, store_reals
from qinit_cli.learning import Learning
from qinit_cli.watch import Watch

BINS = 6
ETA = np.array([0.0, 0.01, -0.02, 0.005, 0.03, -0.001, 0.0, 0.015, -0.01, 0.02])
EXPLORING = Learning(alpha=0.1, gamma=0.99, epsilon=0.5, episodes=20, horizon=120, start="anywhere")
GREEDY = Learning(alpha=0.2, gamma=0.9, epsilon=0.1, episodes=12, horizon=250, start="fixed")
ALL = Records(bins=12, visits=True, td_var=True)


def streams(kind: int, tasks: int) -> list[np.random.SeedSequence]:
    return [np.random.SeedSequence(1, spawn_key=(kind, task)) for task in range(tasks)]


def probability(tasks: int) -> LaneStreams:
    return LaneStreams(
        rng.lane_seeds(streams(0, tasks)), *(rng.seeds(streams(kind, tasks)) for kind in (1, 3, 4))
    )


def table() -> np.ndarray:
    return np.random.default_rng(5).integers(0, 3, (BINS**2, 3)) / 8


def assert_same(learned: Learned, task: int, outcome: reference.Outcome, learning: Learning) -> None:
    assert learned.finished[task]
    np.testing.assert_array_equal(learned.q[task], outcome.q)
    np.testing.assert_array_equal(learned.visits[task], outcome.visits)
    np.testing.assert_array_equal(learned.td_var[task], outcome.td_var)
    bins = np.arange(learning.episodes) * 12 // learning.episodes
    np.testing.assert_array_equal(learned.steps[task], np.bincount(bins, outcome.steps, 12))
    np.testing.assert_array_equal(learned.reached[task], np.bincount(bins, outcome.reached, 12))


@pytest.mark.parametrize("learning", [EXPLORING, GREEDY], ids=["exploring", "greedy"])
@pytest.mark.parametrize("start", ["point", "valley"])
@pytest.mark.parametrize("phi", [None, np.linspace(0, 1, BINS**2)], ids=["unshaped", "shaped"])
def test_the_compiled_loop_equals_the_plain_one_to_the_last_bit(
    learning: Learning, start: str, phi: np.ndarray | None
) -> None:
    given = probability(len(ETA))
    learned = learn(
        MountainCars(ETA, bins=BINS, start=start), learning, Start(table(), phi), given, ALL, Watch()
    )
    for task, eta in enumerate(ETA):
        kind = "anywhere" if learning.start == "anywhere" else start
        starts = reference.xoshiro(given.starts[task])
        world = reference.MountainCar(BINS, float(eta), 0.0, kind, starts, target=start)
        outcome = reference.learn(world, learning, table(), reference.in_lanes(given.rng[task]), phi)
        assert_same(learned, task, outcome, learning)


@pytest.mark.parametrize("tasks", [1, 3, 10], ids=["alone", "three of eight, then alone", "eight and more"])
def test_pushes_drawn_every_step_evaluation_and_policies_equal_the_plain_ones(tasks: int) -> None:
    given, noise_dice = probability(tasks), rng.seeds(streams(2, tasks))
    cars = MountainCars(ETA[:tasks], hill=-0.4, bins=BINS, start="valley", noise=0.01, rng=noise_dice)
    policies = np.random.default_rng(3).integers(0, 3, (4, BINS**2))
    start = Start(table(), None, Policies(policies))
    learned = learn(cars, EXPLORING, start, given, dataclasses.replace(ALL, evaluate_every=6), Watch())
    for task, eta in enumerate(ETA[:tasks]):
        starts = reference.xoshiro(given.starts[task])
        winds = reference.gusts(float(eta), 0.01, reference.xoshiro(noise_dice[task]))
        world = reference.MountainCar(BINS, float(eta), -0.4, "anywhere", starts, "valley", 0.01, winds)
        choice_draws = reference.xoshiro(given.choices[task])
        outcome = reference.learn(
            world,
            EXPLORING,
            table(),
            reference.in_lanes(given.rng[task]),
            every=6,
            evaluation=reference.xoshiro(given.evaluation[task]),
            choices=reference.Choices(policies, choice_draws, EXPLORING.gamma, 0.1, 1.0, 0.99, 0.98),
        )
        assert_same(learned, task, outcome, EXPLORING)
        np.testing.assert_array_equal(
            learned.evaluation_steps[task], [length for length, _ in outcome.evaluation]
        )
        np.testing.assert_array_equal(
            learned.evaluation_reached[task], [reached for _, reached in outcome.evaluation]
        )


def test_a_task_learns_the_same_whatever_learns_beside_it() -> None:
    given = probability(len(ETA))
    whole = learn(MountainCars(ETA, bins=BINS), EXPLORING, Start(table()), given, ALL, Watch(), lanes=16)
    for task in (0, 9):
        alone = LaneStreams(given.rng[[task]], given.starts[[task]])
        single = learn(MountainCars(ETA[[task]], bins=BINS), EXPLORING, Start(table()), alone, ALL, Watch())
        for name in ("q", "visits", "td_var", "steps", "reached", "step_count"):
            np.testing.assert_array_equal(getattr(single, name)[0], getattr(whole, name)[task])


def test_cars_that_are_pushed_back_most_learn_first() -> None:
    assert MountainCars(ETA).queue().tolist() == [2, 8, 5, 0, 6, 3, 1, 7, 9, 4]


@lean
def put(position, velocity, push, eta, hill, after):  # type: ignore[no-untyped-def]
    """One step of one car."""
    after[0], after[1] = moved(position, velocity, push, eta, hill)


@lean
def eight_cosines(y, out):  # type: ignore[no-untyped-def]
    for first in range(0, len(y), 8):
        store_reals(out, first, cosine(load_reals(y, first)))


def one(y: float) -> float:
    return float(cosine.py_func(y))


def trajectory(steps: int) -> list[tuple[float, float]]:
    """States of Gymnasium's car under random actions, in full precision."""
    car = gymnasium.make("MountainCar-v0").unwrapped
    actions = np.random.default_rng(3).integers(0, 3, steps)
    states = []
    for step, action in zip(count(), actions):
        if step % 500 == 0:
            car.reset(seed=step)
            car.state = tuple(map(float, np.random.default_rng(step).uniform([-1.2, -0.07], [0.5, 0.07])))
            states.append((None, car.state, False))
        done = car.step(int(action))[2]
        states.append((int(action), tuple(map(float, car.state)), done))
    return states


def test_with_our_cosine_gymnasiums_car_goes_where_ours_goes_to_the_last_bit(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    class Math:
        cos = staticmethod(one)
        sin = staticmethod(math.sin)

    monkeypatch.setattr(theirs, "math", Math)
    ours, flags = np.empty(2), 0
    for action, state, done in trajectory(10_000):
        if action is None:
            ours[:] = state
            continue
        put(ours[0], ours[1], PUSHES[action], 0.0, 0.0, ours)
        assert (ours[0], ours[1]) == state
        assert bool(is_done.py_func(ours[0], ours[1])) == done
        flags += done
    assert flags > 0


def test_the_c_librarys_cosine_makes_a_last_bit_of_the_velocity_differ_now_and_then() -> None:
    """It is nearer the true value; ours is the same on every machine. Nothing but the last bits may differ."""
    before, after, different = None, np.empty(2), 0
    for action, state, _ in trajectory(10_000):
        if action is not None:
            put(before[0], before[1], PUSHES[action], 0.0, 0.0, after)
            assert abs(after[1] - state[1]) <= 2.0**-56  # an ulp of the top speed
            assert abs(after[0] - state[0]) <= 2.0**-52
            different += tuple(after) != state
        before = state
    assert different < 0.01 * 10_000


def test_the_cosine_is_right_to_the_last_place_and_the_same_for_one_and_eight() -> None:
    y = np.concatenate(
        [np.random.default_rng(7).uniform(-6.28, 6.28, 80_000), np.linspace(-3.6, 1.8, 80_000)]
    )
    eight = np.empty_like(y)
    eight_cosines(y, eight)
    np.testing.assert_array_equal(eight, cosine.py_func(y))
    np.testing.assert_array_equal(eight[:1000], [reference.cosine(float(angle)) for angle in y[:1000]])
    assert np.max(np.abs(eight - np.cos(y)) / np.spacing(np.abs(np.cos(y)))) <= 1


def test_bins_cover_positions_and_velocities() -> None:
    corners = [(-1.2, -0.07, 0), (-1.2, 0.07, 29), (0.6, -0.07, 870), (0.6, 0.07, 899), (-0.5, 0.0, 345)]
    for position, velocity, state in corners:
        assert bin_of.py_func(position, velocity, 30.0) == state
