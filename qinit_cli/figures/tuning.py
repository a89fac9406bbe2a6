"""What a method gains by other parameters: over one of them, a line for each value of a second, a panel for each of the rest."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from qinit_cli.figures.style import COLUMN, LETTER, TEXT, folded, line_styles, plain_numbers

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from qinit_cli.analysis.intervals import Interval
    from qinit_cli.arrays import Flags, Integers

# inches: a row of panels alone, one of several, all; a line of the legend
ALONE, SEVERAL, MOST, KEY = 2.5, 1.9, 7.8, 0.17
APART, SPREAD = 0.06, 0.5  # of the distance between values: from line to line, and all lines at most
DEFAULT: dict[str, Any] = {"marker": "o", "markersize": 10, "markerfacecolor": "none", "color": "black"}
CHOSEN: dict[str, Any] = {"marker": "*", "markersize": 7, "markeredgewidth": 0, "color": "black"}


@dataclass(frozen=True)
class Line:
    """The candidates that differ in the parameter along the axis alone, P of them."""

    label: str
    at: Integers  # (P,) which of the axis' values
    gain: Interval  # (P,) to the default
    default: Flags  # (P,)
    chosen: Flags  # (P,)


@dataclass(frozen=True)
class TuningPanel:
    """The lines of one combination of all parameters but two."""

    title: str
    lines: Sequence[Line]


def tuning(
    panels: Sequence[TuningPanel],
    values: Sequence[str],
    xlabel: str,
    ylabel: str,
    key: str,
    title: str,
    width: float = TEXT,
) -> Figure:
    """All panels on the same axes; the values stand evenly, in their order. Call it within `house_style`.

    `key` names what the lines differ in, "" where there is one.
    """
    from matplotlib.figure import Figure

    labels = list(dict.fromkeys(line.label for panel in panels for line in panel.lines))
    styles = dict(zip(labels, line_styles(len(labels)), strict=True))
    columns = min(len(panels), 3 if width > COLUMN else 1 if len(panels) < 4 else 2)
    rows = -(-len(panels) // columns)
    tall = ALONE if rows == 1 else min(SEVERAL, MOST / rows)
    keys = KEY * -(-(2 + len(labels) * bool(key)) // _abreast(width))
    heading = folded(title, width) if title else ""
    above = 0.16 * (1 + heading.count("\n")) if title else 0
    figure = Figure(figsize=(width, rows * tall + keys + above))
    drawn = figure.subplots(rows, columns, sharex=True, sharey=True, squeeze=False)
    for axes, panel in zip(drawn.flat, panels, strict=False):
        _panel(axes, panel, labels, styles)
        axes.set_title(panel.title, fontsize=7)
        axes.tick_params(labelbottom=True)
    for axes in drawn.flat[len(panels) - columns : len(panels)]:
        axes.set_xlabel(xlabel)
    for axes in drawn.flat[len(panels) :]:
        axes.remove()
    first = drawn.flat[0]
    crowded = sum(len(value) + 2 for value in values) * LETTER > 0.8 * width / columns
    first.set_xticks(range(len(values)), values)
    first.set_xlim(-0.5, len(values) - 0.5)
    for axes in drawn.flat[: len(panels)]:
        axes.tick_params(axis="x", rotation=90 if crowded else 0)
    plain_numbers(first.yaxis)
    figure.supylabel(folded(ylabel, rows * tall))
    _legend(figure, styles if key else {}, key, width)
    if heading:
        figure.suptitle(heading)
    return figure


def _panel(axes: Axes, panel: TuningPanel, labels: Sequence[str], styles: dict[str, dict[str, Any]]) -> None:
    """Points and their intervals, those of one value beside each other; the default and the choice are marked."""
    step = min(APART, SPREAD / len(labels))
    axes.axhline(0, color="black", linewidth=0.6)
    for line in panel.lines:
        at = line.at + step * (labels.index(line.label) - (len(labels) - 1) / 2)
        known = ~line.default  # to itself it has no interval
        around = np.array([line.gain.estimate - line.gain.low, line.gain.high - line.gain.estimate])
        axes.plot(at, line.gain.estimate, label=line.label, marker=".", markersize=4, **styles[line.label])
        axes.errorbar(
            at[known], line.gain.estimate[known], around[:, known], fmt="none",
            ecolor=styles[line.label]["color"], elinewidth=0.8, capsize=2, capthick=0.8,
        )  # fmt: skip
        for which, mark in ((line.default, DEFAULT), (line.chosen, CHOSEN)):
            if not which.any():
                continue  # a line of no points that is not clipped would stand at the far end of the page
            axes.plot(at[which], line.gain.estimate[which], linestyle="", zorder=3, clip_on=False, **mark)


def _legend(figure: Figure, styles: dict[str, dict[str, Any]], key: str, width: float) -> None:
    from matplotlib.lines import Line2D

    handles = [
        Line2D([], [], marker=".", markersize=4, label=f"{key} {label}", **look)
        for label, look in styles.items()
    ]
    marks = (("the default", DEFAULT), ("chosen", CHOSEN))
    handles += [Line2D([], [], linestyle="", label=label, **mark) for label, mark in marks]
    figure.legend(
        handles=handles,
        loc="outside lower center",
        ncols=min(len(handles), _abreast(width)),
    )


def _abreast(width: float) -> int:
    """Entries of the legend in a row."""
    return 6 if width > COLUMN else 3
