"""The compiled loop over a continuous world and its bins against a plain one, step by step."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np
import pytest
import reference

from qinit_cli.environments.puddle_world import PuddleWorld
from qinit_cli.kernels import random_streams as rng
from qinit_cli.kernels.batch import LaneStreams, Records, Start, learn
from qinit_cli.learning import Learning
from qinit_cli.watch import Watch

BINS = (6, 4)
GOALS = [(0.9, 0.9), (0.7, 0.2), (0.85, 0.6), (0.15, 0.95), (0.6, 0.95)]
EXPLORING = Learning(alpha=0.1, gamma=0.9, epsilon=0.5, episodes=40, horizon=60, start="anywhere")
GREEDY = Learning(alpha=0.2, gamma=0.9, epsilon=0.1, episodes=30, horizon=90, start="fixed")
ALL = Records(bins=10, visits=True, td_var=True, evaluate_every=10)


def depth(x: float, y: float) -> float:
    """By the nearest of many points of the puddles' middles."""
    points = np.linspace(0, 1, 20_001)
    level = np.hypot(x - (0.1 + 0.35 * points), y - 0.75)
    aside = np.hypot(x - 0.45, y - (0.4 + 0.4 * points))
    return max(0.0, 0.1 - min(level.min(), aside.min()))


class Puddles:
    """One puddle world; the table sees its bin."""

    states, actions = BINS[0] * BINS[1], 4

    def __init__(
        self, goal: tuple[float, float], drowns: bool, anywhere: bool, starts: Iterator[int], dice: np.ndarray
    ) -> None:
        self.goal, self.drowns, self.anywhere, self.starts = goal, drowns, anywhere, starts
        self.dice = reference.xoshiro(dice)
        self.x, self.y, self.lost = 0.2, 0.4, False

    @property
    def state(self) -> int:
        return min(int(self.x * BINS[0]), BINS[0] - 1) * BINS[1] + min(int(self.y * BINS[1]), BINS[1] - 1)

    def reached(self) -> bool:
        return (self.x - self.goal[0]) ** 2 + (self.y - self.goal[1]) ** 2 <= 0.2**2

    def drowned(self) -> bool:
        return self.drowns and depth(self.x, self.y) > 0

    def reset(self) -> None:
        self.reset_to_target(self.starts)
        while self.anywhere:
            self.x, self.y = reference.unit(next(self.starts)), reference.unit(next(self.starts))
            if not (self.reached() or self.drowned()):
                return

    def reset_to_target(self, draws: Iterator[int]) -> None:
        self.x, self.y, self.lost = 0.2, 0.4, False

    def step(self, draw: int, action: int, draws: Iterator[int] | None = None) -> bool:
        share = 1 / (1 + 400 * depth(self.x, self.y))
        noise = reference.gusts(0.0, 0.02, self.dice if draws is None else draws)
        across, along = ((0, 0.1), (0, -0.1), (-0.1, 0), (0.1, 0))[action]
        self.x = min(max(self.x + share * (across + next(noise)), 0.0), 1.0)
        self.y = min(max(self.y + share * (along + next(noise)), 0.0), 1.0)
        self.lost = not self.reached() and self.drowned()
        return self.reached()


@pytest.mark.parametrize("learning", [EXPLORING, GREEDY], ids=["exploring", "greedy"])
@pytest.mark.parametrize("puddles", ["slow", "lost"])
def test_the_compiled_puddles_are_learned_as_the_plain_ones(learning: Learning, puddles: str) -> None:
    family = PuddleWorld(puddles=puddles, radius=0.2, step=0.1, noise=0.02, bins="6,4")
    tasks = np.array(GOALS, dtype=[("goal_x", "<f8"), ("goal_y", "<f8")])
    own = [
        [np.random.SeedSequence(1, spawn_key=(kind, task)) for task in range(len(tasks))] for kind in range(4)
    ]
    streams = LaneStreams(rng.lane_seeds(own[0]), *(rng.seeds(each) for each in own[1:3]))
    table = np.random.default_rng(5).integers(0, 3, (Puddles.states, 4)) / 8
    learned = learn(family.worlds(tasks, own[3]), learning, Start(table), streams, ALL, Watch())
    for task, goal in enumerate(GOALS):
        starts = reference.xoshiro(streams.starts[task])
        dice = rng.seeds(own[3])[task]
        world = Puddles(goal, puddles == "lost", learning.start == "anywhere", starts, dice)
        assert streams.evaluation is not None
        outcome = reference.learn(
            world,
            learning,
            table,
            reference.in_lanes(streams.rng[task]),
            every=10,
            evaluation=reference.xoshiro(streams.evaluation[task]),
        )
        # depths differ in their last bits, as nearest points of thousands are not the nearest of all
        np.testing.assert_allclose(learned.q[task], outcome.q, rtol=1e-9)
        np.testing.assert_array_equal(learned.visits[task], outcome.visits)
        np.testing.assert_allclose(learned.td_var[task], outcome.td_var, rtol=1e-9)
        assert learned.steps[task].sum() == sum(outcome.steps)
        assert learned.reached[task].sum() == sum(outcome.reached)
        evaluation = zip(learned.evaluation_steps[task], learned.evaluation_reached[task], strict=True)
        assert [(int(steps), bool(reached)) for steps, reached in evaluation] == outcome.evaluation


def test_what_a_task_learns_does_not_depend_on_its_batch() -> None:
    family = PuddleWorld(radius=0.2, bins="6,4")
    tasks = np.array(GOALS, dtype=[("goal_x", "<f8"), ("goal_y", "<f8")])
    own = [
        [np.random.SeedSequence(1, spawn_key=(kind, task)) for task in range(len(tasks))] for kind in range(4)
    ]

    def learned(which: list[int]) -> np.ndarray:
        chosen = [[each[task] for task in which] for each in own]
        streams = LaneStreams(rng.lane_seeds(chosen[0]), *(rng.seeds(each) for each in chosen[1:3]))
        start = Start(np.zeros((Puddles.states, 4)))
        return learn(family.worlds(tasks[which], chosen[3]), EXPLORING, start, streams, ALL, Watch()).q

    np.testing.assert_array_equal(learned([0, 1, 2, 3, 4])[[4, 1]], learned([4, 1]))


def test_the_depth_of_the_puddles_is_the_way_to_their_edge() -> None:
    from qinit_cli.kernels.puddles import puddle_depth

    known = {
        (0.45, 0.75): 0.1,
        (0.2, 0.8): 0.05,
        (0.3, 0.6): 0,
        (0.5, 0.5): 0.05,
        (0.45, 0.31): 0.01,
        (0.05, 0.75): 0.05,
    }
    for place, deep in known.items():
        assert math.isclose(puddle_depth(*place), deep, abs_tol=1e-12)
