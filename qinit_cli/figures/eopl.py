"""Path lengths of one state over source tasks: a histogram for each distribution, all densities together; Figure 8 of the paper.

Learned tables differ even where all tasks are alike. What that alone spreads, the noise floor, stands beside the rest.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from qinit_cli.figures.style import COLUMN, TEXT, folded, line_styles, plain_numbers

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from qinit_cli.analysis.length_sample import LengthSample
    from qinit_cli.arrays import Floats

BAR_COLOUR = "#b3cde3"
FLOOR_COLOUR = "#bbbbbb"
FIT_COLOUR = "black"  # unlike every line of the densities but the seventh
FIT_LABEL = "normal of the same mean and deviation; W and p are of Shapiro-Wilk against its rounding"
LENGTH_LABEL = "path length (steps)"
MOST_BINS = 50
POINTS = 400  # along a curve
ROW, LEAST, ABOVE, BENEATH = 1.05, 2.6, 0.25, 0.75  # inches
FIT_ROOM = 1.3  # of the tallest bar: how far up the normal is shown


@dataclass(frozen=True)
class DrawnLengths:
    """One distribution's lengths, and what is said of them."""

    name: str
    words: str
    sample: LengthSample
    floor: bool  # all tasks are alike: what spreads is learning


def eopl(shown: Sequence[DrawnLengths], title: str, width: float = TEXT) -> Figure:
    """Histograms below each other, densities beside or beneath them. Call it within `house_style`."""
    from matplotlib.figure import Figure

    beside = width > COLUMN
    rows = len(shown)
    height = max(LEAST, rows * ROW + ABOVE + BENEATH) + (0 if beside else LEAST)
    figure = Figure(figsize=(width, height))
    parts = (
        figure.add_gridspec(1, 2) if beside else figure.add_gridspec(2, 1, height_ratios=[rows * ROW, LEAST])
    )
    cells = parts[0].subgridspec(rows, 1)
    panels = [figure.add_subplot(cells[row]) for row in range(rows)]
    densities = figure.add_subplot(parts[1])
    edges = _edges([each.sample.lengths for each in shown])
    room = (width / 2 if beside else width) - 0.7
    for axes, each in zip(panels, shown, strict=True):
        _histogram(axes, each, edges, room)
        axes.sharex(panels[0])
        axes.set(xlim=(edges[0], edges[-1]), ylabel="tasks")
        axes.tick_params(labelbottom=axes is panels[-1])
    panels[-1].set_xlabel(LENGTH_LABEL)
    figure.align_ylabels(panels)
    _densities(densities, shown, np.linspace(edges[0], edges[-1], POINTS))
    handles, labels = densities.get_legend_handles_labels()
    fits = [line for axes in panels for line in axes.lines][:1]
    figure.legend(
        [*handles, *fits],
        [*(folded(label, room) for label in labels), *[folded(FIT_LABEL, room) for _ in fits]],
        loc="outside lower center",
        ncols=2 if beside else 1,
    )
    if title:
        figure.suptitle(title)
    return figure


def _edges(samples: Sequence[Floats]) -> Floats:
    """Bins of whole lengths, the same for all, at most MOST_BINS from the shortest to the longest, edges between lengths."""
    known = np.concatenate([np.empty(0), *samples])
    low, high = (float(known.min()), float(known.max())) if known.size else (0.0, 1.0)
    step = max(1.0, np.ceil((high - low + 1) / MOST_BINS))
    edges: Floats = np.arange(low - 0.5 - step, high + 0.5 + 2 * step, step)
    return edges


def _histogram(axes: Axes, each: DrawnLengths, edges: Floats, room: float) -> None:
    from matplotlib.ticker import MaxNLocator

    sample = each.sample
    colour = FLOOR_COLOUR if each.floor else BAR_COLOUR
    counts, *_ = axes.hist(sample.lengths, list(edges), color=colour, edgecolor="black", linewidth=0.4)
    axes.set_ylim(0, FIT_ROOM * max(1.0, float(np.max(counts))))
    if sample.deviation > 0:
        at = np.linspace(edges[0], edges[-1], POINTS)
        counted = sample.normal_density(at) * sample.lengths.size * (edges[1] - edges[0])
        axes.plot(at, counted, color=FIT_COLOUR, linewidth=0.9)
    axes.set_title(folded(f"{each.name}: {each.words}", room), loc="left", fontsize=7, pad=2)
    axes.yaxis.set_major_locator(MaxNLocator(2, integer=True))
    axes.xaxis.set_major_locator(MaxNLocator(6, integer=True))
    plain_numbers(axes.xaxis)


def _densities(axes: Axes, shown: Sequence[DrawnLengths], at: Floats) -> None:
    """Smooth densities; the floor is an area behind the lines, its peak cut off where it would flatten them."""
    from matplotlib.ticker import MaxNLocator

    lines = [each for each in shown if not each.floor and each.sample.lengths.size]
    tallest = 0.0
    for each, look in zip(lines, line_styles(len(lines)), strict=True):
        density = each.sample.smooth_density(at)
        tallest = max(tallest, float(density.max()))
        axes.plot(at, density, label=each.name, **look)
    for each in shown:
        if each.floor and each.sample.lengths.size:
            density = each.sample.smooth_density(at)
            axes.fill_between(at, density, color=FLOOR_COLOUR, linewidth=0, zorder=0, label=each.name)
            tallest = max(tallest, float(density.max())) if not lines else tallest
    axes.set_xlim(at[0], at[-1])
    axes.set_ylim(0, 1.1 * tallest if tallest else 1.0)
    axes.set(xlabel=LENGTH_LABEL, ylabel="density (1 / step)")
    axes.xaxis.set_major_locator(MaxNLocator(6, integer=True))
    axes.yaxis.set_major_locator(MaxNLocator(4))
    plain_numbers(axes.xaxis)
    plain_numbers(axes.yaxis)
