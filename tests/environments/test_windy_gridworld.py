"""Wind on the gridworld, against closed forms, quantecon, and steps as one would write them down in plain Python."""

from __future__ import annotations

from collections import Counter
from dataclasses import asdict, replace
from typing import Any

import numpy as np
import pytest
from quantecon.markov import DiscreteDP
from scipy import stats

from qinit_cli.artefacts.settings import StoredFamily
from qinit_cli.environments.family import draw_tasks
from qinit_cli.environments.gridworld import Gridworld
from qinit_cli.environments.windy_gridworld import WindyGridworld
from qinit_cli.pipeline.sources import learn_sources
from qinit_cli.seeding import Stream
from qinit_cli.tasks import SourceTasks
from qinit_cli.watch import Watch

UP, DOWN, LEFT, RIGHT = range(4)
WAYS = {UP: (-1, 0), DOWN: (1, 0), LEFT: (0, -1), RIGHT: (0, 1)}
GAMMA = 0.95
UNLIKELY = 1e-3  # the seeds are fixed: a test that passes once passes always
GRID = WindyGridworld(size=6, goal_row=4, goal_col=3)


def tasks_of(*winds: tuple[float, int]) -> Any:
    return np.array(list(winds), [("wind", "f8"), ("direction", "i4")])


def walked(family: WindyGridworld, cell: int, ways: list[int]) -> int:
    """Where single cells lead that are entered one after another, up to the goal."""
    goal = (family.goal_row, family.goal_col)
    row, column = divmod(cell, family.size)
    for way in ways:
        if (row, column) != goal:
            row = min(max(row + WAYS[way][0], 0), family.size - 1)
            column = min(max(column + WAYS[way][1], 0), family.size - 1)
    return row * family.size + column


def model(family: WindyGridworld, wind: float, direction: int) -> tuple[Any, Any]:
    """Rewards (S, 4) and transitions (S, 4, S) of a task; the goal absorbs."""
    cells, goal = family.size**2, (family.goal_row or 0) * family.size + (family.goal_col or 0)
    flows = np.zeros((cells, 4, cells))
    for cell, action, way in np.ndindex(cells, 4, 4):
        odds = family.p if way == action else (1 - family.p) / 3
        for drift, share in ((int(wind), 1 - wind % 1), (int(wind) + 1, wind % 1)):
            flows[cell, action, walked(family, cell, [way] + [direction] * drift)] += odds * share
    rewards = flows[:, :, goal].copy()
    rewards[goal] = 0
    return rewards, flows


@pytest.mark.parametrize(
    "task", [(0.0, UP), (0.3, UP), (0.8, LEFT), (0.45, DOWN), (1.0, RIGHT), (1.7, DOWN)], ids=str
)
def test_exact_tables_are_those_of_an_independent_solver(task: tuple[float, int]) -> None:
    q, _ = GRID.solve(tasks_of(task), GAMMA)
    rewards, flows = model(GRID, *task)
    value = DiscreteDP(rewards, flows, GAMMA).solve(method="policy_iteration").v
    np.testing.assert_allclose(q[0], rewards + GAMMA * flows @ value, rtol=0, atol=1e-9)


def test_without_wind_it_is_the_gridworld() -> None:
    plain = np.array([(4, 3, 0.75)], [("goal_row", "i4"), ("goal_col", "i4"), ("p", "f8")])
    for found, expected in zip(
        GRID.solve(tasks_of((0, UP)), GAMMA), Gridworld(size=6).solve(plain, GAMMA), strict=True
    ):
        np.testing.assert_allclose(found, expected, rtol=1e-8, atol=1e-15)


@pytest.mark.parametrize("wind", [0.25, 0.9])
def test_against_the_wind_every_cell_but_the_last_is_a_geometric_wait(wind: float) -> None:
    """With sure moves a step gains a cell unless the wind takes it back; into the goal the wind does not reach."""
    family = WindyGridworld(size=8, goal_row=0, goal_col=7, p=1.0)
    q, _ = family.solve(tasks_of((wind, LEFT)), GAMMA)
    gained = (1 - wind) * GAMMA / (1 - GAMMA * wind)
    np.testing.assert_allclose(q[0, :7, RIGHT], gained ** np.arange(6, -1, -1), rtol=1e-9)


def test_a_whole_cell_of_wind_doubles_a_sure_move_and_over_the_goal_is_in_it() -> None:
    family = WindyGridworld(size=8, goal_row=7, goal_col=0, p=1.0)
    q, _ = family.solve(tasks_of((1.0, DOWN)), GAMMA)
    np.testing.assert_allclose(q[0, :56:8, DOWN], GAMMA ** np.array([3, 2, 2, 1, 1, 0, 0]), rtol=1e-9)


def test_greedy_episodes_played_in_plain_python_return_the_exact_value() -> None:
    task, rng, returns = (0.6, LEFT), np.random.default_rng(3), []
    q, _ = GRID.solve(tasks_of(task), GAMMA)
    goal = 4 * 6 + 3
    for _ in range(4_000):
        cell, steps = 0, 0
        while cell != goal and steps < 400:
            action = int(q[0, cell].argmax())
            others = [way for way in WAYS if way != action]
            way = action if rng.random() < GRID.p else int(rng.choice(others))
            drift = int(task[0]) + int(rng.random() < task[0] % 1)
            cell, steps = walked(GRID, cell, [way] + [task[1]] * drift), steps + 1
        returns.append(GAMMA ** (steps - 1) if cell == goal else 0.0)
    error = np.std(returns) / np.sqrt(len(returns))
    assert np.mean(returns) == pytest.approx(q[0, 0].max(), abs=4 * error)


def test_learning_finds_the_exact_tables() -> None:
    family = WindyGridworld(size=4, wind="any", wind_scale=0.5)
    learning = replace(family.source_learning, episodes=30_000, alpha=0.01)
    _, rows = learn_sources(SourceTasks(family, "q-learning", learning, 0), np.arange(3), Watch())
    tasks = draw_tasks(family, 0, Stream.SOURCE_TASK, np.arange(3))
    exact, _ = family.solve(tasks, learning.gamma)
    known = exact > 0
    assert (abs(rows["q"].reshape(exact.shape) / np.where(known, exact, 1) - 1)[known]).mean() < 0.03


def test_exploring_is_worth_what_its_linear_equations_say() -> None:
    task = (0.4, UP)
    q, _ = GRID.solve(tasks_of(task), GAMMA)
    rewards, flows = model(GRID, *task)
    best = q[0] == q[0].max(axis=1, keepdims=True)
    share = 0.1 / 4 + 0.9 * best / best.sum(axis=1, keepdims=True)
    chain = np.einsum("sa,sat->st", share, flows)
    chain[27] = 0  # nothing comes after the goal
    value = np.linalg.solve(np.eye(36) - GAMMA * chain, (share * rewards).sum(axis=1))
    learning = replace(GRID.target_learning, gamma=GAMMA, epsilon=0.1)
    assert GRID.exploring_value(tasks_of(task), q, learning)[0] == pytest.approx(value[0], rel=1e-8)


def test_a_table_holds_every_outcome_of_a_walk_with_its_chance() -> None:
    task = (1.4, RIGHT)
    tables = GRID.tables(tasks_of(task))
    _, flows = model(GRID, *task)
    for cell, action in np.argwhere(np.ones((36, 4), bool) & tables.open[0][:, None]):
        found: Counter[int] = Counter()
        for there, odds in zip(
            tables.after[0, cell, action], tables.probability[0, cell, action], strict=True
        ):
            found[27 if there < 0 else int(there)] += odds
        np.testing.assert_allclose([found[there] for there in range(36)], flows[cell, action], atol=1e-12)


def test_a_wind_beyond_the_grid_is_as_one_across_it() -> None:
    np.testing.assert_array_equal(
        GRID.tables(tasks_of((60.0, LEFT))).after[..., ::2],
        GRID.tables(tasks_of((6.0, LEFT))).after[..., ::2],
    )


@pytest.mark.parametrize(("shape", "scale"), [(2.0, 0.3), (1.0, 0.5), (3.6, 2.0)])
def test_winds_are_scipys_weibull(shape: float, scale: float) -> None:
    family = WindyGridworld(wind_shape=shape, wind_scale=scale, wind="left")
    tasks = draw_tasks(family, 0, Stream.SOURCE_TASK, np.arange(5_000))
    assert stats.kstest(tasks["wind"], stats.weibull_min(shape, scale=scale).cdf).pvalue > UNLIKELY
    assert set(tasks["direction"]) == {LEFT}


def test_any_wind_blows_each_way_equally_often_whatever_its_strength() -> None:
    tasks = draw_tasks(WindyGridworld(wind="any"), 0, Stream.SOURCE_TASK, np.arange(4_000))
    assert stats.chisquare(np.bincount(tasks["direction"], minlength=4)).pvalue > UNLIKELY
    assert abs(stats.spearmanr(tasks["wind"], tasks["direction"]).statistic) < 4 / np.sqrt(4_000)


def test_no_task_can_be_solved_against_a_cell_a_step_and_few_episodes_arrive_against_most_of_one() -> None:
    family = WindyGridworld(size=12)
    tasks = tasks_of((0.2, UP), (0.95, UP), (1.0, UP), (1.5, LEFT))
    q, _ = family.solve(tasks, GAMMA)
    solved = family.solved(tasks, q, 100)
    assert solved.tolist() == [True, False, False, False]
    assert family.solvable(tasks, solved, 100).tolist() == [True, True, False, False]
    assert family.start_value(q)[2:].tolist() == [0, 0]


def test_path_lengths_are_worked_by_hand() -> None:
    family = WindyGridworld(size=5, goal_row=2, goal_col=4)
    straight = np.zeros((1, 25, 4))
    straight[0, :, RIGHT] = 1
    straight = straight.repeat(3, axis=0)
    lengths = family.path_lengths(tasks_of((0.4, RIGHT), (0.6, RIGHT), (0.6, LEFT)), straight, 100)
    along = lengths.reshape(3, 5, 5, 4)[:, 2, :, RIGHT]
    assert along[0].tolist() == [4, 3, 2, 1, 0]  # as without wind
    assert along[1].tolist() == [2, 2, 1, 1, 0]  # two cells a step
    assert along[2].tolist() == [-1, -1, -1, 1, 0]  # back to where it was, but for the last step
    assert not lengths[:, 14].any()
    assert (lengths.reshape(3, 5, 5, 4)[:, 0, :, RIGHT] == -1).all()  # along the upper wall for ever


@pytest.mark.parametrize("linear", [False, True])
def test_nearness_falls_with_the_manhattan_distance(linear: bool) -> None:
    rows, columns = np.indices((6, 6))
    distance = (abs(rows - 4) + abs(columns - 3)).ravel()
    expected = 1 - distance / 10 if linear else 0.9**distance
    np.testing.assert_allclose(GRID.nearness(tasks_of((0, UP)), 0.9, linear=linear), expected)


def test_the_goal_is_at_two_thirds_unless_told_otherwise() -> None:
    assert (WindyGridworld().goal_row, WindyGridworld().goal_col) == (20, 20)
    assert WindyGridworld(goal_col=0).label == "windy-gridworld-up-scale-0.3-goal-20-0"
    assert WindyGridworld(size=6, wind="any", wind_shape=3).label == "windy-gridworld-6-any-shape-3-scale-0.3"
    assert StoredFamily.read({"name": GRID.name, **asdict(GRID)}).here == GRID


@pytest.mark.parametrize(
    ("settings", "sentence"),
    [
        ({"goal_row": 30}, r"the goal \(30, 20\) must be on the 30 x 30 grid"),
        ({"goal_row": 0, "goal_col": 0}, r"and not the start \(0, 0\)"),
        ({"wind": "north"}, "--wind is 'north'; it is one of up, down, left, right, any"),
        ({"wind_shape": 0.0}, "--wind-shape is 0.0; it must be from 0.1 to 100"),
        ({"wind_scale": -1.0}, "--wind-scale is -1.0"),
        ({"p": 0.2}, "--p is 0.2; it must be from 0.25 to 1"),
    ],
    ids=str,
)
def test_winds_that_cannot_be_meant_are_refused(settings: dict[str, Any], sentence: str) -> None:
    with pytest.raises(ValueError, match=sentence):
        WindyGridworld(**settings)


def test_without_a_scale_all_tasks_are_one_and_a_warning_says_so() -> None:
    assert (
        len(set(draw_tasks(WindyGridworld(wind_scale=0), 0, Stream.SOURCE_TASK, np.arange(9))["wind"])) == 1
    )
    assert "all tasks are the same" in WindyGridworld(wind_scale=0).warning
    assert WindyGridworld().warning == ""


def test_wind_shifts_but_not_the_size() -> None:
    assert GRID.shifted({"wind_scale": 0.5}) == replace(GRID, wind_scale=0.5)
    with pytest.raises(ValueError, match="size cannot be shifted"):
        GRID.shifted({"size": 7})


def test_a_wind_beyond_any_that_is_drawn_is_out_of_range() -> None:
    wind, _ = replace(GRID, wind_scale=0.3, wind_shape=2).parameters()
    # a draw is 0.3 * sqrt(e), and e ends where -ln(2^-53) and the tail's start at 7.7 are added: 44.4
    assert wind.fits(np.array([0.0, 1.99, 2.1, 1e308, np.nan])).tolist() == [True, True, False, False, False]
