"""States visited on the optimal paths: a map of counts for each distribution, and the outlines of all together; Figure 7."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from qinit_cli.figures.heatmaps import ANY_SHAPE, Side, ticks
from qinit_cli.figures.style import COLUMN, TEXT, VALUE_COLOURS, folded, line_styles, plain_numbers

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from qinit_cli.arrays import Flags, Floats, Integers

LARGEST, GAP, ABOVE, TICKS, BAR, KEY = 2.6, 0.12, 0.32, 0.5, 0.5, 0.17  # inches
OUTLINES = 1.5  # as wide as so many panels, where they stand beside them
WIDEST, THINNEST = 3.4, 0.9  # points: outlines that coincide stay visible beneath each other
PATHS_A_VISIT = 20  # within an outline a state is visited once in so many paths, or oftener
OUTLINES_TITLE = f"outlines of the states visited\nonce in {PATHS_A_VISIT} paths or oftener"
SCALE_LABEL = "visits, all tasks together"


@dataclass(frozen=True)
class Visits:
    """How often the paths of one distribution are in each state, and what stands above."""

    name: str
    words: str
    counts: Integers  # (upright, across)
    paths: int


def occupancy(
    shown: Sequence[Visits], upright: Side, across: Side, title: str, width: float = TEXT
) -> Figure:
    """Maps on one colour scale, the states that nobody visits white, and beside or beneath them the outlines.

    All axes end where the visited states do. Call it within `house_style`.
    """
    from matplotlib.colors import LogNorm
    from matplotlib.figure import Figure

    beside = width > COLUMN
    columns = min(len(shown), 2 if not beside or len(shown) in (2, 4) else 3)
    rows = -(-len(shown) // columns)
    several = len(shown) > 1
    visited = np.any([each.counts > 0 for each in shown], axis=0)
    limits = _limits(visited, upright, across)
    shape = _shape(visited, upright, across)
    units = columns + (OUTLINES if several and beside else 0)
    panel = min(LARGEST, (width - TICKS * (2 if several and beside else 1)) / units - GAP) * shape
    maps = rows * (panel + ABOVE) + TICKS + BAR
    beneath = several and not beside
    key = KEY * -(-len(shown) // (2 if beneath else 4)) if several else 0.0
    height = maps + (0.25 if title else 0) + key + (0.8 * width * shape if beneath else 0)
    figure = Figure(figsize=(width, height))
    if not several:
        parts = figure.add_gridspec(1, 1)
    elif beside:
        parts = figure.add_gridspec(1, 2, width_ratios=[columns, OUTLINES])
    else:
        parts = figure.add_gridspec(2, 1, height_ratios=[maps, 0.8 * width * shape])
    grid = parts[0].subgridspec(rows, columns)
    panels = [figure.add_subplot(grid[divmod(at, columns)]) for at in range(len(shown))]
    norm = LogNorm(1, max(2, *(int(each.counts.max()) for each in shown)))
    for at, (axes, each) in enumerate(zip(panels, shown, strict=True)):
        image = _map(axes, each, norm, (upright, across), limits)
        axes.set_title(folded(f"{each.name}\n{each.words}", panel / shape), fontsize=7, pad=3)
        leftmost, lowest = at % columns == 0, at + columns >= len(shown)
        axes.tick_params(labelleft=leftmost, labelbottom=lowest)
        axes.set(xlabel=across.label if lowest else "", ylabel=upright.label if leftmost else "")
        axes.set_box_aspect(shape)
    bar = figure.colorbar(image, ax=panels, location="bottom", shrink=0.8, aspect=40, pad=0.02)
    bar.minorticks_off()
    plain_numbers(bar.long_axis)
    bar.outline.set_linewidth(0.5)
    bar.set_label(SCALE_LABEL)
    if several:
        axes = figure.add_subplot(parts[1])
        _outlines(axes, shown, (upright, across), limits)
        axes.set_box_aspect(shape)
        axes.set(xlabel=across.label, ylabel=upright.label)
        axes.set_title(OUTLINES_TITLE, fontsize=7, pad=3)
        figure.legend(loc="outside lower center", ncols=2 if beneath else 4)
    if title:
        figure.suptitle(title)
    return figure


def _limits(visited: Flags, upright: Side, across: Side) -> tuple[tuple[float, float], tuple[float, float]]:
    """From where to where each axis goes: the visited states, and one more on either side where there is one."""
    found = []
    for side, other in ((upright, 1), (across, 0)):
        at = np.flatnonzero(visited.any(axis=other))
        low, high = (max(0, at[0] - 1), min(len(side.places) - 1, at[-1] + 1)) if at.size else (0, -1)
        ends = Side("", side.places[[low, high]]).places
        half = (side.ends[1] - side.ends[0]) / len(side.places) / 2
        found.append((float(ends[0] - half), float(ends[1] + half)))
    return found[0], found[1]


def _shape(visited: Flags, upright: Side, across: Side) -> float:
    """Height to width of a panel: that of the states shown where both axes count the same, else square."""
    if not (upright.downwards and across.downwards):
        return 1.0
    (top, bottom), (left, right) = _limits(visited, upright, across)
    return min(max((bottom - top) / (right - left), ANY_SHAPE[0]), ANY_SHAPE[1])


def _map(axes: Axes, each: Visits, norm: Any, sides: tuple[Side, Side], limits: Any) -> Any:
    upright, across = sides
    bottom, top = reversed(upright.ends) if upright.downwards else upright.ends
    image = axes.imshow(
        np.ma.masked_equal(each.counts, 0),
        cmap=VALUE_COLOURS,
        norm=norm,
        origin="upper" if upright.downwards else "lower",
        extent=(*across.ends, bottom, top),
        aspect="auto",
        interpolation="none",
    )
    _frame(axes, sides, limits)
    return image


def _frame(axes: Axes, sides: tuple[Side, Side], limits: Any) -> None:
    upright, across = sides
    vertical, horizontal = limits
    axes.set_xlim(*horizontal)
    axes.set_ylim(*(reversed(vertical) if upright.downwards else vertical))
    axes.spines[:].set_visible(True)
    axes.spines[:].set_linewidth(0.5)
    axes.tick_params(length=2, pad=2)
    ticks(axes.xaxis, across)
    ticks(axes.yaxis, upright)


def _outlines(axes: Axes, shown: Sequence[Visits], sides: tuple[Side, Side], limits: Any) -> None:
    """The edges around the states that are visited often, the first distribution's line the widest.

    Rare visits, one path's each, would make as many edges of their own.
    """
    from matplotlib.collections import LineCollection

    upright, across = sides
    for each, look, thick in zip(
        shown, line_styles(len(shown)), np.linspace(WIDEST, THINNEST, len(shown)), strict=True
    ):
        lines = LineCollection(
            list(edges(each.counts >= max(1.0, each.paths / PATHS_A_VISIT), upright, across)),
            colors=look["color"],
            linewidths=float(thick),
            label=each.name,
            capstyle="projecting",
        )
        axes.add_collection(lines)
    _frame(axes, sides, limits)


def edges(inside: Flags, upright: Side, across: Side) -> Floats:
    """Line segments (L, 2, 2) of x, y around the states `inside` (upright, across), of which none is between two of them."""
    ys, xs = (np.linspace(*side.ends, len(side.places) + 1) for side in (upright, across))
    padded = np.pad(inside, 1)
    rows, columns = np.nonzero(padded[1:, 1:-1] != padded[:-1, 1:-1])
    flat = np.stack([np.stack([xs[columns], ys[rows]], 1), np.stack([xs[columns + 1], ys[rows]], 1)], 1)
    rows, columns = np.nonzero(padded[1:-1, 1:] != padded[1:-1, :-1])
    steep = np.stack([np.stack([xs[columns], ys[rows]], 1), np.stack([xs[columns], ys[rows + 1]], 1)], 1)
    found: Floats = np.concatenate([flat, steep])
    return found
