"""Bars by method over groups of targets, with 95 % intervals; Figures 6 (right) and 9 (b) of the paper."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from qinit_cli.figures.style import COLUMN, TEXT, bar_styles, folded, plain_numbers

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from qinit_cli.analysis.intervals import Interval

GROUP = 0.84  # of the distance between groups that their bars take


@dataclass(frozen=True)
class Bars:
    """One method's means over the groups, and their intervals; NaN where a group has none."""

    label: str
    height: Interval  # (G,)


def bars(
    series: Sequence[Bars], groups: Sequence[str], xlabel: str, ylabel: str, title: str, width: float = TEXT
) -> Figure:
    """The groups side by side, one bar a method in each, with a legend. Call it within `house_style`."""
    import numpy as np
    from matplotlib.figure import Figure
    from matplotlib.ticker import MaxNLocator

    columns = 2 if width <= COLUMN else 4  # of the legend, beneath the axes
    beneath = folded(xlabel, 0.85 * width)
    lines = -(-len(series) // columns) + beneath.count("\n")
    figure = Figure(figsize=(width, 2.3 + 0.16 * lines))
    axes = figure.add_subplot()
    thick = GROUP / len(series)
    for at, (method, look) in enumerate(zip(series, bar_styles(len(series)), strict=True)):
        places = np.arange(len(groups)) + (at - (len(series) - 1) / 2) * thick
        height = method.height
        axes.bar(places, height.estimate, thick, label=method.label, edgecolor="white", linewidth=0.4, **look)
        reach = np.array([height.estimate - height.low, height.high - height.estimate])
        axes.errorbar(
            places,
            height.estimate,
            reach,
            fmt="none",
            ecolor="black",
            elinewidth=0.8,
            capsize=min(2.0, 8 * width / len(groups) * thick),
            capthick=0.8,
        )
    axes.axhline(0, color="black", linewidth=0.6)
    axes.set_xticks(range(len(groups)), groups)
    axes.set_xlim(-0.5, len(groups) - 0.5)
    axes.tick_params(axis="x", length=0)
    axes.yaxis.set_major_locator(MaxNLocator(6, steps=[1, 2, 5, 10]))
    plain_numbers(axes.yaxis)
    axes.set_xlabel(beneath)
    axes.set_ylabel(ylabel)
    axes.set_title(title)
    figure.legend(loc="outside lower center", ncols=columns)
    return figure
