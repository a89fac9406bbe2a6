"""Values along one dimension of continuous states, as curves: a heatmap would have a single row."""

from __future__ import annotations

from typing import TYPE_CHECKING

from qinit_cli.plots import legend
from qinit_cli.plots.style import COLUMN, TEXT, folded, line_styles, plain_numbers

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from qinit_cli.plots.heatmaps import Layer
    from qinit_cli.plots.state_axes import Side

PANEL, HEAD = 2.3, 0.25  # inches


def profiles(layer: Layer, across: Side, title: str, width: float = TEXT) -> Figure:
    """A panel for each column of the layer, a line for each row, with a gap where it is unknown. Call it within `house_style`."""
    from matplotlib.figure import Figure
    from matplotlib.ticker import MaxNLocator

    rows, columns = (list(dict.fromkeys(names)) for names in zip(*layer.panels, strict=True))
    beside = min(len(columns), 1 if width <= COLUMN else 3)
    down = -(-len(columns) // beside)
    height = down * (PANEL + HEAD * (len(columns) > 1)) + legend.height(rows, width) + HEAD * bool(title)
    figure = Figure(figsize=(width, height))
    panels = figure.subplots(down, beside, sharex=True, sharey=True, squeeze=False)
    for axes in panels.flat[len(columns) :]:
        axes.set_visible(False)
    looks = dict(zip(rows, line_styles(len(rows)), strict=True))
    for axes, column in zip(panels.flat, columns, strict=False):
        for row in rows:
            if (row, column) in layer.panels:
                axes.plot(across.places, layer.panels[row, column].ravel(), label=row, **looks[row])
        if layer.logarithmic:
            axes.set_yscale("log")
        if len(columns) > 1:
            axes.set_title(folded(column, width / beside), fontsize=7, pad=3)
        axes.set_xlabel(across.label)
        axes.set_xlim(*across.ends)
        axes.xaxis.set_major_locator(MaxNLocator(5))
        plain_numbers(axes.xaxis)
        plain_numbers(axes.yaxis)
    for axes in panels[:, 0]:
        axes.set_ylabel(folded(layer.label, PANEL))
    legend.legend(figure, rows, width)
    if title:
        figure.suptitle(title)
    return figure
