"""The compiled loop over tiles against a plain one, against tables where one tiling is a table, and where it must stop."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
import reference
import tile_reference

from qinit_cli.environments.puddle_world import PuddleWorld
from qinit_cli.environments.tiled import TiledFamily, Tiles
from qinit_cli.kernels import random_streams as rng
from qinit_cli.kernels.batch import LaneStreams, Learned, Policies, Records, Start, learn
from qinit_cli.kernels.mountain_car import MountainCars
from qinit_cli.kernels.tile_paths import greedy_paths, path_lengths
from qinit_cli.kernels.tiles import TiledWorlds
from qinit_cli.learners import LEARNERS
from qinit_cli.learners.exploration import Boltzmann
from qinit_cli.learning import Learning
from qinit_cli.tile_coding import TileCoding
from qinit_cli.watch import Watch

BOX = ((-1.2, 0.6), (-0.07, 0.07))
ETA = np.array([0.0, 0.01, -0.02, 0.005, 0.03, -0.001, 0.0, 0.015, -0.01, 0.02])
EXPLORING = Learning(alpha=0.1, gamma=0.99, epsilon=0.5, episodes=12, horizon=90, start="anywhere")
SUMS = [name for name, learner in LEARNERS.items() if learner.sums]


def coding(tilings: int, tiles: int) -> TileCoding:
    low, high = zip(*BOX, strict=True)
    return TileCoding(low, high, tilings, tiles)


def streams(kind: int, tasks: int) -> list[np.random.SeedSequence]:
    return [np.random.SeedSequence(1, spawn_key=(kind, task)) for task in range(tasks)]


def probability(tasks: int) -> LaneStreams:
    return LaneStreams(
        rng.lane_seeds(streams(0, tasks)), *(rng.seeds(streams(kind, tasks)) for kind in (1, 3, 4))
    )


def first_weight(place: tile_reference.Place, action: int) -> float:
    """A weight that no rule of ours makes."""
    return (hash((*place, action)) % 97) / 1024


def first_weights(tilings: int, tiles: int) -> np.ndarray:
    """The same, laid out as ours are: row-major within a tiling, tilings one after the other."""
    along = tiles + (tilings > 1)
    weights = [
        [first_weight((i, row, column), action) for action in range(3)]
        for i in range(tilings)
        for row in range(along)
        for column in range(along)
    ]
    return np.array(weights)


def assert_same(learned: Learned, task: int, linear: Any, steps: list[int], reached: list[bool]) -> None:
    tilings, tiles = linear.tiles.tilings, linear.tiles.tiles
    along = tiles + (tilings > 1)
    for ((i, row, column), action), weight in linear.weights.items():
        assert learned.q[task, (i * along + row) * along + column, action] == weight
    assert len(linear.weights) > 3 * tilings  # something was learned
    np.testing.assert_array_equal(learned.steps[task], steps)
    np.testing.assert_array_equal(learned.reached[task], reached)


@pytest.mark.parametrize("name", ["q-learning", "sarsa", "expected-sarsa", "sarsa-lambda"])
@pytest.mark.parametrize(("tilings", "tiles"), [(8, 4), (3, 5)])
def test_learning_equals_the_plain_one_to_the_last_bit(name: str, tilings: int, tiles: int) -> None:
    learning = replace(EXPLORING, learner=LEARNERS[name]())
    given, start = probability(len(ETA)), first_weights(tilings, tiles)
    worlds = TiledWorlds(MountainCars(ETA), coding(tilings, tiles))
    learned = learn(worlds, learning, Start(start), given, Records(learning.episodes), Watch())
    for task, eta in enumerate(ETA):
        starts = reference.xoshiro(given.starts[task])
        world = reference.MountainCar(4, float(eta), 0.0, "anywhere", starts)
        plain = tile_reference.Tiles(BOX, tilings, tiles)
        draws = reference.in_lanes(given.rng[task])
        assert_same(learned, task, *tile_reference.learn(world, plain, learning, draws, first_weight))


def test_potentials_and_policies_of_tiles_equal_the_plain_ones() -> None:
    tilings, tiles = 4, 6
    given, start = probability(3), first_weights(tilings, tiles)
    learning = replace(EXPLORING, start="fixed")
    policies = Policies(np.zeros((2, 1), np.int64), np.stack([start, start[:, ::-1]]), psi0=0.5, nu=0.99)
    worlds = TiledWorlds(MountainCars(ETA[:3]), coding(tilings, tiles))
    started = Start(start, start[:, 1], policies)
    learned = learn(worlds, learning, started, given, Records(learning.episodes), Watch())
    assert given.choices is not None
    for task, eta in enumerate(ETA[:3]):
        world = reference.MountainCar(
            4, float(eta), 0.0, "point", reference.xoshiro(given.starts[task]), target="point"
        )
        plain = tile_reference.Tiles(BOX, tilings, tiles)
        choices = reference.Choices(
            [first_weight, lambda place, action: first_weight(place, 2 - action)],
            reference.xoshiro(given.choices[task]),
            learning.gamma,
            policies.c,
            policies.psi0,
            policies.rho,
            policies.nu,
        )
        outcome = tile_reference.learn(
            world,
            plain,
            learning,
            reference.in_lanes(given.rng[task]),
            first_weight,
            lambda place: first_weight(place, 1),
            choices,
        )
        assert_same(learned, task, *outcome)


# the exploration knows no more of learners than whether they wait
@pytest.mark.parametrize(
    ("name", "explore"),
    [*((name, "epsilon-greedy") for name in SUMS), ("q-learning", "boltzmann"), ("sarsa", "boltzmann")],
)
def test_one_tiling_is_the_table_to_the_last_bit(name: str, explore: str) -> None:
    learning = replace(EXPLORING, learner=LEARNERS[name]())
    if explore == "boltzmann":
        learning = replace(learning, explore=Boltzmann(temperature=0.05))
    cars, bins = MountainCars(ETA, bins=6), 6
    table = np.random.default_rng(5).integers(0, 3, (bins**2, 3)) / 8
    results = [
        learn(worlds, learning, Start(table), probability(len(ETA)), Records(4, evaluate_every=4), Watch())
        for worlds in (cars, TiledWorlds(cars, coding(1, bins)))
    ]
    for field in ("q", "steps", "reached", "evaluation_steps", "evaluation_reached"):
        np.testing.assert_array_equal(getattr(results[0], field), getattr(results[1], field))


def test_a_task_learns_the_same_whatever_learns_beside_it() -> None:
    given, worlds = probability(10), TiledWorlds(MountainCars(ETA), coding(8, 4))
    start = Start(np.zeros((worlds.states, 3)))
    together = learn(worlds, EXPLORING, start, given, Records(3), Watch())
    alone = TiledWorlds(MountainCars(ETA[7:8]), coding(8, 4))
    apart = learn(alone, EXPLORING, start, reference.part(given, [7]), Records(3), Watch())
    np.testing.assert_array_equal(together.q[7], apart.q[0])


def test_pushes_that_are_drawn_every_step_are_the_same_whatever_learns_beside_the_task() -> None:
    """Eight move at once, and one alone; with one tiling both learn what the table learns."""
    given, dice = probability(8), rng.seeds(streams(5, 8))
    start, learned = Start(np.zeros((36, 3))), []
    for which in (list(range(8)), [5]):
        cars = MountainCars(ETA[which], bins=6, rng=dice[which], noise=0.01)
        own = reference.part(given, which)
        for worlds in (cars, TiledWorlds(cars, coding(1, 6))):
            learned.append(learn(worlds, EXPLORING, start, own, Records(3), Watch()).q[which.index(5)])
    assert learned[0].any()
    for one in learned[1:]:
        np.testing.assert_array_equal(one, learned[0])


def test_a_state_that_is_no_number_has_tiles() -> None:
    """Nothing in compiled code would hold an index that is none."""
    worlds = TiledWorlds(MountainCars(ETA[:1]), coding(4, 4))
    states = np.array([[np.nan, np.nan], [np.nan, 0.05]])
    weights = np.ones((1, worlds.states, 3))
    lengths = path_lengths(worlds, rng.seeds(streams(2, 1)), weights, states, 5)
    assert (lengths == -1).all()


def test_paths_from_probes_are_those_of_the_car() -> None:
    """A policy that pushes right where the car rolls right, and else left, by weights of one tiling of two tiles."""
    two = coding(1, 2)
    weights = np.zeros((2, two.weights, 3))
    for position in range(2):
        weights[:, 2 * position, 0] = weights[:, 2 * position + 1, 2] = 1.0
    worlds = TiledWorlds(MountainCars(np.array([0.0, 0.01])), two)
    states = np.array([[-0.5, 0.0], [0.55, 0.01], [0.45, 0.06]])
    words = rng.seeds(streams(2, 2))
    lengths = path_lengths(worlds, words, weights, states, 300)
    assert (lengths[:, 1] == 0).all()  # at the flag
    assert (lengths[:, 2] == 1).all()  # one step before it, whatever the push
    for task, eta in enumerate((0.0, 0.01)):
        world = reference.MountainCar(2, eta, 0.0, "point", iter(()))
        steps, action, arrived = 0, 1, False
        while not arrived:
            arrived = world.step(0, action)
            steps, action = steps + 1, 2 if world.velocity >= 0 else 0
        assert lengths[task, 0, 1] == steps
    paths, steps = greedy_paths(worlds, words, weights, 300, anywhere=False)
    assert paths[0, 0].tolist() == [-0.5, 0.0]
    assert np.isfinite(paths[0, : steps[0] + 1]).all()
    assert np.isnan(paths[0, steps[0] + 1 :]).all()
    assert paths[0, steps[0], 0] >= 0.5


def test_noise_of_a_world_moves_no_path_from_a_probe() -> None:
    family = PuddleWorld()
    tasks = np.array(
        [family.draw(np.random.default_rng(0))], [(one.name, one.dtype) for one in family.parameters()]
    )
    low, high = zip(*[one[1:] for one in family.box()], strict=True)
    worlds = TiledWorlds(family.worlds(tasks, streams(0, 1)), TileCoding(low, high, 4, 4))
    weights = np.random.default_rng(1).random((1, worlds.states, worlds.actions))
    states = np.random.default_rng(2).random((20, 2))
    one, other = (path_lengths(worlds, rng.seeds(streams(k, 1)), weights, states, 50) for k in (1, 2))
    np.testing.assert_array_equal(one, other)


def test_no_two_paths_that_begin_anywhere_begin_at_the_same_state() -> None:
    """Two tasks of four paths of a step: one each from where targets start, six from anywhere."""
    family = PuddleWorld(noise=0)
    tasks = np.array([(0.9, 0.9), (0.9, 0.7)], [(one.name, one.dtype) for one in family.parameters()])
    tiled = TiledFamily(family, Tiles(2, 4))
    states = tiled.visited(tasks, np.zeros((2, tiled.coding.weights, 4)), 1, 4)
    assert len(states) == 2 * 4 * 2
    assert len(np.unique(states, axis=0)) == 2 + 6 * 2
