"""Curves and bars in several panels: one for each set of targets, or for each kind of method."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from qinit_cli.analysis.intervals import Interval
from qinit_cli.errors import UsageError
from qinit_cli.methods import METHODS
from qinit_cli.plots.curves import Curve, Panel, curves
from qinit_cli.plots.order import KINDS, of_kind, ordered
from qinit_cli.plots.style import TALLEST, house_style

Draw = Callable[..., Any]
QUICK = ("--tasks", 4, "--episodes", 60, "-q")


@pytest.fixture
def elsewhere(here: Draw, uniform: Path, tmp_path: Path) -> list[Path]:
    """Runs on targets of another distribution."""
    return [
        here("transfer", method, uniform, *QUICK, "-o", tmp_path / f"{method}.h5").path
        for method in ("zero", "logqinit-median")
    ]


def _runs(pipeline: Any, *names: str) -> list[Path]:
    return [pipeline.runs[name] for name in names]


def test_each_set_of_targets_has_its_panel_with_its_own_methods(
    drawn: Draw, pipeline: Any, elsewhere: list[Path]
) -> None:
    figure = drawn("curves", *_runs(pipeline, "mean", "zero", "logqinit-median"), *elsewhere)
    first, second = figure.axes
    assert [axes.get_title() for axes in figure.axes] == [
        "6 variance 2\nsources' q-learning",
        "6 uniform\nexact",
    ]
    assert [line.get_label() for line in first.lines] == ["zero", "mean", "logqinit-median"]
    assert [line.get_label() for line in second.lines] == ["zero", "logqinit-median"]
    assert first.lines[0].get_color() == second.lines[0].get_color()
    [legend] = figure.legends
    assert [text.get_text() for text in legend.get_texts()] == ["zero", "mean", "logqinit-median"]
    assert legend.get_title().get_text() == "band: 95 %, 4 targets"
    assert figure.get_suptitle() == "gridworld"


def test_a_panel_draws_what_it_would_draw_alone(drawn: Draw, pipeline: Any, elsewhere: list[Path]) -> None:
    alone = drawn("curves", *elsewhere).axes[0]
    beside = drawn("curves", *_runs(pipeline, "zero"), *elsewhere).axes[1]
    for one, other in zip(alone.lines, beside.lines, strict=True):
        np.testing.assert_array_equal(one.get_ydata(), other.get_ydata())


def test_other_targets_of_one_distribution_are_a_panel_of_their_own_and_named_apart(
    drawn: Draw, here: Draw, pipeline: Any, tmp_path: Path
) -> None:
    other = here("transfer", "zero", pipeline.fit, *QUICK, "--seed", 1, "-o", tmp_path / "other.h5").path
    figure = drawn("curves", pipeline.runs["zero"], pipeline.runs["mean"], other)
    assert [axes.get_title() for axes in figure.axes] == ["6 variance 2\nseed 0", "6 variance 2\nseed 1"]


def test_runs_that_met_only_the_first_targets_stand_beside_the_others_and_say_so(
    drawn: Draw, here: Draw, pipeline: Any, tmp_path: Path
) -> None:
    few = ("--tasks", 3, "--episodes", 60, "-q", "-o", tmp_path / "few.h5")
    other = here("transfer", "optimal", pipeline.fit, *few).path
    [axes] = drawn("curves", other, pipeline.runs["mean"], pipeline.runs["zero"]).axes
    labels = [line.get_label() for line in axes.lines]
    assert labels == ["zero", "mean", "optimal (privileged), first 3 targets"]
    assert "95 %, 4 targets" in axes.get_xlabel()


def test_bands_over_different_things_are_told_panel_by_panel() -> None:
    flat = Interval(*(np.array([0.1, 0.2]) for _ in range(3)))
    lines = [Curve("zero", np.array([1, 2]), flat)]
    with house_style():
        figure = curves([Panel("a", "4 targets", lines), Panel("b", "5 targets", lines)], "return", "")
    assert [axes.get_title() for axes in figure.axes] == ["a\nband: 4 targets", "b\nband: 5 targets"]


def test_by_kind_puts_initialisations_left_and_others_right_on_one_scale(drawn: Draw, pipeline: Any) -> None:
    names = ("zero", "ucoi", "logqinit-median", "ptrs", "ops-tl")
    left, right = drawn("curves", *_runs(pipeline, *names), "--by-kind", "--width", "text").axes
    assert [line.get_label() for line in left.lines] == ["zero", "ucoi (reconstruction)", "logqinit-median"]
    assert [line.get_label() for line in right.lines] == [
        "zero", "logqinit-median", "ptrs", "ops-tl (reconstruction)",
    ]  # fmt: skip
    assert [axes.get_title() for axes in (left, right)] == [f"6 variance 2, {kind}" for kind in KINDS]
    assert left.get_ylim() == right.get_ylim()


def test_bars_by_kind_stand_beneath_each_other(drawn: Draw, pipeline: Any) -> None:
    upper, lower = drawn("bars", *_runs(pipeline, "mean", "zero", "ptrs"), "--by-kind").axes
    assert [bars.get_label() for bars in upper.containers[::2]] == ["zero", "mean"]
    assert [bars.get_label() for bars in lower.containers[::2]] == ["zero", "ptrs"]
    assert [axes.get_title() for axes in (upper, lower)] == list(KINDS)


@pytest.mark.parametrize("picture", ["curves", "bars"])
def test_by_kind_needs_methods_of_both_kinds(refused: Draw, pipeline: Any, picture: str) -> None:
    runs = [pipeline.runs["ptrs"], pipeline.runs["ops-tl"]]
    code, sentence = refused(picture, *runs, "--by-kind")
    assert code == 4
    assert "no runs of initialisations" in sentence


@pytest.mark.parametrize(
    ("method", "plus", "kinds"),
    [
        ("mean", False, [KINDS[0]]),
        ("logqinit-quantile", False, [KINDS[0]]),
        ("zero", False, list(KINDS)),
        ("logqinit-median", False, list(KINDS)),
        ("ptrs", False, [KINDS[1]]),
        ("ptrs", True, [KINDS[1]]),
        ("ops-tl", False, [KINDS[1]]),
        ("a-plug-in", False, [KINDS[1]]),
    ],
)
def test_every_method_is_of_a_kind(method: str, plus: bool, kinds: list[str]) -> None:
    flat = Interval(*(np.zeros(1) for _ in range(3)))
    line = Curve("its label", np.ones(1, int), flat, method, plus)
    assert [kind for kind in KINDS if of_kind(line, kind)] == kinds


def test_methods_stand_as_they_are_registered_with_their_plus_behind_them() -> None:
    given = {"mine": "mine", "ptrs+mean": "ptrs", "drs": "drs", "ptrs": "ptrs", "zero": "zero"}
    given["logqinit-median"] = "logqinit-median"
    flat = Interval(*(np.zeros(1) for _ in range(3)))
    found = ordered(
        [Curve(label, np.ones(1, int), flat, method, "+" in label) for label, method in given.items()]
    )
    assert [line.label for line in found] == ["zero", "logqinit-median", "ptrs", "ptrs+mean", "drs", "mine"]


def test_more_panels_than_a_page_holds_are_refused() -> None:
    flat = Interval(*(np.zeros(2) for _ in range(3)))
    panels = [Panel(str(at), "", [Curve("zero", np.array([1, 2]), flat)]) for at in range(24)]
    with house_style(), pytest.raises(UsageError, match="do not fit on a page"):
        curves(panels, "return", "", 7.0)


def test_six_distributions_by_kind_fit_on_a_page() -> None:
    flat = Interval(*(np.zeros(2) for _ in range(3)))
    lines = [Curve(label, np.array([1, 2]), flat) for label in METHODS]
    with house_style():
        figure = curves([Panel(str(at), "", lines) for at in range(12)], "return", "title", 7.0, across=2)
    assert len(figure.axes) == 12
    assert figure.get_size_inches()[1] <= TALLEST


@pytest.mark.parametrize(("width", "inches"), [("column", 3.5), ("text", 7.0)])
def test_no_letter_is_too_small_in_several_panels(
    drawn: Draw, pipeline: Any, elsewhere: list[Path], width: str, inches: float
) -> None:
    from matplotlib.text import Text

    for picture in ("curves", "bars"):
        figure = drawn(picture, *pipeline.runs.values(), *elsewhere, "--width", width)
        assert figure.get_size_inches()[0] == inches
        letters = [text for text in figure.findobj(Text) if text.get_visible() and text.get_text()]
        assert min(text.get_fontsize() for text in letters) >= 6.5


@pytest.mark.parametrize(
    ("smooth", "said"), [(20, "discounted return, mean of the last 20 episodes"), (1, "discounted return")]
)
def test_the_picture_says_over_how_many_episodes_curves_are_smoothed(
    drawn: Draw, pipeline: Any, smooth: int, said: str
) -> None:
    figure = drawn("curves", *_runs(pipeline, "mean", "zero"), "--smooth", smooth)
    assert figure.axes[0].get_ylabel().replace("\n", " ") == said


def test_panels_of_other_settings_are_named_by_them(drawn: Draw, here: Draw, pipeline: Any) -> None:
    options = ("--tasks", 4, "--episodes", 60, "-q")
    others = [
        here("transfer", "mean", pipeline.fit, *more, *options).path
        for more in (("--gamma", 0.9), ("--seed", 3))
    ]
    figure = drawn("curves", *_runs(pipeline, "mean"), *others)
    titles = [axes.get_title().split("\n", 1)[1].replace("\n", " ") for axes in figure.axes if axes.lines]
    assert titles == ["seed 0, gamma 0.95", "seed 3, gamma 0.95", "seed 0, gamma 0.9"]
