"""Goals from a mixture of normals, against scipy's normals and the gridworld's own draws."""

from __future__ import annotations

import math
from dataclasses import asdict
from typing import Any

import numpy as np
import pytest
from scipy import stats

from qinit_cli.artefacts.settings import StoredFamily
from qinit_cli.environments.family import draw_tasks
from qinit_cli.environments.gridworld import Gridworld
from qinit_cli.environments.mixture_gridworld import MixtureGridworld
from qinit_cli.seeding import Stream

DRAWS = 10_000
UNLIKELY = 1e-3  # the seeds are fixed: a test that passes once passes always


def _counts(family: MixtureGridworld) -> Any:
    """How often each cell is a goal, (S,)."""
    tasks = draw_tasks(family, 0, Stream.SOURCE_TASK, np.arange(DRAWS))
    return np.bincount(tasks["goal_row"] * family.size + tasks["goal_col"], minlength=family.size**2)


def _rounded_normal(size: int, row: float, column: float, variance: float) -> Any:
    """The probability of each cell of the grid but (0, 0), (S,)."""
    edges, deviation = np.arange(size + 1) - 0.5, math.sqrt(variance)
    probabilities = np.outer(*(np.diff(stats.norm.cdf(edges, mean, deviation)) for mean in (row, column)))
    probabilities[0, 0] = 0
    return (probabilities / probabilities.sum()).ravel()


TWO = MixtureGridworld(size=12, means="2:9,8:1.5", variances="1,4", weights="1,3")
EXPECTED = 0.25 * _rounded_normal(12, 2, 9, 1) + 0.75 * _rounded_normal(12, 8, 1.5, 4)


def test_chances_are_the_weighted_normals_each_on_the_grid() -> None:
    np.testing.assert_allclose(TWO.goal_chances(), EXPECTED, rtol=1e-9, atol=1e-15)


def test_goals_are_drawn_with_these_chances() -> None:
    found, wanted = _counts(TWO), DRAWS * EXPECTED
    frequent = wanted >= 5
    observed = np.append(found[frequent], found[~frequent].sum())
    assert stats.chisquare(observed, np.append(wanted[frequent], wanted[~frequent].sum())).pvalue > UNLIKELY


def test_redrawing_at_the_edge_leaves_the_weights_alone() -> None:
    """A third of the first normal is on the grid; it is drawn as often as the second all the same."""
    family = MixtureGridworld(size=30, means="0:29.5,15:15", variances="1")
    near = _counts(family).reshape(30, 30)[:8, 22:].sum()
    assert stats.binomtest(int(near), DRAWS, 0.5).pvalue > UNLIKELY


def test_one_mean_is_the_gridworlds_distribution() -> None:
    one = MixtureGridworld(size=9, means="5:5", variances="3")
    np.testing.assert_array_equal(one.goal_chances(), Gridworld(size=9, mean=5, variance=3).goal_chances())


def test_a_task_is_solved_as_the_gridworlds_own() -> None:
    family, plain = MixtureGridworld(size=7), Gridworld(size=7)
    tasks = draw_tasks(family, 0, Stream.TARGET_TASK, np.arange(5))
    np.testing.assert_array_equal(family.solve(tasks, 0.95), plain.solve(tasks, 0.95))


def test_the_means_are_at_one_and_two_thirds_unless_told_otherwise() -> None:
    assert asdict(MixtureGridworld()) | {"p_low": 0, "p_high": 0} == {
        "size": 30, "means": "10:10,20:20", "variances": "7", "weights": "1", "p_low": 0, "p_high": 0,
            "reward": "goal",
    }  # fmt: skip
    assert MixtureGridworld(size=6).means == "2:2,4:4"


@pytest.mark.parametrize(
    ("one", "other"),
    [
        ({"variances": "7, 7.0"}, {"variances": "7"}),
        ({"weights": "2,2"}, {"weights": "1"}),
        ({"weights": "1,3"}, {"weights": "0.25,0.75"}),
        ({"means": "10:10.0, 20:2e1"}, {}),
    ],
    ids=str,
)
def test_what_means_the_same_is_stored_the_same(one: dict[str, str], other: dict[str, str]) -> None:
    assert MixtureGridworld(**one) == MixtureGridworld(**other)  # type: ignore[arg-type]


def test_what_is_stored_gives_the_family_back() -> None:
    for family in (TWO, MixtureGridworld(size=10, weights="1,2"), MixtureGridworld(size=7)):
        assert StoredFamily.read({"name": family.name, **asdict(family)}).here == family


@pytest.mark.parametrize(
    ("weights", "named"),
    [
        ("1,2", "0.333-0.667"),
        ("1,3", "0.25-0.75"),
        ("1,127", "0.0078125-0.9921875"),  # as ever
    ],
)
def test_a_weight_of_twelve_digits_stands_in_names_by_three_and_in_full_in_what_is_stored(
    weights: str, named: str
) -> None:
    family = MixtureGridworld(weights=weights)
    assert family.label == f"mixture-gridworld-at-10-10-and-20-20-variance-7-weights-{named}"
    first, second = map(float, weights.split(","))
    stored = [float(share) for share in family.weights.split(",")]
    np.testing.assert_allclose(stored, [first / (first + second), second / (first + second)], rtol=1e-11)


@pytest.mark.parametrize(
    ("settings", "sentence"),
    [
        ({"means": "10"}, "--means has '10'; write ROW:COLUMN"),
        ({"means": "10:x"}, "--means has 'x', which is no number"),
        ({"means": "-1:5"}, "--means has -1; a number there is finite and at least 0"),
        ({"variances": "1,2,3"}, "--variances has 3 numbers for 2 means"),
        ({"variances": "nan"}, "--variances has nan; a number there is finite"),
        ({"weights": "0,0"}, "--weights 0,0: at least one must be above 0"),
        ({"means": "10:10,40:10", "variances": "1"}, "mean 40:10 and variance 1 fall on the 30 x 30 grid"),
        ({"p_low": 0.8, "p_high": 0.7}, "is above --p-high"),
    ],
    ids=str,
)
def test_mixtures_that_cannot_be_meant_are_refused(settings: dict[str, Any], sentence: str) -> None:
    with pytest.raises(ValueError, match=sentence):
        MixtureGridworld(**settings)


def test_a_mixture_shifts_but_for_its_size() -> None:
    assert TWO.shifted({"weights": "3,1"}) == MixtureGridworld(
        size=12, means="2:9,8:1.5", variances="1,4", weights="0.75,0.25"
    )
    with pytest.raises(ValueError, match="size cannot be shifted"):
        TWO.shifted({"size": 13})


def test_pictures_show_the_start_each_mean_and_the_far_corner() -> None:
    assert MixtureGridworld().shown_states() == ((0, 0), (10, 10), (20, 20), (29, 29))
    assert MixtureGridworld(means="0:0,20:5").shown_states() == ((0, 0), (20, 5), (29, 29))


def test_the_label_tells_means_variances_and_weights() -> None:
    assert MixtureGridworld().label == "mixture-gridworld-at-10-10-and-20-20-variance-7"
    assert TWO.label == "mixture-gridworld-12-at-2-9-and-8-1.5-variance-1-4-weights-0.25-0.75"
