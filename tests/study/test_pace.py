"""The time that is left, by hand."""

from __future__ import annotations

from qinit_cli.pipeline.pace import Pace, UnderWay

GRID, CAR, FIT = ("runs", "gridworld", "zero"), ("runs", "mountain-car", "zero"), ("fits", "gridworld")


def test_before_anything_is_done_what_was_foreseen_is_left() -> None:
    assert Pace({GRID: 10.0, FIT: 2.0}).left() == 12.0


def test_what_took_twice_as_long_counts_twice_for_its_kind_and_for_wider_ones() -> None:
    pace = Pace({GRID: 10.0, CAR: 6.0, FIT: 2.0})
    pace.took(GRID, 4.0, 8.0)
    assert pace.factor(GRID) == pace.factor(CAR) == 2.0  # of cars nothing is done: they go by runs
    assert pace.factor(FIT) == 1.0
    assert pace.left() == (10.0 - 4.0) * 2 + 6.0 * 2 + 2.0


def test_the_share_of_what_is_under_way_is_no_longer_left() -> None:
    pace = Pace({GRID: 10.0})
    pace.took(GRID, 5.0, 2.5)
    assert pace.left([UnderWay("grid", GRID, 4.0, 0.5)]) == (10.0 - 5.0) * 0.5 - 0.5 * 4.0 * 0.5


def test_nothing_is_left_of_what_is_done_and_never_less() -> None:
    pace = Pace({GRID: 1.0})
    pace.took(GRID, 1.0, 3.0)
    assert pace.left() == 0.0
    assert pace.left([UnderWay("grid", GRID, 1.0, 1.0)]) == 0.0
