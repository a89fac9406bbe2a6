"""Schedules against values known by hand, and the texts they are written as."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import pytest

from qinit_cli.learners.exploration import Boltzmann, Ucb
from qinit_cli.learning import Learning
from qinit_cli.schedules import KINDS, ByVisits, Exponential, Linear, Schedule, schedule

USUAL = Learning(alpha=0.1, gamma=0.95, epsilon=0.1, episodes=10, horizon=20, start="fixed")


def test_linear_falls_in_equal_steps_and_stays() -> None:
    assert Linear(1.0, 0.5, 4).values(7) == [1.0, 0.875, 0.75, 0.625, 0.5, 0.5, 0.5]
    assert Linear(0.25, 0.75, 2).values(2) == [0.25, 0.5]


def test_exponential_halves_until_the_least_is_reached() -> None:
    assert Exponential(1.0, 0.5, 0.1).values(6) == [1.0, 0.5, 0.25, 0.125, 0.1, 0.1]
    assert Exponential(0.5, 1.0, 0.0).values(3) == [0.5, 0.5, 0.5]


def test_by_visits_is_one_over_a_power_of_the_count() -> None:
    assert ByVisits(1.0).of_visits(4) == [1, 1 / 2, 1 / 3, 1 / 4]
    assert ByVisits(0.5).of_visits(9)[-1] == pytest.approx(1 / 3)
    assert ByVisits(0.5).of_visits(0) == []


@pytest.mark.parametrize(
    ("given", "extremes"),
    [
        (Linear(1.0, 0.5, 4), (0.5, 1.0)),
        (Linear(0.5, 1.0, 4), (0.5, 1.0)),
        (Exponential(1.0, 0.5, 0.1), (0.1, 1.0)),
        (ByVisits(0.7), (math.ulp(0.0), 1.0)),
    ],
    ids=str,
)
def test_extremes_are_the_least_and_the_largest_number(
    given: Schedule, extremes: tuple[float, float]
) -> None:
    assert given.extremes == extremes


@pytest.mark.parametrize(
    ("text", "written"),
    [
        ("linear:0.5:0.1:100", Linear(0.5, 0.1, 100)),
        ("exponential:1.0:0.99:0.05", Exponential(1.0, 0.99, 0.05)),
        ("visits:0.7", ByVisits(0.7)),
    ],
)
def test_a_schedule_is_read_from_the_text_it_writes(text: str, written: Schedule) -> None:
    assert schedule(text) == written
    assert str(written) == text


def test_numbers_are_read_as_numbers_and_every_kind_has_a_name() -> None:
    assert schedule("0.25") == 0.25
    assert schedule("linear:1:0:5") == Linear(1.0, 0.0, 5)
    assert {name: kind.form.split(":")[0] for name, kind in KINDS.items()} == {name: name for name in KINDS}


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("much", "'much' is no number, and no schedule: linear:FROM:TO:EPISODES, "),
        ("", "'' is no number, and no schedule"),
        (
            "cosine:1:0",
            "'cosine:1:0' is no schedule; there are linear:FROM:TO:EPISODES, exponential:.*, visits:POWER",
        ),
        ("linear:1:0", "'linear:1:0' is no linear:FROM:TO:EPISODES"),
        ("linear:1:0:5:6", "is no linear:FROM:TO:EPISODES"),
        ("linear:1:0:2.5", "'2.5' in 'linear:1:0:2.5' is no whole number"),
        ("linear:1:none:5", "'none' in 'linear:1:none:5' is no number"),
        ("linear:1:0:0", "linear:FROM:TO:EPISODES takes 1 episode or more, not 0"),
        (f"linear:1:0:{10**400}", "and episodes is 1000"),
        ("linear:nan:0:5", "linear takes linear:FROM:TO:EPISODES, and first is nan"),
        ("exponential:1:0:0.1", "takes a decay above 0 and at most 1, not 0.0"),
        ("exponential:1:1.1:0.1", "takes a decay above 0 and at most 1, not 1.1"),
        ("exponential:0.1:0.9:0.5", "falls from 0.1 to 0.5, which is larger"),
        ("visits:0", "takes a power above 0 and at most 1, not 0.0"),
        ("visits:1.5", "takes a power above 0 and at most 1, not 1.5"),
    ],
)
def test_a_text_that_is_no_schedule_is_refused_in_one_sentence(text: str, message: str) -> None:
    with pytest.raises(ValueError, match=message) as refused:
        schedule(text)
    assert "\n" not in str(refused.value)


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ({"alpha": Linear(0.5, 0.0, 5)}, "alpha is linear:0.5:0.0:5; it must be above 0 and at most 1"),
        ({"alpha": Exponential(1.5, 0.9, 0.1)}, "alpha is exponential:1.5:0.9:0.1; it must be above 0"),
        ({"epsilon": Linear(1.2, 0.0, 5)}, "epsilon is linear:1.2:0.0:5; it must be from 0 to 1"),
        ({"epsilon": ByVisits(0.7)}, "epsilon is visits:0.7; visits:POWER is a schedule of alpha alone"),
        ({"gamma": Linear(0.9, 0.8, 5)}, "gamma is "),
    ],
)
def test_learning_refuses_schedules_that_leave_the_range_of_their_number(
    wrong: dict[str, Any], message: str
) -> None:
    with pytest.raises(ValueError, match=message):
        replace(USUAL, **wrong)


def test_the_last_epsilon_is_that_of_the_last_episode_where_there_is_one() -> None:
    assert USUAL.last_epsilon == 0.1
    assert replace(USUAL, epsilon=Linear(1.0, 0.0, 18)).last_epsilon == 0.5  # half of the way, in episode 9
    for explore in (Boltzmann(), Ucb()):
        assert replace(USUAL, explore=explore).last_epsilon == 0.0
