"""Values and their logarithms over source tasks with the fitted curve, and how they lie along its quantiles; Figures 5 and 10."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from qinit_cli.figures.style import COLOURS, COLUMN, TEXT, plain_numbers

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from qinit_cli.analysis.value_sample import ValueSample
    from qinit_cli.arrays import Floats

BAR_COLOUR = "#b3cde3"
POINT_COLOUR = COLOURS[0]
FIT_COLOUR = COLOURS[1]
FIT_LABEL = "fitted log-normal"
POINT_LABEL = "source tasks"
BAND_LABEL = "95 % band under the fit, point by point"
POINTS = 200  # along a curve
MOST_BINS = 40
FIT_ROOM = 1.4  # of the tallest bar: how far up the fitted curve is shown
HEIGHT = 5.6  # inches


@dataclass(frozen=True)
class StateHistograms:
    """A state-action's sample and what stands above its histograms."""

    sample: ValueSample
    of_values: str
    of_logarithms: str


def histograms(shown: Sequence[StateHistograms], title: str, width: float = TEXT) -> Figure:
    """A column a state-action: histogram of Q, histogram of ln Q, quantiles of ln Q. Call it within `house_style`."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(width, HEIGHT))
    panels = figure.subplots(3, len(shown), squeeze=False)
    for (values, logarithms, quantiles), state in zip(panels.T, shown, strict=True):
        sample = state.sample
        _histogram(values, sample.values, sample, sample.density)
        _histogram(logarithms, sample.logarithms, sample, sample.log_density)
        _quantiles(quantiles, sample)
        values.set(title=state.of_values, xlabel="Q (discounted return)")
        logarithms.set(title=state.of_logarithms, xlabel="ln Q")
        quantiles.set(xlabel="standard normal quantile")
    for axes, beside in zip(panels[:, 0], ("source tasks", "source tasks", "ln Q"), strict=True):
        axes.set_ylabel(beside)
    figure.align_ylabels(panels[:, 0])
    _legend(figure, 3 if width > COLUMN else 1)
    if title:
        figure.suptitle(title)
    return figure


def _histogram(axes: Axes, values: Floats, sample: ValueSample, density: Callable[[Floats], Floats]) -> None:
    """Counts in equal bins, and the fitted density times n and a bin's width: what the fit would have counted."""
    _ticks(axes)
    if not values.size:
        axes.text(0.5, 0.5, "no value above 0", transform=axes.transAxes, ha="center", va="center")
        return
    edges = _edges(values)
    counts, *_ = axes.hist(values, list(edges), color=BAR_COLOUR, edgecolor="black", linewidth=0.4)
    # a fit that is far off peaks out of sight rather than making the bars invisible
    axes.set_ylim(0, FIT_ROOM * float(np.max(counts)))
    if sample.sigma > 0:
        at = np.linspace(edges[0], edges[-1], POINTS)
        counted = density(at) * values.size * (edges[1] - edges[0])
        axes.plot(at, counted, color=FIT_COLOUR, label=FIT_LABEL)


def _edges(values: Floats) -> Floats:
    """Bins by the rule of Freedman and Diaconis, at most MOST_BINS."""
    edges: Floats = np.histogram_bin_edges(values, "fd")
    return edges if len(edges) <= MOST_BINS + 1 else np.histogram_bin_edges(values, MOST_BINS)


def _quantiles(axes: Axes, sample: ValueSample) -> None:
    _ticks(axes)
    if not sample.values.size:
        return
    scores = sample.normal_scores()
    low, high = sample.band()
    axes.fill_between(scores, low, high, color="#cccccc", linewidth=0, label=BAND_LABEL)
    axes.plot(scores, sample.mu + sample.sigma * scores, color=FIT_COLOUR)
    axes.plot(scores, sample.logarithms, ".", markersize=3, color=POINT_COLOUR, label=POINT_LABEL)


def _ticks(axes: Axes) -> None:
    from matplotlib.ticker import MaxNLocator

    axes.xaxis.set_major_locator(MaxNLocator(4, steps=[1, 2, 2.5, 5, 10]))
    axes.yaxis.set_major_locator(MaxNLocator(4, steps=[1, 2, 5, 10]))
    plain_numbers(axes.xaxis)
    plain_numbers(axes.yaxis)


def _legend(figure: Figure, columns: int) -> None:
    """What the lines, points and bands are, once each."""
    named = {
        label: handle
        for axes in figure.axes
        for handle, label in zip(*axes.get_legend_handles_labels(), strict=True)
    }
    labels = [label for label in (FIT_LABEL, POINT_LABEL, BAND_LABEL) if label in named]
    figure.legend([named[label] for label in labels], labels, loc="outside lower center", ncols=columns)
