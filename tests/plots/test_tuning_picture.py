"""How a method's parameters fared on its sources, drawn."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest

from qinit_cli.plots.tuning import TuningPlot

Draw = Callable[..., Any]


def _gains(path: Path) -> dict[tuple[float, ...], float]:
    """The mean gain of each candidate over the default, which comes first, by its parameters."""
    with h5py.File(path) as file:
        average = file["average"][...]
        names = [name for name in ("rho", "nu", "psi0", "kappa") if name in file]
        parameters = np.stack([file[name][...] for name in names], axis=1)
    gains = (average - average[:, :1]).mean(axis=0)
    return {tuple(each.tolist()): float(gain) for each, gain in zip(parameters, gains, strict=True)}


@pytest.fixture(scope="module")
def tuned(tuning: Path, tmp_path_factory: pytest.TempPathFactory) -> Callable[..., Path]:
    """A choice of ops-tl's parameters by the sources of the other choice: `tuned("--rho", "0.9,0.99")`."""
    from running import run_here

    def make(*options: str) -> Path:
        path = tmp_path_factory.mktemp("tuned") / "tuning.h5"
        sources = tuning.with_name("sources.h5")
        ended = run_here(
            ["tune", "ops-tl", str(sources), "--episodes", "20", *options, "-o", str(path), "-q"]
        )
        assert ended.code == 0, ended.err
        return path

    return make


def _points(axes: Any, label: str) -> tuple[list[float], list[float]]:
    line = next(
        line for line in axes.lines if line.get_marker() == "." and (not label or line.get_label() == label)
    )
    return np.asarray(line.get_xdata()).tolist(), np.asarray(line.get_ydata()).tolist()


def test_one_parameter_is_a_line_of_gains_over_the_default_in_the_order_of_its_values(
    drawn: Draw, tuning: Path
) -> None:
    [axes] = drawn("tuning", tuning).axes
    gains = _gains(tuning)
    assert [text.get_text() for text in axes.get_xticklabels()] == ["1", "3", "10"]
    at, height = _points(axes, "")
    assert at == [0, 1, 2]
    np.testing.assert_allclose(height, [gains[(1,)], gains[(3,)], 0.0], atol=1e-12)
    assert axes.get_xlabel() == "kappa"


def test_values_that_differ_in_their_fourth_digit_are_told_apart(
    drawn: Draw, tuned: Callable[..., Path]
) -> None:
    [axes] = drawn("tuning", tuned("--rho", "0.9995,0.9999,1", "--nu", "0.98")).axes
    assert [text.get_text() for text in axes.get_xticklabels()] == ["0.99", "0.9995", "0.9999", "1"]


def test_the_default_and_the_choice_are_marked(drawn: Draw, tuning: Path) -> None:
    [axes] = drawn("tuning", tuning).axes
    gains = _gains(tuning)
    marks = {
        line.get_marker(): line
        for line in axes.lines
        if line.get_linestyle() == "None" and len(line.get_xdata())
    }
    assert (marks["o"].get_xdata().tolist(), marks["o"].get_ydata().tolist()) == ([2], [0])
    best = max(gains, key=lambda one: gains[one])
    assert marks["*"].get_xdata().tolist() == [[(1,), (3,), (10,)].index(best)]


def test_a_second_parameter_makes_lines_and_a_third_panels(drawn: Draw, tuned: Callable[..., Path]) -> None:
    path = tuned("--rho", "0.9,0.99,1", "--nu", "0.5,0.98", "--psi0", "0.5,1")
    figure = drawn("tuning", path, "--width", "column")
    gains = _gains(path)
    assert [axes.get_title() for axes in figure.axes] == ["nu 0.5", "nu 0.98"]
    for axes, nu in zip(figure.axes, (0.5, 0.98), strict=True):
        for label, psi0 in (("0.5", 0.5), ("1", 1.0)):
            _, height = _points(axes, label)
            np.testing.assert_allclose(
                height, [gains[(rho, nu, psi0)] for rho in (0.9, 0.99, 1.0)], atol=1e-12
            )
    assert [text.get_text() for text in figure.legends[0].texts] == [
        "psi0 0.5",
        "psi0 1",
        "the default",
        "chosen",
    ]


def test_the_words_name_the_default_the_best_and_what_choosing_is_worth(tuning: Path) -> None:
    gains = _gains(tuning)
    said = TuningPlot().drawn([tuning]).alt
    assert "ucoi, gridworld-6-variance-2 on 12 of its sources under 3 choices of parameters" in said
    assert "the default (kappa 10)" in said
    best = max(gains, key=lambda one: gains[one])
    assert ("the default is the best" in said) == (best == (10,))
    assert (
        f"the least kappa {min(gains, key=lambda one: gains[one])[0]:g} with {min(gains.values()):.4f}"
        in said
    )
    assert "a choice is worth" in said


def test_more_lines_than_can_be_told_apart_are_refused(refused: Draw, tuned: Callable[..., Path]) -> None:
    eight = ",".join(f"{place / 10}" for place in range(1, 9))
    code, sentence = refused("tuning", tuned("--rho", eight, "--nu", eight))
    assert code == 2
    assert "panels: 1, lines in each: 9; at most 12 and 7 fit" in sentence


def test_a_run_is_no_tuning(refused: Draw, pipeline: Any) -> None:
    code, sentence = refused("tuning", pipeline.runs["zero"])
    assert code == 4
    assert "tuning is needed" in sentence
