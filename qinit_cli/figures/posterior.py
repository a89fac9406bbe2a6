"""Weights of source tables while targets are learned: how many tables count, and how much the heaviest does."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from qinit_cli.figures.style import COLUMN, TEXT, line_styles, plain_numbers

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from qinit_cli.arrays import Floats, Integers

PANEL, KEY = 2.3, 0.17  # inches
NUMBER_LABEL = "effective number of sources"
SHARE_LABEL = "weight of the heaviest source"


@dataclass(frozen=True)
class Weighed:
    """One method on one distribution: quantiles over targets (3, R), low, middle and high, after so many episodes."""

    label: str
    moments: Integers  # (R,) episodes that had ended, the first 0
    number: Floats  # (3, R)
    share: Floats  # (3, R)


def posterior(shown: Sequence[Weighed], title: str, band: str, width: float = TEXT) -> Figure:
    """Both panels, beside or beneath each other, over episodes on a logarithmic axis. Call it within `house_style`."""
    from matplotlib.figure import Figure

    beside = width > COLUMN
    keys = KEY * -(-len(shown) // (3 if beside else 1))
    figure = Figure(figsize=(width, (PANEL if beside else 2 * PANEL) + keys + (0.25 if title else 0)))
    panels = figure.subplots(1, 2) if beside else figure.subplots(2, 1)
    for axes, name, label in zip(panels, ("number", "share"), (NUMBER_LABEL, SHARE_LABEL), strict=True):
        for each, look in zip(shown, line_styles(len(shown)), strict=True):
            low, middle, high = getattr(each, name)
            axes.plot(each.moments, middle, label=each.label, **look)
            axes.fill_between(each.moments, low, high, color=look["color"], alpha=0.18, linewidth=0)
        axes.set(xlabel=f"episodes learned ({band})", ylabel=label)
        _over_episodes(axes, max(int(each.moments[-1]) for each in shown))
    panels[0].set_yscale("log")
    panels[0].set_ylim(bottom=0.9)
    plain_numbers(panels[0].yaxis)
    panels[1].set_ylim(0, 1)
    handles, labels = panels[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=3 if beside else 1)
    if title:
        figure.suptitle(title)
    return figure


def _over_episodes(axes: Axes, last: int) -> None:
    """From 0, before the first episode, and logarithmic from 1: most is decided in the first few."""
    axes.set_xscale("symlog", linthresh=1)
    axes.set_xlim(0, last)
    axes.set_xticks([0, *(10**power for power in range(8) if 10**power <= last)])
    axes.minorticks_off()
    plain_numbers(axes.xaxis)
