"""Gymnasium in the compiled loop, by its tables and called back step by step, against plain loops around gymnasium."""

from __future__ import annotations

import dataclasses
from typing import Any

import gymnasium
import numpy as np
import pytest
import reference

from qinit_cli.environments.family import draw_tasks
from qinit_cli.environments.gym import Gym
from qinit_cli.kernels.batch import LaneStreams, Records, Start, learn
from qinit_cli.kernels.python_steps import PythonWorlds
from qinit_cli.kernels.random_streams import lane_seeds, seeds
from qinit_cli.kernels.worlds import CUT, GOAL
from qinit_cli.learning import Learning
from qinit_cli.pipeline.sources import sequences
from qinit_cli.seeding import Stream
from qinit_cli.watch import Watch

LAKE = Gym(env_id="FrozenLake-v1", vary=["success_rate=uniform:0.4,0.9"])
POLE = Gym(
    env_id="CartPole-v1",
    vary=["gravity=normal:9.8,2", "force_mag=uniform:7,13"],
    bins="1,3,4,3",
    range=["1=-2:2", "3=-2:2"],
    goal="survived",
)
LEARNING = Learning(alpha=0.1, gamma=0.95, epsilon=0.3, episodes=60, horizon=30, start="fixed")


def tasks_of(family: Gym, count: int) -> np.ndarray:
    return draw_tasks(family, 0, Stream.SOURCE_TASK, np.arange(count))


def probability(indices: list[int]) -> LaneStreams:
    some = np.array(indices)
    streams = (Stream.SOURCE_START, Stream.TARGET_EVALUATION)
    return LaneStreams(
        lane_seeds(sequences(0, Stream.SOURCE_DICE, some)),
        *(seeds(sequences(0, each, some)) for each in streams),
    )


def learned(family: Gym, indices: list[int], learning: Learning = LEARNING, every: int = 0) -> Any:
    tasks = draw_tasks(family, 0, Stream.SOURCE_TASK, np.array(indices))
    worlds = family.worlds(tasks, sequences(0, Stream.SOURCE_WORLD, np.array(indices)))
    start = Start(np.zeros((worlds.states, worlds.actions)))
    return learn(worlds, learning, start, probability(indices), Records(60, True, True, every), Watch())


def made(env_id: str, **arguments: Any) -> Any:
    return gymnasium.make(env_id, **arguments).unwrapped


class Lake:
    """FrozenLake stepped through its own P in plain Python; entering a hole ends the episode."""

    def __init__(self, env: Any) -> None:
        self.ways, self.states, self.actions = env.P, int(env.observation_space.n), int(env.action_space.n)
        self.reset()

    def reset(self) -> None:
        self.state, self.lost = 0, False

    def step(self, draw: int, action: int, draws: Any = None) -> bool:
        odds: dict[Any, float] = {}
        for share, there, reward, done in self.ways[self.state][action]:
            after = ("end", reward > 0) if done else there
            odds[after] = odds.get(after, 0.0) + share
        number, total = (draw >> 32) * 2.0**-32 * sum(odds.values()), 0.0
        for after, share in odds.items():  # noqa: B007, the last one stays if rounding leaves a rest
            total += share
            if number < total:
                break
        self.lost = after == ("end", False)
        if not isinstance(after, tuple):
            self.state = after
        return after == ("end", True)


def test_frozen_lake_is_learned_as_a_plain_loop_through_its_transitions_learns_it() -> None:
    together = learned(LAKE, [0, 1, 2])
    for task, drawn in enumerate(tasks_of(LAKE, 3)):
        world = Lake(made("FrozenLake-v1", success_rate=float(drawn["success_rate"])))
        rng = reference.in_lanes(probability([0, 1, 2]).rng[task])
        outcome = reference.learn(world, LEARNING, np.zeros((16, 4)), rng)
        np.testing.assert_array_equal(together.visits[task], outcome.visits)
        np.testing.assert_allclose(together.q[task], outcome.q, rtol=1e-12)
        np.testing.assert_array_equal(together.steps[task], outcome.steps)
        np.testing.assert_array_equal(together.reached[task], outcome.reached)
    assert together.reached.any()


class Pole:
    """CartPole stepped through by gymnasium in plain Python: an episode's seed is the upper half of a draw of its start."""

    def __init__(self, drawn: Any, starts: Any) -> None:
        self.env = made("CartPole-v1")
        self.env.gravity, self.env.force_mag = float(drawn["gravity"]), float(drawn["force_mag"])
        self.starts, self.states, self.actions = starts, 36, 2

    def reset(self) -> None:
        self.reset_to_target(self.starts)

    def reset_to_target(self, draws: Any) -> None:
        self.state, self.lost, self.time = self.bin(self.env.reset(seed=next(draws) >> 32)[0]), False, 0

    def bin(self, observation: Any) -> int:
        _, speed, angle, turning = (float(number) for number in observation)
        widest = float(self.env.observation_space.high[2])
        places = [(speed + 2) / 4 * 3, (angle + widest) / (2 * widest) * 4, (turning + 2) / 4 * 3]
        first, second, third = (
            int(np.clip(int(place), 0, n - 1)) for place, n in zip(places, (3, 4, 3), strict=True)
        )
        return (first * 4 + second) * 3 + third

    def step(self, draw: int, action: int, draws: Any = None) -> bool:
        observation, _, self.lost, _, _ = self.env.step(action)
        self.time += 1
        survived = not self.lost and self.time == LEARNING.horizon
        if not (self.lost or survived):
            self.state = self.bin(observation)
        return survived


def test_cart_pole_is_learned_as_a_plain_loop_around_gymnasium_learns_it() -> None:
    together, given = learned(POLE, [0, 1], every=20), probability([0, 1])
    for task, drawn in enumerate(tasks_of(POLE, 2)):
        world = Pole(drawn, reference.xoshiro(given.starts[task]))
        outcome = reference.learn(
            world,
            LEARNING,
            np.zeros((36, 2)),
            reference.in_lanes(given.rng[task]),
            every=20,
            evaluation=reference.xoshiro(given.evaluation[task]),
        )
        np.testing.assert_array_equal(together.q[task], outcome.q)
        np.testing.assert_array_equal(together.visits[task], outcome.visits)
        np.testing.assert_array_equal(together.steps[task], outcome.steps)
        told = list(zip(together.evaluation_steps[task], together.evaluation_reached[task], strict=True))
        assert told == outcome.evaluation
    assert together.reached.any()


def test_a_simulated_task_learns_the_same_whatever_learns_beside_it_and_however_it_is_evaluated() -> None:
    whole, some = learned(POLE, [0, 1, 2]), learned(POLE, [2], every=7)
    np.testing.assert_array_equal(some.q[0], whole.q[2])
    np.testing.assert_array_equal(some.steps[0], whole.steps[2])


class Corridor:
    """Five cells, the goal behind the last; a step fails with probability 0.2; `limit` steps, after which the world cuts off."""

    def __init__(self, limit: int) -> None:
        self.limit = limit

    def start(self, seed: int) -> int:
        self.cell = self.time = 0
        self.probability = np.random.Generator(np.random.PCG64(seed))
        return 0

    def step(self, action: int) -> int:
        self.time += 1
        if self.probability.random() >= 0.2:
            self.cell = max(self.cell + (1 if action else -1), 0)
        if self.cell == 5:
            return GOAL
        return CUT - self.cell if self.time == self.limit else self.cell


@pytest.mark.parametrize("shaped", [False, True])
def test_what_a_world_cuts_off_is_learned_as_what_the_horizon_cuts_off(shaped: bool) -> None:
    potential = np.linspace(0, 0.5, 5) if shaped else None

    def learned_with(limit: int, horizon: int) -> Any:
        worlds = PythonWorlds(lambda task, _: Corridor(limit), 5, 2, np.ones((1, 4), np.uint64))
        return learn(
            worlds,
            dataclasses.replace(LEARNING, horizon=horizon),
            Start(np.zeros((5, 2)), potential),
            probability([0]),
            Records(60, True, True, evaluate_every=20),
            Watch(),
        )

    own, horizons = learned_with(7, 30), learned_with(0, 7)
    for name in ("q", "td_var", "visits", "steps", "reached", "evaluation_steps", "evaluation_reached"):
        np.testing.assert_array_equal(getattr(own, name), getattr(horizons, name))
    assert 0 < own.reached.sum() < 60
    assert own.steps[own.reached == 0].min() == own.steps.max() == 7


class Broken:
    """Raises in its third step."""

    def __init__(self) -> None:
        self.left = 3

    def start(self, seed: int) -> int:
        return 0

    def step(self, action: int) -> int:
        self.left -= 1
        return 1 // self.left


def test_what_a_simulator_raises_is_raised_and_it_is_called_no_more() -> None:
    broken = Broken()
    worlds = PythonWorlds(lambda task, horizon: broken, 2, 2, np.zeros((1, 4), np.uint64))
    with pytest.raises(ZeroDivisionError):
        learn(worlds, LEARNING, Start(np.zeros((2, 2))), probability([0]), Records(1), Watch())
    assert broken.left == 0


def test_survival_is_worth_the_horizon_and_every_end_is_a_failure() -> None:
    """Alone at the horizon is the reward paid: a pole that fell is worth nothing."""
    together = learned(POLE, [0])
    lengths, reached = together.steps[0], together.reached[0].astype(bool)
    assert (lengths[reached] == LEARNING.horizon).all()
    assert (lengths[~reached] <= LEARNING.horizon).all()
