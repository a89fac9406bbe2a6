"""Maps of W and p: what they hold is what the fit holds."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest

from qinit_cli.plots.normality import CLASSES, Map, Words, normality
from qinit_cli.plots.state_axes import Side
from qinit_cli.plots.style import house_style

Draw = Callable[..., Any]
SIDE = Side("row", np.arange(4.0), downwards=True)


@pytest.fixture
def tested(here: Draw) -> Path:
    """A fit of enough sources to be tested, in values and in lengths; some state-actions are the goal of most."""
    family = ("gridworld", "--size", 6, "--variance", 0.3, "--tasks", 30, "--learner", "exact", "-q")
    sources = here("train-sources", *family, "-o", "sources.h5").path
    fit: Path = here("fit", sources, "--eopl-normality", "dither", "-o", "fit.h5", "-q").path
    return fit


def _images(figure: Any) -> list[np.ndarray[Any, Any]]:
    return [axes.images[0].get_array().filled(np.nan) for axes in figure.axes if axes.images]


@pytest.mark.parametrize(("of", "prefix"), [("values", "normality"), ("lengths", "eopl_normality")])
def test_the_maps_are_w_and_p_at_the_action_of_the_largest_mean(
    drawn: Draw, tested: Path, of: str, prefix: str
) -> None:
    statistic, p = _images(drawn("normality", tested, "--of", of))
    with h5py.File(tested) as fit:
        greedy = np.nanargmax(fit["mean"][...], axis=-1)
        at = (*np.indices(greedy.shape), greedy)
        np.testing.assert_array_equal(statistic, fit[f"{prefix}_w"][...][at])
        np.testing.assert_array_equal(p, fit[f"{prefix}_p"][...][at])


@pytest.mark.parametrize("width", ["text", "column"])
def test_every_action_has_its_own_maps(drawn: Draw, refused: Draw, tested: Path, width: str) -> None:
    arguments = ("normality", tested, "--action", "all", "--width", width)
    if width == "column":
        code, sentence = refused(*arguments)
        assert code == 2
        assert "--width text" in sentence
        return
    figure = drawn(*arguments)
    images = _images(figure)
    assert len(images) == 8
    with h5py.File(tested) as fit:
        for action in range(4):
            np.testing.assert_array_equal(images[action], fit["normality_w"][..., action])
            np.testing.assert_array_equal(images[4 + action], fit["normality_p"][..., action])
    assert [axes.get_title() for axes in figure.axes[:4]] == ["up", "down", "left", "right"]


def test_the_label_tells_the_shares_that_each_correction_rejects(drawn: Draw, tested: Path) -> None:
    from statsmodels.stats.multitest import multipletests

    figure = drawn("normality", tested)
    _, p = _images(figure)
    known = p[np.isfinite(p)]
    label = (
        " ".join(axes.get_ylabel() for axes in figure.axes)
        .replace("\n", " ")
        .replace("\N{NO-BREAK SPACE}", " ")
    )
    shares = [np.mean(known < 0.05)]
    shares += [multipletests(known, 0.05, method)[0].mean() for method in ("fdr_bh", "fdr_by")]
    expected = [f"{100 * share:.0f} %" for share in shares]
    assert f"raw p; below 0.05: {expected[0]}, BH {expected[1]}, BY {expected[2]}" in label
    assert "W of Shapiro-Wilk, n" in label


def test_a_fit_without_the_test_says_how_to_get_one(refused: Draw, tested: Path, here: Draw) -> None:
    bare = here("fit", "sources.h5", "--normality", "none", "-q").path
    for of, words in (("values", "--normality shapiro"), ("lengths", "--eopl-normality rounded")):
        code, sentence = refused("normality", bare, "--of", of)
        assert code == 4
        assert words in sentence


def test_sources_are_refused(refused: Draw, pipeline: Any) -> None:
    code, sentence = refused("normality", pipeline.sources)
    assert code == 4
    assert "fit is needed" in sentence


def test_where_nothing_is_testable_the_maps_are_hatched_and_say_so(drawn: Draw, pipeline: Any) -> None:
    figure = drawn("normality", pipeline.fit)
    assert all(np.isnan(image).all() for image in _images(figure))
    assert all(axes.patches for axes in figure.axes if axes.images)
    assert any("hatched: not testable" in axes.get_ylabel().replace("\n", " ") for axes in figure.axes)


def test_classes_of_p_split_at_five_percent_also_in_grey() -> None:
    p = np.array([[0.0005, 0.005, 0.03, 0.051], [0.1, 0.3, 0.9, 1.0], [0.5] * 4, [0.5] * 4])
    with house_style():
        figure = normality([Map("", 1 - p, p)], Words("W", "p"), SIDE, SIDE, "")
    image = figure.axes[1].images[0]
    rgb = image.to_rgba(np.array(CLASSES[:-1]) + 1e-9)[:, :3]
    grey = rgb @ [0.299, 0.587, 0.114]
    steps = np.diff(grey)
    assert (steps > 0.05).all()
    assert steps.argmax() == CLASSES.index(0.05) - 1


def test_one_odd_cell_does_not_hide_the_others() -> None:
    w = np.linspace(0.95, 0.99, 400).reshape(20, 20)
    w[3, 3] = 0.1
    side = Side("row", np.arange(20.0))
    with house_style():
        figure = normality([Map("", w, w)], Words("W", "p"), side, side, "")
    norm = figure.axes[0].images[0].norm
    assert norm.vmin > 0.9
    assert norm.vmax < 1


def test_no_letter_is_too_small_at_either_width(drawn: Draw, tested: Path) -> None:
    from matplotlib.text import Text

    for width, inches in (("column", 3.5), ("text", 7.0)):
        figure = drawn("normality", tested, "--width", width, "--title", "mine")
        assert figure.get_size_inches()[0] == inches
        assert figure.get_suptitle() == "mine"
        letters = [text for text in figure.findobj(Text) if text.get_visible() and text.get_text()]
        assert min(text.get_fontsize() for text in letters) >= 6.5
