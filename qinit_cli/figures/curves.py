"""Learning curves with 95 % bands; Figures 6, 9, A2 and A3 of the paper."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from qinit_cli.figures.style import COLUMN, line_styles

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from qinit_cli.analysis.intervals import Interval
    from qinit_cli.arrays import Integers


@dataclass(frozen=True)
class Curve:
    """One method's mean over targets at some episodes, and its band."""

    label: str
    episodes: Integers  # (P,), counted from 1
    band: Interval  # (P,)


def curves(lines: Sequence[Curve], ylabel: str, title: str, band: str, width: float = COLUMN) -> Figure:
    """The curves over episodes, with a legend; `band` says what the shading is. Call it within `house_style`."""
    from matplotlib.figure import Figure

    columns = 2 if width <= COLUMN else 4  # of the legend, beneath the axes
    figure = Figure(figsize=(width, 2.4 + 0.15 * -(-len(lines) // columns)))
    axes = figure.add_subplot()
    for line, look in zip(lines, line_styles(len(lines)), strict=True):
        axes.plot(line.episodes, line.band.estimate, label=line.label, **look)
        axes.fill_between(
            line.episodes, line.band.low, line.band.high, color=look["color"], alpha=0.18, linewidth=0
        )
    axes.set_xlabel(f"episode (band: {band})")
    axes.set_ylabel(ylabel)
    axes.set_title(title)
    axes.set_xlim(1, max(line.episodes[-1] for line in lines))
    axes.set_ylim(bottom=min(0.0, axes.get_ylim()[0]))
    figure.legend(loc="outside lower center", ncols=columns)
    return figure
