"""The continuous families: tasks, paths and starts known by hand, a pole that falls as Gymnasium's does, and what is refused."""

from __future__ import annotations

import importlib
import math
from typing import Any

import gymnasium
import numpy as np
import pytest

import qinit_cli as qinit
from qinit_cli.environments import FAMILIES, Family
from qinit_cli.environments.acrobot import Acrobot
from qinit_cli.environments.cart_pole import CartPole
from qinit_cli.environments.continuous import ContinuousFamily
from qinit_cli.environments.continuous_gridworld import ContinuousGridworld
from qinit_cli.environments.family import draw_tasks
from qinit_cli.environments.mountain_car import MountainCar
from qinit_cli.environments.puddle_world import PuddleWorld
from qinit_cli.errors import NotAllowed
from qinit_cli.kernels.puddles import puddle_depth
from qinit_cli.seeding import Stream

CONTINUOUS = [name for name in FAMILIES if issubclass(FAMILIES[name], ContinuousFamily)]
RIGHT = 3  # in the square


def tasks_of(family: Family, count: int) -> np.ndarray:
    return draw_tasks(family, 0, Stream.SOURCE_TASK, np.arange(count))


def always(family: Family, action: int) -> np.ndarray:
    """A table whose greedy action is that one everywhere, (1, S, A)."""
    q = np.zeros((1, math.prod(family.shape), len(family.actions)))
    q[..., action] = 1
    return q


def goal(x: float, y: float) -> np.ndarray:
    return np.array([(x, y)], dtype=[("goal_x", "<f8"), ("goal_y", "<f8")])


def test_the_continuous_families_are_these() -> None:
    assert CONTINUOUS == ["continuous-gridworld", "puddle-world", "cart-pole", "acrobot"]


@pytest.mark.parametrize("name", CONTINUOUS)
def test_the_box_names_the_axes_and_holds_the_target_start(name: str) -> None:
    family: Any = FAMILIES[name]()
    assert [axis.name for axis in family.axes()] == [dimension for dimension, _, _ in family.box()]
    for (_, low, high), at in zip(family.box(), family.target_state(), strict=True):
        assert low < at < high
    assert family.label == name
    assert family._starts().sum() == pytest.approx(1)
    (bins,) = {tuple(family.shape)}
    assert FAMILIES[name](bins=",".join(map(str, bins))) == family


def test_boxes_and_starts_are_those_of_the_worlds() -> None:
    carts, acrobots = (
        importlib.import_module(f"qinit_cli.kernels.{name}") for name in ("cart_pole", "acrobot")
    )
    (_, *track), _, (_, *angles), _ = CartPole().box()
    assert (track, angles) == ([-carts.TRACK, carts.TRACK], [-carts.UPRIGHT, carts.UPRIGHT])
    assert (CartPole.start_spread, Acrobot.start_spread) == (carts.SPREAD, acrobots.SPREAD)


def test_the_mountain_cars_box_is_gymnasiums() -> None:
    space: Any = gymnasium.make("MountainCar-v0").observation_space
    _, low, high = zip(*MountainCar().box(), strict=True)
    np.testing.assert_allclose([low, high], [space.low, space.high], rtol=1e-6)


def test_paths_in_the_square_are_counted_from_the_bins_centres() -> None:
    """Steps of 0.1 to the right towards a disc of 0.12 around (0.85, 0.55), whose edge is at x = 0.73."""
    family = ContinuousGridworld(step=0.1, radius=0.12, bins="10")
    lengths = family.path_lengths(goal(0.85, 0.55), always(family, RIGHT), 50).reshape(10, 10, 4)
    assert lengths[:, 5, RIGHT].tolist() == [7, 6, 5, 4, 3, 2, 1, 0, 0, 0]
    assert lengths[0, 5, 2] == 9  # against the wall, then eight steps from x = 0
    assert lengths[3, 5, 2] == 6
    assert (lengths[:, 0, RIGHT] == -1).all()
    assert lengths[7, 4, 0] == 1  # up, into the goal


def test_visits_of_a_path_are_counted_with_both_ends_and_only_where_it_arrives() -> None:
    family = ContinuousGridworld(step=0.2, radius=0.1, bins="5")
    q = always(family, RIGHT)
    visits = family.visits(goal(0.9, 0.1), q, 50).reshape(5, 5)
    assert visits[:, 0].tolist() == [1] * 5
    assert visits.sum() == 5
    assert not family.visits(goal(0.9, 0.9), q, 50).any()
    assert not family.visits(goal(0.9, 0.1), q, 3).any()
    certain = ContinuousGridworld(step=0.2, radius=0.1, bins="5", noise=0)
    assert [bool(certain.solved(goal(0.9, 0.1), q, steps)[0]) for steps in (3, 4)] == [False, True]


def test_a_step_through_a_puddle_is_as_much_shorter_as_it_costs_more() -> None:
    """From the middle, 0.1 deep, a step of 0.041 goes 0.001; where it is 0.05 deep a step of 0.21 goes 0.01."""
    family = PuddleWorld(step=0.041, radius=0.02, bins="1000,1")
    world = family._alone(goal(0.4, 0.4), 10, noisy=False).world
    assert moved(world, 0.2, 0.75, RIGHT) == pytest.approx((0.201, 0.75))
    world = world._replace(step=0.21)
    assert moved(world, 0.2, 0.8, RIGHT) == pytest.approx((0.21, 0.8))
    assert moved(world, 0.2, 0.4, RIGHT) == pytest.approx((0.41, 0.4))


def moved(world: Any, x: float, y: float, action: int) -> tuple[float, float]:
    """Where a step leads."""
    from qinit_cli.kernels.compiled import kept_with
    from qinit_cli.kernels.worlds import step_of

    def step(world, action, rng):  # type: ignore[no-untyped-def]
        step_of(world, 0, 0, 0, action, 0.5, rng)

    world.observed[0] = x, y
    kept_with((), step)(world, action, np.ones(4, np.uint64))
    return tuple(world.observed[0].tolist())  # type: ignore[return-value]


@pytest.mark.parametrize("options", [{}, {"goals": "uniform"}, {"mean": 0.2, "std": 0.3}], ids=str)
def test_goals_lie_in_the_square_off_the_start_and_beside_puddles(options: dict[str, Any]) -> None:
    for family in (ContinuousGridworld(**options), PuddleWorld(**options)):
        tasks = tasks_of(family, 400)
        x, y = tasks["goal_x"], tasks["goal_y"]
        assert (np.minimum(x, y) >= 0).all()
        assert (np.maximum(x, y) <= 1).all()
        assert (np.hypot(x - family.start[0], y - family.start[1]) > family.radius).all()
        if isinstance(family, PuddleWorld):
            assert max(map(puddle_depth, x, y)) == 0
        chances = family.goal_chances().reshape(family.shape)
        assert chances.sum() == pytest.approx(1)
        halves = np.array([chances[:10].sum(), chances[:, :10].sum()])
        drawn = np.array([(x < 0.5).mean(), (y < 0.5).mean()])
        np.testing.assert_allclose(halves, drawn, atol=4 * 0.5 / math.sqrt(400))


def test_a_pole_that_is_pushed_one_way_falls_when_gymnasiums_does() -> None:
    family = CartPole(length="0.5", bins="1")
    env: Any = gymnasium.make("CartPole-v1").unwrapped
    env.reset(seed=0)
    env.state, steps, fallen = np.zeros(4), 0, False
    while not fallen:
        fallen, steps = env.step(1)[2], steps + 1
    tasks = tasks_of(family, 1)
    assert family.path_lengths(tasks, always(family, 1), steps - 1).tolist() == [[[steps - 1] * 2]]
    assert family.path_lengths(tasks, always(family, 1), steps)[0, 0, 1] == -1


def test_poles_that_do_not_fall_reach_the_horizon_and_hanging_ones_come_up() -> None:
    for family in (CartPole(), CartPole(goal="up")):
        tasks = tasks_of(family, 20)
        assert family.solvable(tasks, np.zeros(20, bool), 500).all()
    assert not family.solvable(tasks, np.zeros(20, bool), 50).any()  # the last: none comes up so soon
    hopeless = CartPole(force_mag="0.001")
    assert not hopeless.solvable(tasks_of(hopeless, 3), np.zeros(3, bool), 1000).any()


def test_an_acrobot_can_be_swung_up_and_one_too_heavy_cannot() -> None:
    family = Acrobot()
    assert family.solvable(tasks_of(family, 20), np.zeros(20, bool), 500).all()
    heavy = Acrobot(mass_1="10", mass_2="10", length_1="5")
    assert not heavy.solvable(tasks_of(heavy, 2), np.zeros(2, bool), 500).any()


def test_a_start_that_is_drawn_is_worth_the_mean_over_its_bins() -> None:
    family = CartPole(
        bins="2,1,3,1"
    )  # +-0.05 is half of either side, and within the middle third of the angles
    q = np.arange(12.0).reshape(1, 6, 2)
    assert family.start_value(q)[0] == pytest.approx((q[0, 1].max() + q[0, 4].max()) / 2)
    square = ContinuousGridworld(bins="2")
    assert square.start_value(np.arange(16.0).reshape(1, 4, 4)).tolist() == [3.0]


def test_nearness_falls_by_gamma_a_step() -> None:
    family = ContinuousGridworld(bins="10", step=0.1)
    near = family.nearness(goal(0.55, 0.55), 0.9, linear=False).reshape(10, 10)
    assert near[5, 5] == pytest.approx(1)
    assert near[3, 6] == pytest.approx(0.9**3)
    linear = family.nearness(goal(0.55, 0.55), 0.9, linear=True).reshape(10, 10)
    assert linear[3, 6] == pytest.approx(1 - 0.3 / 2)


@pytest.mark.parametrize("name", ["cart-pole", "acrobot"])
def test_parameters_that_are_not_drawn_are_columns_too(name: str) -> None:
    family = FAMILIES[name](gravity="truncnorm:10,2,5,15")
    tasks = tasks_of(family, 50)
    assert tasks.dtype.names == tuple(column.name for column in family.parameters())
    for column in family.parameters():
        assert column.low <= tasks[column.name].min() <= tasks[column.name].max() <= column.high
    assert np.ptp(tasks["gravity"]) > 1


REFUSED: list[tuple[str, dict[str, Any], str]] = [
    ("cart-pole", {"bins": "3,3"}, "--bins 3,3: cart-pole has 4 dimensions, x, x_dot, theta, theta_dot"),
    ("acrobot", {"bins": "0"}, "give one whole number above 0"),
    ("acrobot", {"bins": "40"}, "2,560,000 bins, and a table has 1,000,000 at most"),
    ("cart-pole", {"length": "-1"}, "--length -1: half the pole's length must be from 0.01 to 100"),
    ("cart-pole", {"gravity": "normal:9.8,1"}, "a normal has negative values too; write truncnorm:MEAN,STD,LOW,HIGH"),
    ("cart-pole", {"masspole": "uniform:0,1"}, "mass of the pole must be from 0.001 to 1000"),
    ("cart-pole", {"masscart": "heavy"}, "--masscart heavy: write a number, or uniform:LOW,HIGH"),
    ("acrobot", {"mass_1": "choice:a|b"}, "--mass-1 choice:a|b: mass of the first link is a number"),
    ("puddle-world", {"goals": "uniform", "mean": 0.5}, "--mean belongs to normal goals"),
    ("puddle-world", {"mean": 0.45, "std": 0.001}, "where no goal may be"),
    ("continuous-gridworld", {"mean": 0.1, "std": 0.01}, "where no goal may be"),
]  # fmt: skip


@pytest.mark.parametrize(("name", "options", "told"), REFUSED, ids=lambda value: str(value)[:30])
def test_what_cannot_be_is_refused_in_a_sentence(name: str, options: dict[str, Any], told: str) -> None:
    with pytest.raises(ValueError, match=r"^(--|normal|uniform|goals)") as refused:
        FAMILIES[name](**options)
    assert told in str(refused.value)


def test_what_has_no_meaning_is_not_allowed() -> None:
    survived, noisy = CartPole(), ContinuousGridworld()
    nothing = np.zeros((1, 1, 1), np.int64)
    with pytest.raises(NotAllowed, match="as long as the horizon"):
        survived.log_path(tasks_of(survived, 1), nothing)
    with pytest.raises(NotAllowed, match="density"):
        noisy.log_path(tasks_of(noisy, 1), nothing)
    for family in (CartPole(goal="up"), Acrobot(), ContinuousGridworld(noise=0)):
        assert family.log_path(tasks_of(family, 1), nothing).tolist() == [[[0.0]]]
    with pytest.raises(NotAllowed, match="no exact tables"):
        noisy.solve(tasks_of(noisy, 1), 0.9)
    with pytest.raises(ValueError, match=r"goal cannot be shifted: the bins would cover another box"):
        survived.shifted({"goal": "up"})
    with pytest.raises(ValueError, match="the tables have"):
        survived.shifted({"bins": "2"})


def test_tasks_that_are_all_the_same_are_warned_of() -> None:
    assert "all tasks are the same" in CartPole(length="0.5").warning
    assert CartPole().warning == ""


def test_a_learned_table_leads_to_the_goal() -> None:
    sources = qinit.train_sources(qinit.families.continuous_gridworld(bins="6"), tasks=4, episodes=2000)
    assert sources["solved"].all()
