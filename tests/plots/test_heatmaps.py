"""Heatmaps: what is drawn is what the artefacts hold, in its place, with its names."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest

from qinit_cli.errors import UsageError
from qinit_cli.plots.heatmaps import Layer, heatmaps
from qinit_cli.plots.state_axes import Side
from qinit_cli.plots.style import house_style

Draw = Callable[..., Any]
ALL = ("mean", "maxqinit", "ucoi", "logqinit-median", "logqinit-mean", "logqinit-quantile")


def _stored(path: Path, name: str) -> np.ndarray[Any, Any]:
    with h5py.File(path) as file:
        return np.asarray(file[name][...])


def _images(figure: Any) -> dict[str, Any]:
    """Every drawn table by its panel's title."""
    return {axes.get_title().replace("\n", " "): axes.images[0] for axes in figure.axes if axes.images}


def test_every_initialisation_of_a_fit_is_drawn_by_default(drawn: Draw, pipeline: Any) -> None:
    images = _images(drawn("heatmaps", pipeline.fit))
    assert [name.partition(" ")[0] for name in images] == ["goals", *ALL]
    assert "ucoi (reconstruction)" in images


@pytest.mark.parametrize("method", ALL)
def test_what_is_drawn_from_a_fit_is_what_a_run_started_from(drawn: Draw, pipeline: Any, method: str) -> None:
    figure = drawn("heatmaps", pipeline.fit, "--method", method, "--bare")
    [image] = _images(figure).values()
    np.testing.assert_array_equal(image.get_array(), _stored(pipeline.runs[method], "start").max(axis=-1))


def test_a_run_and_its_fit_stand_in_one_column_once(drawn: Draw, pipeline: Any) -> None:
    figure = drawn("heatmaps", pipeline.fit, pipeline.runs["mean"], pipeline.runs["zero"], "--method", "mean")
    images = _images(figure)
    assert list(images) == ["goals", "mean", "zero"]
    assert not images["zero"].get_array().any()


def test_the_chances_of_the_goal_add_up_and_are_largest_at_their_mean(drawn: Draw, pipeline: Any) -> None:
    probabilities = _images(drawn("heatmaps", pipeline.fit))["goals"].get_array()
    assert np.unravel_index(probabilities.argmax(), probabilities.shape) == (4, 4)  # 2/3 of 6
    # the start is drawn below the least, as 0 has no logarithm
    assert probabilities.sum() - probabilities[0, 0] == pytest.approx(1)


def test_a_table_of_the_fit_is_drawn_at_the_action_of_the_largest_mean(drawn: Draw, pipeline: Any) -> None:
    figure = drawn("heatmaps", pipeline.fit, "--quantity", "eopl-mean")
    [axes] = [axes for axes in figure.axes if axes.images]
    mean, lengths = _stored(pipeline.fit, "mean"), _stored(pipeline.fit, "eopl_mean")
    for row, column in ((0, 0), (2, 5), (5, 1)):
        greedy = int(np.nanargmax(mean[row, column]))
        assert axes.images[0].get_array()[row, column] == lengths[row, column, greedy]
    [bar] = [other for other in figure.axes if other is not axes]
    label = bar.get_xlabel().replace("\n", " ")
    assert label == "mean of the expected optimal path lengths (steps), action of the largest mean"


def test_rows_are_counted_in_cells_downwards_and_the_colours_have_their_unit(
    drawn: Draw, pipeline: Any
) -> None:
    figure = drawn("heatmaps", pipeline.fit, "--method", "mean", "--bare")
    [axes] = [axes for axes in figure.axes if axes.images]
    assert axes.get_ylabel() == "row (cell)"
    assert axes.get_xlabel() == "column (cell)"
    assert axes.get_ylim() == (5.5, -0.5)
    assert axes.get_xlim() == (-0.5, 5.5)
    [bar] = [other for other in figure.axes if other is not axes]
    assert "(discounted return)" in bar.get_xlabel()


@pytest.mark.parametrize(
    ("places", "ticks"),
    [
        (np.arange(10.0), [0, 2, 4, 6, 8]),
        (np.arange(30.0), [0, 10, 20]),
        (np.arange(2.0), [0, 1]),
        (np.arange(10) / 10 + 0.05, [0, 0.25, 0.5, 0.75, 1]),
    ],
    ids=["ten", "thirty", "two", "bins"],
)
def test_cells_are_numbered_by_whole_numbers_and_bins_need_not_be(places: Any, ticks: list[float]) -> None:
    side = Side("place", places)
    table = np.arange(len(places) ** 2.0).reshape(len(places), -1)
    with house_style():
        figure = heatmaps([Layer("value", {("a", "b"): table})], side, side, "", 3.5)
    axes = figure.axes[0]
    for axis, (low, high) in ((axes.xaxis, axes.get_xlim()), (axes.yaxis, axes.get_ylim())):
        shown = [tick for tick in axis.get_ticklocs() if low - 1e-9 <= tick <= high + 1e-9]
        np.testing.assert_allclose(shown, ticks, atol=1e-12)


def test_panels_of_one_layer_share_their_colours(drawn: Draw, pipeline: Any) -> None:
    images = list(_images(drawn("heatmaps", pipeline.fit, "--bare")).values())
    assert len({image.norm for image in images}) == 1
    tables = [image.get_array() for image in images]
    assert images[0].norm.vmax == max(table.max() for table in tables)
    assert images[0].norm.vmin == min(table.min() for table in tables)


def test_distributions_stand_in_columns_and_methods_in_rows(
    drawn: Draw, pipeline: Any, uniform: Path
) -> None:
    figure = drawn("heatmaps", pipeline.fit, uniform, "--method", "mean", "--method", "maxqinit", "--bare")
    panels = [axes for axes in figure.axes if axes.images]
    assert [axes.get_title() for axes in panels] == ["6 variance 2\nq-learning", "6 uniform\nexact", "", ""]
    assert [axes.get_ylabel().split("\n")[0] for axes in panels] == ["mean", "", "maxqinit", ""]
    for axes, path in zip(panels[:2], (pipeline.fit, uniform), strict=True):
        expected = np.nan_to_num(_stored(path, "mean")).max(axis=-1)
        np.testing.assert_array_equal(axes.images[0].get_array(), expected)


def test_a_logarithmic_scale_points_at_what_lies_below_it() -> None:
    table = np.array([[0.0, 1e-9], [0.01, 1.0]])
    side = Side("place", np.arange(2.0))
    with house_style():
        figure = heatmaps([Layer("value", {("a", "b"): table}, logarithmic=True)], side, side, "", 3.5)
        figure.canvas.draw()
    [panel, bar] = figure.axes
    assert (panel.images[0].norm.vmin, panel.images[0].norm.vmax) == (1e-3, 1.0)
    assert not np.ma.is_masked(panel.images[0].get_array())  # 0 is little, not unknown
    assert panel.images[0].colorbar.extend == "min"
    ticks = zip(bar.get_xticks(), bar.get_xticklabels(), strict=True)
    assert [tick.get_text() for at, tick in ticks if 1e-3 * 0.999 <= at <= 1] == ["0.001", "0.01", "0.1", "1"]


def test_what_no_source_knows_is_grey_and_said_to_be() -> None:
    side = Side("place", np.arange(2.0))
    with house_style():
        figure = heatmaps(
            [Layer("value", {("a", "b"): np.array([[np.nan, 1.0], [2.0, 3.0]])})], side, side, ""
        )
    [panel, bar] = figure.axes
    assert np.ma.getmaskarray(panel.images[0].get_array()).tolist() == [[True, False], [False, False]]
    assert bar.get_xlabel() == "value; grey: no source knows"


def test_continuous_axes_rise_and_reach_the_edges_of_their_bins() -> None:
    upright, across = (
        Side("position", np.linspace(-1.17, 0.57, 30)),
        Side("velocity", np.linspace(-0.06, 0.06, 4)),
    )
    with house_style():
        figure = heatmaps([Layer("value", {("a", "b"): np.ones((30, 4))})], upright, across, "")
    axes = figure.axes[0]
    assert axes.get_ylim() == pytest.approx((-1.2, 0.6))
    assert axes.get_xlim() == pytest.approx((-0.08, 0.08))


def test_a_single_axis_is_a_strip_and_a_large_grid_is_drawn() -> None:
    for shape in ((1, 40), (300, 300)):
        upright, across = (Side("", np.arange(float(length))) for length in shape)
        with house_style():
            figure = heatmaps([Layer("value", {("a", "b"): np.ones(shape)})], upright, across, "")
            figure.canvas.draw()
        assert figure.axes[0].images[0].get_array().shape == shape


def test_panels_too_small_to_read_are_refused() -> None:
    side = Side("place", np.arange(2.0))
    panels = {(str(row), str(column)): np.ones((2, 2)) for row in range(2) for column in range(3)}
    with house_style():
        heatmaps([Layer("value", panels)], side, side, "", 7.0)
        with pytest.raises(UsageError, match="--width text"):
            heatmaps([Layer("value", panels)], side, side, "", 3.5)


def test_what_cannot_be_drawn_is_refused_in_one_sentence(
    refused: Callable[..., tuple[int, str]], pipeline: Any
) -> None:
    for code, words, *arguments in (
        (4, "holds sources; wanted a fit or a run", pipeline.sources),
        (4, "wanted a fit, which alone has sigma", pipeline.runs["mean"], "--quantity", "sigma"),
        (2, "there is no method maxqinti; did you mean maxqinit?", pipeline.fit, "--method", "maxqinti"),
        (2, "optimal starts from the target itself", pipeline.fit, "--method", "optimal"),
        (2, "none is given", pipeline.runs["mean"], "--method", "mean"),
        (2, "leave it out", pipeline.fit, "--method", "mean", "--quantity", "mu"),
        (2, "values below 0", pipeline.fit, "--quantity", "mu", "--scale", "log"),
        (2, "nosuch", "nosuch"),
    ):
        ended, sentence = refused("heatmaps", *arguments)
        assert words in sentence
        assert ended == code, sentence


def test_an_estimator_without_a_median_leaves_the_median_out_and_says_so(
    here: Draw, pipeline: Any, tmp_path: Path
) -> None:
    fit = here("fit", pipeline.sources, "--estimator", "shen", "--store", tmp_path, "-q").path
    ended = here("plot", "heatmaps", fit, "-o", tmp_path / "picture.png")
    assert ended.code == 0
    assert "logqinit-median is left out" in ended.err
    ended = here("plot", "heatmaps", fit, "--method", "logqinit-median", "-o", tmp_path / "picture.png")
    assert ended.code == 4


def test_what_stands_in_where_no_source_has_a_value_is_no_knowledge() -> None:
    from qinit_cli.plots.panels import _largest

    start = np.array([[0.3, 0.2], [0.9, 0.4], [0.5, 0.5], [1.0, 1.0]])
    n = np.array([[3, 1], [0, 2], [0, 1], [0, 0]], np.int32)
    np.testing.assert_array_equal(_largest(start, n, reads_sources=True), [0.3, np.nan, 0.5, np.nan])
    np.testing.assert_array_equal(_largest(start, n, reads_sources=False), [0.3, 0.9, 0.5, 1.0])


HOLES_AND_GOAL = [(1, 1), (1, 3), (2, 3), (3, 0), (3, 3)]  # of Gymnasium's map of 4 x 4


def test_holes_of_a_frozen_lake_are_grey_and_said_to_be_unknown(drawn: Draw, lake: tuple[Path, Path]) -> None:
    fit, run = lake
    figures = [
        drawn("heatmaps", fit, "--method", "maxqinit", "--method", "zero"),
        drawn("heatmaps", run),
        drawn("heatmaps", fit, run, "--method", "mean"),
    ]
    for figure in figures:
        tables = [axes.images[0].get_array() for axes in figure.axes if axes.images]
        assert [tuple(place) for place in np.argwhere(np.ma.getmaskarray(tables[0]))] == HOLES_AND_GOAL
        labels = {axes.get_xlabel() for axes in figure.axes} | {axes.get_ylabel() for axes in figure.axes}
        assert any("grey: no source knows" in label.replace("\n", " ") for label in labels)
    assert len([axes for axes in figures[2].axes if axes.images]) == 1  # the same start, once
    zero = [axes.images[0].get_array() for axes in figures[0].axes if axes.images][1]
    assert not np.ma.getmaskarray(zero).any()


def test_a_run_whose_fit_is_not_there_says_that_nothing_is_grey(
    here: Draw, lake: tuple[Path, Path], tmp_path: Path
) -> None:
    alone = tmp_path / "alone.h5"
    alone.write_bytes(lake[1].read_bytes())
    ended = here("plot", "heatmaps", alone, "-o", "x.svg")
    assert ended.code == 0
    assert "what no source knows is not grey, for its fit is neither given nor beside it" in ended.err


def test_one_chance_everywhere_is_not_drawn_black() -> None:
    from matplotlib.colors import LogNorm

    from qinit_cli.plots.heatmaps import _colours

    probabilities = np.full((3, 3), 1 / 8)
    probabilities[0, 0] = 0
    norm = _colours(Layer("probability", {("goals", "uniform"): probabilities}, logarithmic=True))
    assert isinstance(norm, LogNorm)
    assert norm(1 / 8) == pytest.approx(0.5)
