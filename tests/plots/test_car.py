"""The car, the hill and the noise: what is drawn is what the sources were learned with."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
from gymnasium.envs.classic_control.mountain_car import MountainCarEnv
from scipy import stats

from qinit_cli.plots.car import CarPlot

Draw = Callable[..., Any]


@pytest.fixture
def sources(here: Draw) -> Callable[..., Path]:
    """Sources of a few short tasks: `sources("--noise", 0.02)`."""

    def make(*options: object) -> Path:
        family = ("mountain-car", "--tasks", 5, "--episodes", 5, "--bins", 6, "-q", *options)
        path: Path = here("train-sources", *family).path
        return path

    return make


def test_the_hill_is_gymnasiums_up_to_its_scale(drawn: Draw, sources: Draw) -> None:
    axes = drawn("car", sources()).axes[0]
    at, height = axes.lines[0].get_data()
    theirs = MountainCarEnv()
    np.testing.assert_allclose(np.corrcoef(height, theirs._height(at))[0, 1], 1)
    assert (at[0], at[-1]) == (theirs.min_position, theirs.max_position)
    words = [text.get_text() for text in axes.texts]
    assert f"goal {theirs.goal_position:g}" in words
    assert "start (\N{MINUS SIGN}0.5, 0)" in words


@pytest.mark.parametrize(
    ("options", "spread"),
    [(("--noise", 0.02), 0.02), (("--noise", 0.0004, "--noise-is", "variance"), 0.02)],
)
def test_the_inset_is_the_normal_of_the_pushes_and_those_of_the_tasks(
    drawn: Draw, sources: Draw, options: tuple[object, ...], spread: float
) -> None:
    path = sources(*options)
    [inset] = drawn("car", path).axes[0].child_axes
    curve, rug = inset.lines
    np.testing.assert_allclose(curve.get_ydata(), stats.norm(0, spread).pdf(curve.get_xdata()), rtol=1e-12)
    with h5py.File(path) as file:
        np.testing.assert_array_equal(rug.get_xdata(), file["eta"][...])
    assert inset.get_title() == f"push η ~ N(0, {spread:g}²), one a task"


def test_the_noisy_part_begins_where_the_family_has_its_hill(drawn: Draw, sources: Draw) -> None:
    axes = drawn("car", sources("--hill", -0.25)).axes[0]
    [noisy] = [patch for patch in axes.patches if hasattr(patch, "get_width")]
    assert noisy.get_x() == -0.25
    assert noisy.get_x() + noisy.get_width() == pytest.approx(0.6)
    assert any("at least \N{MINUS SIGN}0.25" in text.get_text().replace("\n", " ") for text in axes.texts)


def test_pushes_that_are_drawn_every_step_belong_to_no_task(drawn: Draw, sources: Draw) -> None:
    path = sources("--noise-per", "step")
    [inset] = drawn("car", path).axes[0].child_axes
    assert inset.lines[1].get_xdata().size == 0
    assert inset.get_title().endswith("one every step")
    assert "tasks' pushes" not in CarPlot().drawn([path]).alt


def test_without_noise_every_push_is_zero(drawn: Draw, sources: Draw) -> None:
    [inset] = drawn("car", sources("--noise", 0)).axes[0].child_axes
    assert list(inset.lines[0].get_xdata()) == [0, 0]


def test_the_words_tell_the_spread_asked_for_and_the_one_there_is(sources: Draw) -> None:
    path = sources("--noise", 0.02)
    with h5py.File(path) as file:
        eta = file["eta"][...]
    said = CarPlot().drawn([path]).alt
    assert "a push of standard deviation 0.02" in said
    assert f"from {eta.min():.3g} to {eta.max():.3g}, standard deviation {eta.std():.3g}" in said


def test_another_family_has_no_car(refused: Draw, pipeline: Any) -> None:
    code, sentence = refused("car", pipeline.sources)
    assert code == 4
    assert "sources of gridworld, where there is no car" in sentence


@pytest.mark.parametrize(("width", "inches"), [("column", 3.5), ("text", 7.0)])
def test_no_letter_is_too_small_at_either_width(
    drawn: Draw, sources: Draw, width: str, inches: float
) -> None:
    from matplotlib.text import Text

    figure = drawn("car", sources(), "--width", width, "--title", "mine")
    assert figure.get_size_inches()[0] == inches
    assert figure.axes[0].get_title() == "mine"
    letters = [text for text in figure.findobj(Text) if text.get_visible() and text.get_text()]
    assert min(text.get_fontsize() for text in letters) >= 6.5
