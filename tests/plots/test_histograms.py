"""Histograms: the values of the sources, the curve of the fit, and what the titles say of them."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import h5py
import numpy as np
import pytest
import scipy.stats

from qinit_cli.analysis.value_sample import ValueSample, shapiro_wilk_of
from qinit_cli.plots.histograms import FIT_ROOM, StateHistograms, histograms
from qinit_cli.plots.style import house_style

Draw = Callable[..., Any]


def _values(pipeline: Any, row: int, column: int) -> tuple[str, np.ndarray[Any, Any]]:
    """The action of the largest mean in the fit, and the values of the sources there."""
    with h5py.File(pipeline.fit) as fit, h5py.File(pipeline.sources) as sources:
        greedy = int(np.nanargmax(fit["mean"][row, column]))
        return ("up", "down", "left", "right")[greedy], sources["q"][:, row, column, greedy]


def _panels(figure: Any, states: int) -> np.ndarray[Any, Any]:
    return np.array(figure.axes).reshape(3, states)


def _sample(count: int = 60) -> ValueSample:
    return ValueSample.of(np.random.default_rng(3).lognormal(-1, 0.5, count))


def test_the_points_are_the_sources_logarithms_at_the_action_of_the_largest_mean(
    drawn: Draw, pipeline: Any
) -> None:
    panels = _panels(drawn("histograms", pipeline.sources, "--state", "0,0", "--state", "5,2"), 2)
    for column, (row, col) in zip(panels.T, ((0, 0), (5, 2)), strict=True):
        action, values = _values(pipeline, row, col)
        positive = np.sort(values[values > 0])
        points = column[2].lines[1]
        np.testing.assert_array_equal(points.get_ydata(), np.log(positive))
        heights = [bar.get_height() for bar in column[1].patches]
        assert sum(heights) == len(positive)
        first = column[0].get_title().split("\n")
        assert first[:2] == [f"({row}, {col}), {action}", f"n = {len(positive)}, masked {4 - len(positive)}"]


def test_the_fitted_line_has_the_mu_and_sigma_of_the_fit(drawn: Draw, pipeline: Any) -> None:
    figure = drawn("histograms", pipeline.sources, "--state", "1,2")
    line = figure.axes[2].lines[0]
    with h5py.File(pipeline.fit) as fit:
        greedy = int(np.nanargmax(fit["mean"][1, 2]))
        mu, sigma = fit["mu"][1, 2, greedy], fit["sigma"][1, 2, greedy]
    np.testing.assert_allclose(line.get_ydata(), mu + sigma * line.get_xdata(), rtol=1e-12)


def test_the_states_of_the_family_are_shown_by_default(drawn: Draw, pipeline: Any) -> None:
    panels = _panels(drawn("histograms", pipeline.sources), 3)
    assert [axes.get_title().split(",")[0] for axes in panels[0]] == ["(0", "(4", "(5"]
    assert {axes.get_xlabel() for axes in panels[0]} == {"Q (discounted return)"}
    assert [axes.get_ylabel() for axes in panels[:, 0]] == ["source tasks", "source tasks", "ln Q"]


def test_the_curves_are_scipys_densities_scaled_to_counts() -> None:
    sample = _sample()
    with house_style():
        figure = histograms([StateHistograms(sample, "", "")], "")
    for axes, fitted in (
        (figure.axes[0], scipy.stats.lognorm(sample.sigma, scale=np.exp(sample.mu))),
        (figure.axes[1], scipy.stats.norm(sample.mu, sample.sigma)),
    ):
        [curve] = axes.lines
        width = axes.patches[0].get_width()
        np.testing.assert_allclose(curve.get_ydata(), fitted.pdf(curve.get_xdata()) * 60 * width, rtol=1e-9)


def test_the_band_holds_the_points_of_samples_from_the_fit_95_times_in_100() -> None:
    sample = _sample(40)
    low, high = sample.band()
    draws = np.sort(np.random.default_rng(1).normal(sample.mu, sample.sigma, (4_000, 40)), axis=1)
    share = ((low <= draws) & (draws <= high)).mean(axis=0)
    np.testing.assert_allclose(share, 0.95, atol=0.015)


def test_the_titles_statistic_is_scipys() -> None:
    sample = _sample()
    statistic, p = shapiro_wilk_of(sample.logarithms)
    expected = scipy.stats.shapiro(sample.logarithms)
    assert statistic == pytest.approx(expected.statistic, abs=1e-7)
    assert p == pytest.approx(expected.pvalue, abs=1e-5)


@pytest.mark.parametrize("values", [np.ones(20), np.arange(1.0, 8.0), np.zeros(5)])
def test_too_few_or_equal_values_are_not_testable_and_yet_drawn(values: np.ndarray[Any, Any]) -> None:
    sample = ValueSample.of(values)
    assert np.isnan(shapiro_wilk_of(sample.values)).all()
    with house_style():
        histograms([StateHistograms(sample, "", "")], "").canvas.draw()


def test_a_state_without_a_positive_value_says_so(drawn: Draw) -> None:
    with house_style():
        figure = histograms([StateHistograms(ValueSample.of(np.zeros(9)), "", "")], "")
    assert [text.get_text() for text in figure.axes[0].texts] == ["no value above 0"]


def test_values_that_are_not_positive_are_masked_and_counted() -> None:
    sample = ValueSample.of(np.array([0.5, 0.0, 0.25, -1e-9]))
    assert sample.masked == 2
    assert sample.values.tolist() == [0.25, 0.5]


def test_a_fit_that_is_far_off_does_not_hide_the_bars() -> None:
    values = np.append(np.geomspace(1e-7, 1e-3, 11), 0.5)
    with house_style():
        figure = histograms([StateHistograms(ValueSample.of(values), "", "")], "")
    bars = [bar.get_height() for bar in figure.axes[0].patches]
    assert figure.axes[0].get_ylim() == (0, pytest.approx(FIT_ROOM * max(bars)))


def test_what_cannot_be_drawn_is_refused_in_one_sentence(
    refused: Callable[..., tuple[int, str]], pipeline: Any
) -> None:
    for code, words, *arguments in (
        (4, "is of the kind fit; sources is needed", pipeline.fit),
        (2, "write ROW,COL", pipeline.sources, "--state", "3"),
        (2, "write ROW,COL", pipeline.sources, "--state", "a,b"),
        (2, "row is a whole number from 0 to 5", pipeline.sources, "--state", "6,0"),
        (2, "col is a whole number from 0 to 5", pipeline.sources, "--state", "0,1.5"),
        (2, "row is a whole number from 0 to 5", pipeline.sources, "--state", "nan,0"),
        (2, "3 states do not fit", pipeline.sources, "--width", "column"),
    ):
        ended, sentence = refused("histograms", *arguments)
        assert words in sentence
        assert ended == code, sentence
