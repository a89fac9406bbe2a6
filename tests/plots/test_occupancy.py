"""Visited states: the maps hold the counts, the outlines surround them, and failed paths are told apart."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest

from qinit_cli.plots.occupancy import PATHS_A_VISIT, OccupancyPlot, Visits, edges, occupancy
from qinit_cli.plots.state_axes import Side
from qinit_cli.plots.style import house_style

Draw = Callable[..., Any]


@pytest.fixture
def sources(here: Draw) -> Callable[..., Path]:
    """Sources of a small grid: `sources("--variance", 2)`."""

    def make(*options: object) -> Path:
        grid = ("gridworld", "--size", 6, "--tasks", 20, "--learner", "exact", "-q")
        path: Path = here("train-sources", *grid, *options).path
        return path

    return make


def _maps(figure: Any) -> list[np.ndarray[Any, Any]]:
    return [axes.images[0].get_array().filled(0) for axes in figure.axes if axes.images]


def test_maps_count_the_cells_from_the_start_to_each_goal(drawn: Draw, sources: Draw) -> None:
    paths = [sources("--variance", 2), sources("--goals", "uniform")]
    figure = drawn("occupancy", *paths)
    assert [axes.get_title() for axes in figure.axes[:2]] == ["6 variance 2\n20 paths", "6 uniform\n20 paths"]
    for counts, path in zip(_maps(figure), paths, strict=True):
        with h5py.File(path) as file:
            rows, columns = file["goal_row"][...], file["goal_col"][...]
        assert counts[0, 0] == 20
        assert counts.sum() == (rows + columns + 1).sum()
        ends = np.zeros((6, 6), int)
        np.add.at(ends, (rows, columns), 1)
        assert (counts >= ends).all()


def test_paths_that_fail_are_counted_apart_and_not_in_the_map(
    drawn: Draw, here: Draw, tmp_path: Path
) -> None:
    family = ("gridworld", "--size", 6, "--tasks", 6, "--episodes", 3, "--seed", 3, "-q")
    path = here("train-sources", *family, "-o", "poor.h5").path
    with h5py.File(path) as file:
        solved = file["solved"][...].astype(bool)
        lengths = (file["goal_row"][...] + file["goal_col"][...])[solved]
    assert (~solved).sum() > 0
    figure = drawn("occupancy", path)
    assert figure.axes[0].get_title() == f"6 variance 7\n{solved.sum()} paths, {(~solved).sum()} fail"
    [counts] = _maps(figure)
    assert counts.sum() >= (lengths + 1).sum()
    assert counts[0, 0] == solved.sum()


def test_seeds_of_one_distribution_are_one_map_and_no_task_counts_twice(drawn: Draw, sources: Draw) -> None:
    one, other = sources(), sources("--seed", 1)
    figure = drawn("occupancy", one, other, one)
    [counts] = _maps(figure)
    assert counts[0, 0] == 40


def test_the_axes_are_velocity_across_and_position_upright_as_in_the_paper(drawn: Draw, here: Draw) -> None:
    family = ("mountain-car", "--tasks", 2, "--episodes", 2000, "--bins", 8, "--noise", 0, "-q")
    figure = drawn("occupancy", here("train-sources", *family, "-o", "car.h5").path)
    axes = figure.axes[0]
    assert (axes.get_xlabel(), axes.get_ylabel()) == ("velocity", "position")
    assert axes.get_ylim()[0] < axes.get_ylim()[1]


def test_outlines_are_the_edges_of_what_is_visited_often() -> None:
    inside = np.array([[True, True], [False, True]])
    side = Side("", np.arange(2.0))
    found = {tuple(sorted(map(tuple, line))) for line in edges(inside, side, side).tolist()}
    low, middle, high = -0.5, 0.5, 1.5
    assert found == {
        ((low, low), (middle, low)), ((middle, low), (high, low)), ((low, low), (low, middle)),
        ((low, middle), (middle, middle)), ((middle, middle), (middle, high)), ((middle, high), (high, high)),
        ((high, low), (high, middle)), ((high, middle), (high, high)),
    }  # fmt: skip


def test_a_state_that_few_paths_visit_is_in_the_map_and_outside_the_outline() -> None:
    counts = np.array([[3 * PATHS_A_VISIT, 1], [3, 0]])
    side = Side("place", np.arange(2.0))
    shown = [Visits(name, "", counts, 3 * PATHS_A_VISIT) for name in ("a", "b")]
    with house_style():
        figure = occupancy(shown, side, side, "")
    [outlines] = [axes for axes in figure.axes if axes.collections and not axes.images and axes.get_title()]
    assert len(outlines.collections[0].get_segments()) == 6  # around two cells
    assert [line.get_label() for line in outlines.collections] == ["a", "b"]
    np.testing.assert_array_equal(_maps(figure)[0], counts)


def test_the_words_tell_the_main_numbers(sources: Draw) -> None:
    path = sources("--variance", 0, "--p-low", 0.8, "--p-high", 0.8)  # every goal is (4, 4)
    said = OccupancyPlot().drawn([path]).alt
    assert "6 variance 0 p 0.8 0.8: 20 paths, 9 states visited, 180 visits, at most 20 to one state" in said


def test_what_cannot_be_drawn_is_refused_in_one_sentence(
    refused: Draw, pipeline: Any, here: Draw, sources: Draw
) -> None:
    bigger = here("train-sources", "gridworld", "--size", 7, "--tasks", 2, "--learner", "exact", "-q").path
    many = [sources("--variance", variance) for variance in range(1, 11)]
    for code, words, *given in (
        (4, "sources is needed", pipeline.fit),
        (4, "share their state axes", pipeline.sources, bigger),
        (2, "10 distributions do not fit", *many),
    ):
        ended, sentence = refused("occupancy", *given)
        assert words in sentence
        assert ended == code, sentence


@pytest.mark.parametrize(("width", "inches"), [("column", 3.5), ("text", 7.0)])
def test_no_letter_is_too_small_at_either_width(
    drawn: Draw, sources: Draw, pipeline: Any, width: str, inches: float
) -> None:
    from matplotlib.text import Text

    figure = drawn("occupancy", pipeline.sources, sources(), "--width", width, "--title", "mine")
    assert figure.get_size_inches()[0] == inches
    assert figure.get_suptitle() == "mine"
    letters = [text for text in figure.findobj(Text) if text.get_visible() and text.get_text()]
    assert min(text.get_fontsize() for text in letters) >= 6.5
