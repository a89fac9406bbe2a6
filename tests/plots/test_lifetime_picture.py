"""Returns of tasks that are learned one after another."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest

from qinit_cli.plots.lifetime import FITTED_LABEL, SPREAD_LABEL

Draw = Callable[..., Any]
SHORT = ("--tasks", 4, "--episodes", 60, "-q")


def test_points_are_the_tasks_mean_returns_and_the_line_their_running_mean(
    drawn: Draw, pipeline: Any
) -> None:
    figure = drawn("lifetime", pipeline.runs["mean"])
    with h5py.File(pipeline.runs["mean"]) as file:
        steps, reached = file["steps"][...], file["reached"][...].astype(bool)
    earned = np.where(reached, 0.95 ** (steps - 1.0), 0.0).mean(axis=1)
    [axes] = figure.axes
    [line], [points] = axes.lines, axes.collections
    np.testing.assert_allclose(points.get_offsets()[:, 1], earned, rtol=1e-12)
    np.testing.assert_array_equal(line.get_xdata(), np.arange(1, len(earned) + 1))
    wanted = [
        earned[: place + 1].mean() for place in range(len(earned))
    ]  # fewer than twenty tasks: all so far
    np.testing.assert_allclose(line.get_ydata(), wanted, rtol=1e-12)


def test_an_updated_lifetime_shows_how_the_spread_moves(drawn: Draw, here: Draw, pipeline: Any) -> None:
    arguments = ("lifelong", "logqinit-median", pipeline.fit, *SHORT)
    updated = here(*arguments, "--update", "--min-visits", 5).path
    frozen = here(*arguments).path
    figure = drawn("lifetime", frozen, updated, "--store", pipeline.store)
    assert [text.get_text() for text in figure.legends[0].texts] == [
        "logqinit-median, gridworld-6-variance-2",
        "logqinit-median updated, gridworld-6-variance-2",
        FITTED_LABEL,
    ]
    with h5py.File(updated) as file:
        spread = file["log_std"][...]
    earned, moved = figure.axes
    assert len(earned.lines) == 2
    assert moved.get_ylabel() == SPREAD_LABEL
    line, fitted, _ = moved.lines  # the last is the legend's
    np.testing.assert_array_equal(line.get_ydata(), spread)
    with h5py.File(pipeline.fit) as file:
        known = file["sigma"][...][file["n"][...] > 0]
    np.testing.assert_allclose(fitted.get_ydata(), np.median(known), rtol=1e-12)


def test_a_fit_that_is_not_in_the_store_is_noted_and_the_rest_is_drawn(
    here: Draw, pipeline: Any, tmp_path: Path
) -> None:
    updated = here("lifelong", "mean", pipeline.fit, *SHORT, "--update", "--min-visits", 5).path
    elsewhere = here(
        "plot", "lifetime", updated, "--store", tmp_path / "empty", "-o", tmp_path / "spread.png"
    )
    assert elsewhere.code == 0
    assert f"as fitted is not drawn: {pipeline.fit.name}, which" in elsewhere.err


def test_every_dot_is_whole_and_every_number_of_a_task_too(drawn: Draw, pipeline: Any) -> None:
    figure = drawn("lifetime", pipeline.runs["mean"])
    [axes] = figure.axes
    [points] = axes.collections
    assert not points.get_clip_on()
    low, high = axes.get_xlim()
    tasks = points.get_offsets()[:, 0]
    assert low < tasks.min()
    assert tasks.max() < high
    assert all(tick == round(tick) for tick in axes.get_xticks())


def test_too_many_lines_are_refused(here: Draw, pipeline: Any) -> None:
    ended = here("plot", "lifetime", *[pipeline.runs["mean"]] * 7, "-o", "many.png")
    assert ended.code == 2
    assert "7 runs do not fit" in ended.err


@pytest.mark.parametrize("kind", ["fit", "sources"])
def test_only_runs_have_lifetimes(kind: str, here: Draw, pipeline: Any) -> None:
    assert here("plot", "lifetime", getattr(pipeline, kind), "-o", "wrong.png").code == 4
