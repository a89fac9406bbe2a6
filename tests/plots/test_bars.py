"""Bars: the numbers of `qinit compare`, one group for each set of targets."""

from __future__ import annotations

import itertools
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

Draw = Callable[..., Any]
METHODS = ("zero", "ucoi", "logqinit-median")


def _compared(here: Draw, runs: list[Path], *options: str) -> list[dict[str, Any]]:
    rows: list[dict[str, Any]] = here("compare", *runs, "--json", *options).json["rows"]
    return rows


def _drawn_bars(figure: Any) -> dict[str, tuple[list[float], list[tuple[float, float]]]]:
    """Heights and intervals of each method, by the legend's names."""
    axes = figure.axes[0]
    found = {}
    for bars, lines in zip(axes.containers[::2], axes.containers[1::2], strict=True):
        ends = [
            (float(low[1]), float(high[1])) for low, high in filter(len, lines.lines[2][0].get_segments())
        ]
        found[bars.get_label()] = ([bar.get_height() for bar in bars], ends)
    return found


@pytest.fixture(scope="module")
def runs(pipeline: Any) -> list[Path]:
    return [pipeline.runs[name] for name in METHODS]


@pytest.mark.parametrize("metric", ["return", "success", "steps"])
def test_heights_and_intervals_are_those_of_compare(
    drawn: Draw, here: Draw, runs: list[Path], metric: str
) -> None:
    bars = _drawn_bars(drawn("bars", *runs, "--metric", metric))
    assert list(bars) == ["zero", "ucoi (reconstruction)", "logqinit-median"]
    for row in _compared(here, runs, "--metric", metric):
        heights, intervals = next(found for label, found in bars.items() if label.startswith(row["method"]))
        assert heights == [row[metric]]
        assert intervals == [pytest.approx((row[f"{metric}_low"], row[f"{metric}_high"]))]


def test_differences_to_a_baseline_are_those_of_compare_and_leave_it_out(
    drawn: Draw, here: Draw, runs: list[Path]
) -> None:
    figure = drawn("bars", *runs, "--minus", "ucoi")
    bars = _drawn_bars(figure)
    assert list(bars) == ["zero", "logqinit-median"]
    for row in _compared(here, runs, "--baseline", "ucoi"):
        if row["difference"] is not None:
            heights, intervals = bars[row["method"]]
            assert heights == [row["difference"]]
            assert intervals == [pytest.approx((row["difference_low"], row["difference_high"]))]
    assert figure.axes[0].get_ylabel() == "discounted return, minus ucoi"


def test_each_distribution_is_a_group_and_a_method_that_lacks_one_leaves_a_gap(
    drawn: Draw, here: Draw, uniform: Path, runs: list[Path], tmp_path: Path
) -> None:
    options = ("--tasks", 4, "--episodes", 60, "-q", "-o", tmp_path / "zero.h5")
    other = here("transfer", "zero", uniform, *options).path
    figure = drawn("bars", *runs, other)
    axes = figure.axes[0]
    assert [tick.get_text() for tick in axes.get_xticklabels()] == ["6 variance 2", "6 uniform"]
    heights, _ = _drawn_bars(figure)["logqinit-median"]
    assert np.isnan(heights).tolist() == [False, True]
    heights, _ = _drawn_bars(figure)["zero"]
    assert not np.isnan(heights).any()


def test_axes_say_what_is_drawn(drawn: Draw, runs: list[Path]) -> None:
    axes = drawn("bars", *runs).axes[0]
    assert axes.get_ylabel() == "discounted return"
    assert "95 % bootstrap intervals over targets" in axes.get_xlabel().replace("\n", " ")


def test_bars_are_told_apart_without_colour(drawn: Draw, pipeline: Any) -> None:
    from matplotlib.colors import to_rgb

    axes = drawn("bars", *pipeline.runs.values()).axes[0]
    looks = [(to_rgb(bars[0].get_facecolor()), bars[0].get_hatch()) for bars in axes.containers[::2]]
    assert len(set(looks)) == len(looks)
    hatches = [hatch for _, hatch in looks]
    assert all(first != second for first, second in itertools.pairwise(hatches))


def test_what_cannot_be_drawn_is_refused_in_one_sentence(
    refused: Callable[..., tuple[int, str]], pipeline: Any, runs: list[Path]
) -> None:
    for code, words, *arguments in (
        (4, "is of the kind fit; run is needed", pipeline.fit),
        (4, "no run of mean; qinit transfer mean FIT makes one", *runs, "--minus", "mean"),
        (4, "nothing differs from it", runs[0], "--minus", "zero"),
        (2, "--metric", *runs, "--metric", "speed"),
    ):
        ended, sentence = refused("bars", *arguments)
        assert words in sentence
        assert ended == code, sentence
