"""Bars by method over groups of targets, with 95 % intervals; Figures 6 (right) and 9 (b) of the paper."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from qinit_cli.figures import legend
from qinit_cli.figures.looks import Appearance, appearances
from qinit_cli.figures.style import TEXT, folded, plain_numbers

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from qinit_cli.analysis.intervals import Interval

GROUP = 0.84  # of the distance between groups that their bars take
ALONE, HEIGHT, LINE = 2.3, 1.9, 0.16  # inches: one panel, one of several, a line beneath


@dataclass(frozen=True)
class Bars:
    """One method's means over the groups, and their intervals; NaN where a group has none."""

    label: str
    height: Interval  # (G,)
    method: str = ""  # its name
    plus: bool = False  # whether it starts from another


def bars(
    panels: Mapping[str, Sequence[Bars]],
    groups: Sequence[str],
    xlabel: str,
    ylabel: str,
    title: str,
    width: float = TEXT,
) -> Figure:
    """The groups side by side, one bar a method in each; panels, by their titles, beneath each other, with one legend.

    Call it within `house_style`.
    """
    from matplotlib.figure import Figure

    labels = list(dict.fromkeys(method.label for series in panels.values() for method in series))
    own = appearances(one for series in panels.values() for one in series)
    beneath = folded(xlabel, 0.85 * width)
    several = len(panels) > 1
    height = (len(panels) * HEIGHT + 0.4 if several else ALONE) + LINE * beneath.count("\n")
    figure = Figure(figsize=(width, height + legend.height(labels, width)))
    drawn = figure.subplots(len(panels), 1, squeeze=False)[:, 0]
    for axes, (name, series) in zip(drawn, panels.items(), strict=True):
        _bars(axes, series, own, groups, width)
        axes.set_ylabel(ylabel)
        axes.set_title(name if several else title)
    drawn[-1].set_xlabel(beneath)
    figure.align_ylabels(drawn)
    if several and title:
        figure.suptitle(title)
    legend.legend(figure, labels, width)
    return figure


def _bars(
    axes: Axes, series: Sequence[Bars], own: Mapping[str, Appearance], groups: Sequence[str], width: float
) -> None:
    from matplotlib.patheffects import withStroke
    from matplotlib.ticker import MaxNLocator

    halo = [withStroke(linewidth=2.0, foreground="white")]  # or it would not be seen before a black bar
    thick = GROUP / len(series)
    for at, method in enumerate(series):
        places = np.arange(len(groups)) + (at - (len(series) - 1) / 2) * thick
        height = method.height
        axes.bar(
            places,
            height.estimate,
            thick,
            label=method.label,
            edgecolor="white",
            linewidth=0.4,
            **own[method.label].bar(),
        )
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
            path_effects=halo,
        )
    axes.axhline(0, color="black", linewidth=0.6)
    axes.set_xticks(range(len(groups)), [folded(group, 0.9 * width / len(groups)) for group in groups])
    axes.set_xlim(-0.5, len(groups) - 0.5)
    axes.tick_params(axis="x", length=0)
    axes.yaxis.set_major_locator(MaxNLocator(6, steps=[1, 2, 5, 10]))
    plain_numbers(axes.yaxis)
