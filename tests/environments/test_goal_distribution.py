from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from scipy import stats

from qinit_cli.environments.family import draw_tasks
from qinit_cli.environments.gridworld import Gridworld
from qinit_cli.seeding import Stream

DRAWS = 10_000
UNLIKELY = 1e-3  # the seeds are fixed: a test that passes once passes always


def _drawn(family: Gridworld, count: int = DRAWS) -> Any:
    return draw_tasks(family, 0, Stream.SOURCE_TASK, np.arange(count))


def _counts(family: Gridworld, tasks: Any) -> Any:
    """(size, size)."""
    found = np.zeros((family.size, family.size), np.int64)
    np.add.at(found, (tasks["goal_row"], tasks["goal_col"]), 1)
    return found


def _rounded_normal(size: int, mean: float, variance: float) -> Any:
    """The probability of each cell of the grid but (0, 0), (size, size)."""
    edges = np.arange(size + 1) - 0.5
    along = np.diff(stats.norm.cdf(edges, mean, math.sqrt(variance)))
    probabilities = np.outer(along, along)
    probabilities[0, 0] = 0
    return probabilities / probabilities.sum()


@pytest.mark.parametrize(("size", "mean", "variance"), [(30, 20, 7), (30, 20, 1), (8, 6, 10), (6, 0, 3)])
def test_normal_goals_are_the_rounded_normal_on_the_grid(size: int, mean: float, variance: float) -> None:
    family = Gridworld(size=size, mean=mean, variance=variance)
    found = _counts(family, _drawn(family))
    expected = DRAWS * _rounded_normal(size, mean, variance)
    frequent = expected >= 5
    observed = np.append(found[frequent], found[~frequent].sum())
    wanted = np.append(expected[frequent], expected[~frequent].sum())
    possible = wanted > 0
    assert not observed[~possible].any()
    assert stats.chisquare(observed[possible], wanted[possible]).pvalue > UNLIKELY


def test_rows_and_columns_of_normal_goals_have_the_rounded_normals_moments() -> None:
    family = Gridworld(variance=7)
    tasks = _drawn(family)
    for name in ("goal_row", "goal_col"):
        # far from the walls, rounding adds 1/12 to the variance
        spread = math.sqrt((7 + 1 / 12) / DRAWS)
        assert tasks[name].mean() == pytest.approx(20, abs=4 * spread)
        assert tasks[name].var() == pytest.approx(7 + 1 / 12, rel=4 * math.sqrt(2 / DRAWS))
    assert abs(np.corrcoef(tasks["goal_row"], tasks["goal_col"])[0, 1]) < 4 / math.sqrt(DRAWS)


def test_uniform_goals_are_equally_frequent_but_never_at_the_start() -> None:
    family = Gridworld(size=5, goals="uniform")
    found = _counts(family, _drawn(family))
    assert found[0, 0] == 0
    assert stats.chisquare(found.ravel()[1:]).pvalue > UNLIKELY


def test_normal_goals_are_never_at_the_start_even_where_the_mean_is() -> None:
    family = Gridworld(size=6, mean=0, variance=1)
    found = _counts(family, _drawn(family, 2_000))
    assert found[0, 0] == 0
    assert found.sum() == 2_000


def test_p_is_uniform_between_its_bounds_and_drawn_once_a_task() -> None:
    family = Gridworld(p_low=0.4, p_high=0.7)
    p = _drawn(family)["p"]
    assert stats.kstest(p, stats.uniform(0.4, 0.3).cdf).pvalue > UNLIKELY
    assert len(np.unique(p)) == DRAWS
    assert set(_drawn(Gridworld(p_low=0.75, p_high=0.75), 5)["p"]) == {0.75}


def test_without_variance_the_goal_is_the_mean() -> None:
    tasks = _drawn(Gridworld(size=9, variance=0), 20)
    assert set(tasks["goal_row"]) == set(tasks["goal_col"]) == {6}


def test_the_mean_is_two_thirds_of_the_size_and_the_variance_seven_unless_told_otherwise() -> None:
    assert (Gridworld().mean, Gridworld().variance) == (20, 7)
    assert Gridworld(size=6).mean == 4
    assert (Gridworld(goals="uniform").mean, Gridworld(goals="uniform").variance) == (None, None)


def test_a_task_does_not_depend_on_how_many_are_drawn() -> None:
    family = Gridworld()
    np.testing.assert_array_equal(
        draw_tasks(family, 3, Stream.SOURCE_TASK, np.array([17, 4])), _drawn_with(family, 3)[[17, 4]]
    )


def _drawn_with(family: Gridworld, seed: int) -> Any:
    return draw_tasks(family, seed, Stream.SOURCE_TASK, np.arange(50))


def test_sources_targets_and_seeds_are_drawn_apart() -> None:
    family, indices = Gridworld(goals="uniform"), np.arange(50)
    drawn = [
        draw_tasks(family, seed, stream, indices)["p"]
        for seed, stream in ((0, Stream.SOURCE_TASK), (0, Stream.TARGET_TASK), (1, Stream.SOURCE_TASK))
    ]
    assert not (drawn[0] == drawn[1]).any()
    assert not (drawn[0] == drawn[2]).any()


@pytest.mark.parametrize(
    ("settings", "sentence"),
    [
        ({"goals": "uniform", "variance": 3.0}, "--variance belongs to normal goals"),
        ({"goals": "uniform", "mean": 3.0}, "--mean belongs to normal goals"),
        ({"goals": "sideways"}, "--goals is 'sideways'; it is one of normal, uniform"),
        ({"p_low": 0.8, "p_high": 0.7}, r"--p-low 0\.8 is above --p-high 0\.7"),
        ({"p_low": 0.2}, "--p-low is 0.2; it must be from 0.25 to 1"),
        ({"p_high": 1.1}, "--p-high is 1.1; it must be from 0.25 to 1"),
        ({"p_low": math.nan}, "--p-low is nan; it must be a finite number"),
        ({"size": 1}, "--size is 1; it must be from 2 to 1000"),
        ({"variance": -1.0}, "--variance is -1.0; it must be at least 0"),
        ({"variance": math.inf}, "--variance is inf; it must be a finite number"),
        ({"mean": 60.0, "variance": 1.0}, "less than once in 100 draws"),
        ({"mean": 100.0, "variance": 100.0}, "less than once in 100 draws"),
        ({"mean": 0.0, "variance": 0.01}, "less than once in 100 draws"),  # on the start alone
        ({"mean": 0.5, "variance": 0.0}, "less than once in 100 draws"),  # rounds to the start
        ({"mean": 29.5, "variance": 0.0}, "less than once in 100 draws"),  # rounds off the grid
    ],
    ids=str,
)
def test_distributions_that_cannot_be_meant_are_refused(settings: dict[str, Any], sentence: str) -> None:
    with pytest.raises(ValueError, match=sentence):
        Gridworld(**settings)


def test_the_least_mass_is_one_in_a_hundred() -> None:
    # along each axis a tenth of the draws: the normal's mass beyond 1.2816 deviations
    deviation = 2.0
    just = 29.5 + 1.2816 * deviation
    assert Gridworld(mean=just - 0.01, variance=deviation**2).mean == just - 0.01
    with pytest.raises(ValueError, match="less than once in 100 draws"):
        Gridworld(mean=just + 0.01, variance=deviation**2)


def test_a_shift_changes_what_it_names_and_keeps_the_rest() -> None:
    family = Gridworld(variance=3, mean=15, p_low=0.7)
    assert family.shifted({"variance": 10.0}) == Gridworld(variance=10, mean=15, p_low=0.7)
    assert family.shifted({"goals": "uniform"}) == Gridworld(goals="uniform", p_low=0.7)
    assert Gridworld(goals="uniform").shifted({"goals": "normal", "variance": 3.0}) == Gridworld(variance=3)


def test_the_size_cannot_be_shifted() -> None:
    with pytest.raises(ValueError, match="size cannot be shifted"):
        Gridworld().shifted({"size": 20})


def test_labels_tell_distributions_apart_by_size_and_goals() -> None:
    assert Gridworld(variance=3).label == "gridworld-variance-3"
    assert Gridworld(size=6, variance=2.5).label == "gridworld-6-variance-2.5"
    assert Gridworld(goals="uniform").label == "gridworld-uniform"
