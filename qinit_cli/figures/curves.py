"""Learning curves with 95 % bands, in one panel or several; Figures 6, 9, A2 and A3 of the paper."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from qinit_cli.errors import UsageError
from qinit_cli.figures import legend
from qinit_cli.figures.looks import Appearance, appearances
from qinit_cli.figures.style import COLUMN, TALLEST, folded, plain_numbers

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from qinit_cli.analysis.intervals import Interval
    from qinit_cli.arrays import Integers

ALONE, HEIGHT, LEAST = 2.4, 1.75, 1.1  # inches: one panel, one of several, one of many
TITLED, LINE = (
    0.4,
    0.14,
)  # inches beside a panel's axes: its title and its numbers, a further line of the title
FEW = 6  # lines, whose bands may be darker
XLABEL = "episode"


@dataclass(frozen=True)
class Curve:
    """One method's mean over targets at some episodes, and its band."""

    label: str
    episodes: Integers  # (P,), counted from 1
    band: Interval  # (P,)
    method: str = ""  # its name
    plus: bool = False  # whether it starts from another


@dataclass(frozen=True)
class Panel:
    """Curves of methods that met the same targets."""

    title: str
    band: str  # what the shading is over
    lines: Sequence[Curve]


def curves(
    panels: Sequence[Panel], ylabel: str, title: str, width: float = COLUMN, *, across: int | None = None
) -> Figure:
    """A panel each, `across` of them side by side, one legend beneath; a method looks the same in all.

    Panels that stand side by side by `across` share their scale. Call it within `house_style`.
    """
    from matplotlib.figure import Figure

    labels = list(dict.fromkeys(line.label for panel in panels for line in panel.lines))
    columns = across or _across(len(panels), width)
    rows = -(-len(panels) // columns)
    alike = len({panel.band for panel in panels}) == 1
    band = f"band: {panels[0].band}" if alike and len(panels) > 1 else ""
    alone = len(panels) == 1
    titles = [_title(panel, 0.8 * width / columns, band=not alike) for panel in panels]
    lines = 0 if alone else max(name.count("\n") for name in titles)  # beyond the first
    around = legend.height(labels, width, band) + (0.0 if alone else 0.3 + (0.2 if title else 0))
    each = ALONE if alone else min(HEIGHT + LINE * lines, (TALLEST - around) / rows)
    if each < LEAST + LINE * lines:
        raise UsageError(f"{len(panels)} panels do not fit on a page; draw fewer distributions")
    height = rows * each + around
    figure = Figure(figsize=(width, height))
    drawn = figure.subplots(rows, columns, squeeze=False, sharey="row" if across else False)
    own = appearances(line for panel in panels for line in panel.lines)
    for at, (axes, panel) in enumerate(zip(drawn.flat, panels, strict=False)):
        _lines(axes, panel, own)
        axes.set_title(title if alone else titles[at])
        if at % columns == 0:
            axes.set_ylabel(folded(ylabel, each - (TITLED + LINE * lines) * (not alone)))
        if at + columns >= len(panels):
            axes.set_xlabel(f"{XLABEL} (band: {panel.band})" if alone else XLABEL)
    figure.align_ylabels(list(drawn[:, 0]))
    for axes in list(drawn.flat)[len(panels) :]:
        axes.set_axis_off()
    if len(panels) > 1 and title:
        figure.suptitle(title)
    legend.legend(figure, labels, width, band)
    return figure


def _title(panel: Panel, room: float, *, band: bool) -> str:
    """What stands above one of several panels, in lines of at most `room` inches."""
    return folded(f"{panel.title}\nband: {panel.band}" if band else panel.title, room)


def _across(panels: int, width: float) -> int:
    if width <= COLUMN:
        return 1 if panels <= 2 else 2
    return 2 if panels == 4 else min(panels, 3)


def _lines(axes: Axes, panel: Panel, own: dict[str, Appearance]) -> None:
    shade = 0.18 if len(panel.lines) <= FEW else 0.1
    for at, line in enumerate(panel.lines):
        look = own[line.label]
        axes.plot(line.episodes, line.band.estimate, label=line.label, **look.line(len(line.episodes), at))
        axes.fill_between(
            line.episodes, line.band.low, line.band.high, color=look.colour, alpha=shade, linewidth=0
        )
    axes.set_xlim(1, max(line.episodes[-1] for line in panel.lines))
    axes.set_ylim(bottom=min(0.0, axes.get_ylim()[0]))
    plain_numbers(axes.xaxis)
    plain_numbers(axes.yaxis)
