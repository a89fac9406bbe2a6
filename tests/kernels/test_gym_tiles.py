"""Environments learned by tiles, called back by the compiled loop: against a plain loop around gymnasium, and against tables."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
import reference
import test_gym_learning
import tile_reference
from test_gym_learning import LEARNING, Corridor, probability, tasks_of

from qinit_cli.environments.family import draw_tasks
from qinit_cli.environments.gym import Gym
from qinit_cli.environments.tiled import TiledFamily, Tiles
from qinit_cli.kernels.batch import Learned, Records, Start, learn
from qinit_cli.kernels.python_steps import PythonWorlds, TiledPythonWorlds
from qinit_cli.kernels.worlds import CUT
from qinit_cli.pipeline.sources import sequences
from qinit_cli.seeding import Stream
from qinit_cli.tile_coding import TileCoding
from qinit_cli.watch import Watch

POLE = replace(test_gym_learning.POLE, bins=None)


def tiled(family: Gym, tilings: int, tiles: int) -> Any:
    return TiledFamily(family, Tiles(tilings, tiles, 64))


def learned(family: Any, count: int) -> Learned:
    indices = np.arange(count)
    tasks = draw_tasks(family, 0, Stream.SOURCE_TASK, indices)
    worlds = family.worlds(tasks, sequences(0, Stream.SOURCE_WORLD, indices))
    start = Start(np.zeros((worlds.states, worlds.actions)))
    paid = family.payment(LEARNING.gamma)
    given = probability(indices.tolist())
    return learn(worlds, LEARNING, start, given, Records(60), Watch(), payment=paid)


class Pole(test_gym_learning.Pole):
    """The pole as tiles see it."""

    def bin(self, observation: Any) -> int:
        self.observed = [float(number) for number in observation]
        return 0


@pytest.mark.parametrize("reward", ["goal", "native"])
def test_cart_pole_by_tiles_is_learned_as_a_plain_loop_around_gymnasium_learns_it(reward: Any) -> None:
    """To the last bit: both sum the weights of a state, and add to them, in the order of the tilings."""
    tilings, tiles = 4, 3
    family = replace(POLE, reward=reward, returns="0:30" if reward == "native" else None)
    together, given = learned(tiled(family, tilings, tiles), 2), probability([0, 1])
    for task, drawn in enumerate(tasks_of(POLE, 2)):
        world = Pole(drawn, reference.xoshiro(given.starts[task]))
        if reward == "native":
            world.paid = 1.0  # a pole's every step
        high = world.env.observation_space.high.tolist()
        box = [(-high[0], high[0]), (-2.0, 2.0), (-high[2], high[2]), (-2.0, 2.0)]
        plain = tile_reference.Tiles(box, tilings, tiles)
        draws = reference.in_lanes(given.rng[task])
        linear, steps, reached = tile_reference.learn(world, plain, LEARNING, draws)
        weights = np.zeros((tilings, *(tiles + 1,) * 4, 2))
        for (place, action), weight in linear.weights.items():
            weights[*place, action] = weight
        np.testing.assert_array_equal(together.q[task], weights.reshape(-1, 2))
        np.testing.assert_array_equal(together.steps[task], steps)
        np.testing.assert_array_equal(together.reached[task], reached)
    assert together.reached.any()
    assert not together.reached.all()
    if together.returns is not None:
        expected = (1 - LEARNING.gamma**together.steps) / (1 - LEARNING.gamma)
        np.testing.assert_allclose(together.returns, expected, rtol=1e-12)


def test_one_tiling_is_the_table_of_bins_to_the_last_bit() -> None:
    ranges = ["0=-4:4", "1=-2:2", "2=-0.25:0.25", "3=-2:2"]  # powers of two: no bin is rounded
    table = learned(replace(POLE, range=ranges, bins="4"), 2)
    tiles = learned(tiled(replace(POLE, range=ranges), 1, 4), 2)
    for name in ("q", "steps", "reached"):
        np.testing.assert_array_equal(getattr(table, name), getattr(tiles, name))
    assert table.q.any()


class Line(Corridor):
    """The corridor, its cells at 0 to 4 on a line."""

    def __init__(self, limit: int, state: Any) -> None:
        super().__init__(limit)
        self.at = state

    def start(self, seed: int) -> int:
        super().start(seed)
        return self.seen()

    def step(self, action: int) -> int:
        code = super().step(action)
        cut = code <= CUT
        return code if code < 0 and not cut else CUT * cut + self.seen()

    def seen(self) -> int:
        self.at[0] = self.cell
        return 0


def on_a_line(simulator: Any) -> TiledPythonWorlds:
    worlds = PythonWorlds(simulator, 0, 2, np.ones((1, 4), np.uint64), dimensions=1)
    return TiledPythonWorlds(worlds, TileCoding((0.0,), (5.0,), 2, 5))


def test_what_a_world_cuts_off_is_learned_as_what_the_horizon_cuts_off() -> None:
    def learned_with(limit: int, horizon: int) -> Learned:
        worlds = on_a_line(lambda task, _, state: Line(limit, state))
        learning, start = replace(LEARNING, horizon=horizon), Start(np.zeros((worlds.states, 2)))
        return learn(worlds, learning, start, probability([0]), Records(60), Watch())

    own, horizons = learned_with(7, 30), learned_with(0, 7)
    for name in ("q", "steps", "reached"):
        np.testing.assert_array_equal(getattr(own, name), getattr(horizons, name))
    assert 0 < own.reached.sum() < 60
    assert own.steps.max() == 7


def test_what_a_simulator_raises_is_raised_and_it_is_called_no_more() -> None:
    broken = test_gym_learning.Broken()
    worlds = on_a_line(lambda task, horizon, state: broken)
    start = Start(np.zeros((worlds.states, 2)))
    with pytest.raises(ZeroDivisionError):
        learn(worlds, LEARNING, start, probability([0]), Records(60), Watch())
    assert broken.left == 0
