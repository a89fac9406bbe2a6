"""What is drawn is what was given: read back from the axes, not from the picture."""

from __future__ import annotations

import itertools
from typing import Any

import matplotlib
import numpy as np
import pytest

from qinit_cli.analysis.intervals import Interval
from qinit_cli.errors import UsageError
from qinit_cli.plots.bars import Bars, bars
from qinit_cli.plots.curves import Curve, Panel, curves
from qinit_cli.plots.drawn import Drawn, PictureFile
from qinit_cli.plots.heatmaps import Layer, heatmaps
from qinit_cli.plots.state_axes import Side
from qinit_cli.plots.style import FORMATS, checked_path, house_style, line_styles

EPISODES = np.array([1, 10, 20, 30])


def _interval(*estimates: float) -> Interval:
    middle = np.array(estimates)
    return Interval(middle, middle - 0.05, middle + 0.1)


LINES = [
    Curve("zero", EPISODES, _interval(0.0, 0.1, 0.2, 0.3)),
    Curve("logqinit-median", EPISODES, _interval(0.2, 0.3, 0.35, 0.4)),
]


def _curves() -> Any:
    return curves([Panel("", "95 %, 4 targets", LINES)], "discounted return", "variance 7")


def test_each_curve_is_drawn_as_given_with_its_band() -> None:
    with house_style():
        [axes] = _curves().axes
    for drawn, given in zip(axes.lines, LINES, strict=True):
        np.testing.assert_array_equal(drawn.get_xdata(), EPISODES)
        np.testing.assert_array_equal(drawn.get_ydata(), given.band.estimate)
        assert drawn.get_label() == given.label
    for drawn, given in zip(axes.collections, LINES, strict=True):
        corners = {tuple(corner) for corner in np.round(drawn.get_paths()[0].vertices, 9).tolist()}
        low = set(zip(EPISODES.tolist(), np.round(given.band.low, 9).tolist(), strict=True))
        high = set(zip(EPISODES.tolist(), np.round(given.band.high, 9).tolist(), strict=True))
        assert low | high <= corners


def test_curves_say_what_their_axes_their_band_and_their_lines_are() -> None:
    with house_style():
        figure = _curves()
        [axes] = figure.axes
    assert "episode" in axes.get_xlabel()
    assert "95 %, 4 targets" in axes.get_xlabel()
    assert (axes.get_ylabel(), axes.get_title()) == ("discounted return", "variance 7")
    [legend] = figure.legends
    assert [text.get_text() for text in legend.get_texts()] == ["zero", "logqinit-median"]
    assert axes.get_xlim() == (1, 30)
    assert axes.get_ylim()[0] <= 0


def test_each_bar_is_as_high_as_given_with_its_interval() -> None:
    series = [Bars("zero", _interval(0.1, 0.2)), Bars("mean", _interval(0.3, -0.1))]
    with house_style():
        [axes] = bars({"": series}, ["variance 1", "variance 7"], "targets", "return", "").axes
    heights = [patch.get_height() for patch in axes.patches]
    assert heights == pytest.approx([0.1, 0.2, 0.3, -0.1])
    assert [label.get_text() for label in axes.get_xticklabels()] == ["variance 1", "variance 7"]
    reaches = [
        collection.get_segments() for collection in axes.collections if hasattr(collection, "get_segments")
    ]
    ends = [(segment[0][1], segment[1][1]) for segments in reaches for segment in segments]
    assert np.allclose(ends, [(0.05, 0.2), (0.15, 0.3), (0.25, 0.4), (-0.15, 0.0)])


def test_bars_of_a_group_do_not_overlap() -> None:
    series = [Bars(str(each), _interval(0.1, 0.2, 0.3)) for each in range(4)]
    with house_style():
        [axes] = bars({"": series}, ["a", "b", "c"], "", "", "").axes
    spans = sorted((patch.get_x(), patch.get_x() + patch.get_width()) for patch in axes.patches)
    assert all(end <= start + 1e-9 for (_, end), (start, _) in itertools.pairwise(spans))


def _panels(figure: Any) -> list[Any]:
    return [axes.images[0] for axes in figure.axes if axes.images]


def test_each_heatmap_holds_its_table_unknowns_masked_on_one_colour_scale() -> None:
    first = np.array([[0.1, 0.2], [np.nan, 0.4]])
    second = np.array([[0.5, 0.05], [0.3, 0.1]])
    layer = Layer("Q", {("mean", "variance 1"): first, ("maxqinit", "variance 1"): second})
    sides = Side("row", np.arange(2.0), downwards=True), Side("col", np.arange(2.0))
    with house_style():
        images = _panels(heatmaps([layer], *sides, ""))
    for image, table in zip(images, (first, second), strict=True):
        drawn = image.get_array()
        np.testing.assert_array_equal(np.ma.getmaskarray(drawn), np.isnan(table))
        np.testing.assert_allclose(drawn.filled(np.nan), table)
        assert (image.norm.vmin, image.norm.vmax) == (0.05, 0.5)


def test_a_heatmap_of_rows_reads_downwards_as_the_grid_does() -> None:
    sides = Side("row", np.arange(3.0), downwards=True), Side("col", np.arange(3.0))
    with house_style():
        [image] = _panels(heatmaps([Layer("Q", {("", ""): np.eye(3)})], *sides, ""))
    left, right, bottom, top = image.get_extent()
    assert (left, right) == (-0.5, 2.5)
    assert top < bottom


def test_on_a_logarithmic_scale_zero_is_low_and_not_unknown() -> None:
    table = np.array([[0.0, 0.1], [1.0, np.nan]])
    sides = Side("row", np.arange(2.0)), Side("col", np.arange(2.0))
    with house_style():
        [image] = _panels(heatmaps([Layer("Q", {("", ""): table}, logarithmic=True)], *sides, ""))
    mask = np.ma.getmaskarray(image.get_array())
    np.testing.assert_array_equal(mask, np.isnan(table))
    assert image.norm.vmin == 0.1


def test_no_two_of_28_lines_look_alike() -> None:
    assert len({(look["color"], look["linestyle"]) for look in line_styles(28)}) == 28


def test_neighbouring_lines_differ_in_dashes_so_that_grey_tells_them_apart() -> None:
    dashes = [look["linestyle"] for look in line_styles(8)]
    assert all(one != other for one, other in itertools.pairwise(dashes))


@pytest.mark.parametrize("kind", FORMATS)
def test_the_same_figure_gives_the_same_bytes(kind: str, tmp_path: Any) -> None:
    for name in ("one", "two"):
        with house_style():
            Drawn(_curves(), "Curves", "Two curves.").save(PictureFile(tmp_path / f"{name}.{kind}"))
    one, two = ((tmp_path / f"{name}.{kind}").read_bytes() for name in ("one", "two"))
    assert one == two
    assert one.startswith({"png": b"\x89PNG", "svg": b"<?xml", "pdf": b"%PDF"}[kind])
    assert {path.name for path in tmp_path.iterdir()} == {f"one.{kind}", f"two.{kind}"}


def test_a_users_own_settings_do_not_change_a_picture_and_are_given_back(tmp_path: Any) -> None:
    with house_style():
        Drawn(_curves(), "Curves", "Two curves.").save(PictureFile(tmp_path / "one.svg"))
    with matplotlib.rc_context({"lines.linewidth": 9, "font.size": 30}):
        with house_style():
            Drawn(_curves(), "Curves", "Two curves.").save(PictureFile(tmp_path / "two.svg"))
        assert matplotlib.rcParams["font.size"] == 30
    assert (tmp_path / "one.svg").read_bytes() == (tmp_path / "two.svg").read_bytes()


@pytest.mark.parametrize("name", ["a.gif", "a", "a.h5", "a.png.txt"])
def test_an_ending_that_is_no_pictures_is_refused(name: str, tmp_path: Any) -> None:
    with pytest.raises(UsageError, match=r"a picture ends in \.png, \.svg or \.pdf"):
        checked_path(str(tmp_path / name))


@pytest.mark.parametrize("kind", FORMATS)
def test_plot_curves_writes_the_picture_and_prints_its_path_alone(
    kind: str, here: Any, pipeline: Any
) -> None:
    runs = [pipeline.runs[name] for name in ("zero", "logqinit-median")]
    pictures = []
    for name in (f"one.{kind}", f"two.{kind}"):
        ended = here("plot", "curves", *runs, "-o", name)
        assert (ended.code, ended.out, ended.err) == (0, f"{name}\n", "")
        pictures.append(ended.path.read_bytes())
    assert pictures[0] == pictures[1]


@pytest.mark.parametrize(
    ("picture", "kinds"), [("bars", "runs"), ("heatmaps", "fit"), ("histograms", "sources")]
)
def test_every_picture_is_the_same_bytes_each_time(
    picture: str, kinds: str, here: Any, pipeline: Any
) -> None:
    artefacts = list(pipeline.runs.values()) if kinds == "runs" else [getattr(pipeline, kinds)]
    pictures = []
    for name in ("one.svg", "two.svg"):
        ended = here("plot", picture, *artefacts, "-o", name)
        assert (ended.code, ended.out) == (0, f"{name}\n"), ended.err
        pictures.append(ended.path.read_bytes())
    assert pictures[0] == pictures[1]
