"""States visited on the optimal paths from the target start, over the tasks of each distribution; Figure 7.

A task's path is its own greedy one, replayed from its stored table: on the gridworld each step leads to the most likely next
cell, on Mountain Car the continuous state is followed with the task's own push, and its bin counted at every step. Start and
goal count too, so a path of H steps counts H + 1 times. Paths that do not arrive within the horizon have no place in the maps;
they are counted apart.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

from qinit_cli.errors import NotAllowed, UsageError
from qinit_cli.plots.drawn import Drawn
from qinit_cli.plots.names import listed, place
from qinit_cli.plots.plot import PLAIN, Frame, Plot, Takes
from qinit_cli.plots.state_axes import ANY_SHAPE, Side, closed_states, closed_words, draw_closed, sides, ticks
from qinit_cli.plots.style import COLUMN, TEXT, VALUE_COLOURS, folded, house_style, line_styles, plain_numbers
from qinit_store.wording import counted

if TYPE_CHECKING:
    from pathlib import Path

    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from qinit_cli.arrays import Flags, Floats, Integers, Tasks
    from qinit_cli.artefacts.settings import SourcesSettings
    from qinit_cli.environments import Family
    from qinit_cli.plots.distributions import Distribution

MOST = {COLUMN: 6, TEXT: 9}  # distributions whose maps and outlines can be told apart
LARGEST, GAP, ABOVE, TICKS, BAR, KEY = 2.6, 0.12, 0.32, 0.5, 0.5, 0.17  # inches
OUTLINES = 1.5  # as wide as so many panels, where they stand beside them
WIDEST, THINNEST = 3.4, 0.9  # points: outlines that coincide stay visible beneath each other
PATHS_A_VISIT = 20  # within an outline a state is visited once in so many paths, or oftener
OUTLINES_TITLE = f"outlines of the states visited\nonce in {PATHS_A_VISIT} paths or oftener"
SCALE_LABEL = "visits, all tasks together"


@dataclass(frozen=True)
class OccupancyPlot(Plot):
    """States visited on the greedy paths of all tasks from the target start: a map of counts for each
    distribution, and the outlines of all; paths that never arrive are counted apart.
    """

    name: ClassVar[str] = "occupancy"
    takes: ClassVar[Takes] = Takes(("sources",), "Sources", several=True)
    titled: ClassVar[str] = "the start of the paths"

    def drawn(self, paths: Sequence[Path], frame: Frame = PLAIN) -> Drawn:
        """A map a distribution in the order of the sources, and the outlines of all."""

        from qinit_cli.plots.distributions import distributions, learned_otherwise, named

        found = distributions(paths, ("q",), _visits)
        family = found[0].family
        if len({(one.family.name, one.family.shape) for one in found}) > 1:
            labels = ", ".join(dict.fromkeys(one.family.label for one in found))
            raise NotAllowed(f"maps of one picture share their state axes; those of {labels} differ")
        axes = sides(family.axes())
        if len(axes) != 2:
            raise NotAllowed(f"a map has two state axes, {family.name} has {len(axes)}")
        if len(found) > MOST[frame.width]:
            raise UsageError(f"{len(found)} distributions do not fit; draw at most {MOST[frame.width]}")
        names = named(found)
        shown = [_shown(name, one) for name, one in zip(names, found, strict=True)]
        starts = dict.fromkeys(place(one.family.shown_states()[0]) for one in found)
        own = f"{family.name}, states on the optimal paths from {listed(list(starts))}"
        with house_style():
            figure = occupancy(
                shown, axes[0], axes[1], own if frame.title is None else frame.title, frame.width
            )
        return Drawn(figure, frame.title or own, _alt(shown, own), tuple(learned_otherwise(found, names)))


def _visits(family: Family, settings: SourcesSettings, tasks: Tasks, block: dict[str, Any]) -> Any:
    """Visits of each state (S,) over a block's paths, how many arrive, and how many do not."""
    q = block["q"].reshape(len(tasks), -1, len(family.actions))
    visits = family.visits(tasks, q, settings.learning.horizon)
    arrives = int(visits.any(axis=1).sum())
    return visits.sum(axis=0), arrives, len(tasks) - arrives


def _shown(name: str, one: Distribution) -> Visits:
    import numpy as np

    counts = np.sum([visits for visits, _, _ in one.found], axis=0).reshape(one.family.shape)
    arrived, never = (sum(part[at] for part in one.found) for at in (1, 2))
    words = f"{arrived} path{'s' * (arrived != 1)}" + (f", {never} fail" if never else "")
    return Visits(name, words, counts, arrived, closed_states(one.family))


def _alt(shown: list[Visits], own: str) -> str:
    """How many states each distribution's paths visit, and how often."""
    parts = [
        f"{each.name.replace(chr(10), ', ')}: {each.words}, {counted(int((each.counts > 0).sum()), 'state')} visited, "
        f"{counted(int(each.counts.sum()), 'visit')}, at most {int(each.counts.max())} to one state"
        for each in shown
    ]
    outlines = ", and the outlines of all" if len(shown) > 1 else ""
    return f"Maps of visits{outlines}, {own}; paths that fail to arrive are not in them. {listed(parts)}."


@dataclass(frozen=True)
class Visits:
    """How often the paths of one distribution are in each state, and what stands above."""

    name: str
    words: str
    counts: Integers  # (upright, across)
    paths: int
    closed: Mapping[str, Flags] = field(default_factory=dict)  # (upright, across) of what stands there


def occupancy(
    shown: Sequence[Visits], upright: Side, across: Side, title: str, width: float = TEXT
) -> Figure:
    """Maps on one colour scale, the states that nobody visits white, and beside or beneath them the outlines.

    All axes end where the visited states do. Call it within `house_style`.
    """
    import numpy as np
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
    bar.set_label(SCALE_LABEL + closed_words(kind for each in shown for kind in each.closed))
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
    import numpy as np

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
    import numpy as np

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
    draw_closed(axes, each.closed, sides)
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
    import numpy as np
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
    import numpy as np

    ys, xs = (np.linspace(*side.ends, len(side.places) + 1) for side in (upright, across))
    padded = np.pad(inside, 1)
    rows, columns = np.nonzero(padded[1:, 1:-1] != padded[:-1, 1:-1])
    flat = np.stack([np.stack([xs[columns], ys[rows]], 1), np.stack([xs[columns + 1], ys[rows]], 1)], 1)
    rows, columns = np.nonzero(padded[1:-1, 1:] != padded[1:-1, :-1])
    steep = np.stack([np.stack([xs[columns], ys[rows]], 1), np.stack([xs[columns], ys[rows + 1]], 1)], 1)
    found: Floats = np.concatenate([flat, steep])
    return found
