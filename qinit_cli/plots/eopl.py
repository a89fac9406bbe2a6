"""How long the paths from the target start are, over the tasks of each distribution; Figure 8.

Each task's path is its own greedy one: the length that its table has for its best action there. It is that of the table's
state, on Mountain Car of the bin's centre; of tiles it is that of the first probe, where targets start.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

from qinit_cli.errors import NotAllowed, UsageError
from qinit_cli.plots.drawn import Drawn
from qinit_cli.plots.names import listed, place
from qinit_cli.plots.plot import PLAIN, Frame, Plot, Takes
from qinit_cli.plots.reported import Contents, Planned, alike, states
from qinit_cli.plots.state_axes import shown_states
from qinit_cli.plots.style import COLUMN, TEXT, folded, house_style, line_styles, plain_numbers

if TYPE_CHECKING:
    from pathlib import Path

    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from qinit_cli.analysis.length_sample import LengthSample
    from qinit_cli.arrays import Floats, Tasks
    from qinit_cli.artefacts.settings import SourcesSettings
    from qinit_cli.environments import Family
    from qinit_cli.plots.distributions import Distribution

MOST = 7  # distributions that are legible below each other
BAR_COLOUR = "#b3cde3"
FLOOR_COLOUR = "#bbbbbb"
FIT_COLOUR = "black"  # unlike every line of the densities but the seventh
FIT_LABEL = "normal of the same mean and deviation; W and p are of Shapiro-Wilk against its rounding"
LENGTH_LABEL = "path length (steps)"
MOST_BINS = 50
POINTS = 400  # along a curve
ROW, LEAST, ABOVE, BENEATH = 1.05, 2.6, 0.25, 0.75  # inches
FIT_ROOM = 1.3  # of the tallest bar: how far up the normal is shown

CAPTION = (
    "Each task's greedy path from the target start: its length, with the normal of the same mean and "
    "deviation, and smooth densities of all distributions."
)  # in a report


@dataclass(frozen=True)
class EoplPlot(Plot):
    """Path lengths at the target start: histograms of each distribution, all densities together; sources whose
    tasks are all alike (such as --noise 0) are the noise floor.
    """

    name: ClassVar[str] = "eopl"
    takes: ClassVar[Takes] = Takes(("sources",), "Sources", several=True)
    titled: ClassVar[str] = "the state"

    def drawn(self, paths: Sequence[Path], frame: Frame = PLAIN) -> Drawn:
        """A histogram a distribution in the order of the sources, those whose tasks are all alike last: the floor."""

        from qinit_cli.plots.distributions import distributions, learned_otherwise, named

        found = distributions(paths, ("q", "eopl"), _at_start)
        if len({(one.family.name, one.family.shape) for one in found}) > 1:
            labels = ", ".join(dict.fromkeys(one.family.label for one in found))
            raise NotAllowed(f"path lengths of one picture start in the same state; those of {labels} do not")
        if len(found) > MOST:
            raise UsageError(f"{len(found)} distributions do not fit below each other; draw at most {MOST}")
        names = named(found)
        shown = sorted(
            (_shown(name, one) for name, one in zip(names, found, strict=True)),
            key=lambda each: each.floor,
        )
        starts = dict.fromkeys(place(shown_states(one.family)[0]) for one in found)
        own = f"{found[0].family.name}, expected optimal path lengths at {listed(list(starts))}"
        with house_style():
            figure = eopl(shown, own if frame.title is None else frame.title, frame.width)
        parts = [f"{each.name.replace(chr(10), ', ')}: {each.words.replace(chr(10), ', ')}" for each in shown]
        alt = f"Histograms and densities of path lengths over source tasks, {own}. {listed(parts)}."
        return Drawn(figure, frame.title or own, alt, tuple(learned_otherwise(found, names)))

    @classmethod
    def in_report(cls, contents: Contents) -> Iterator[Planned]:
        """A picture of all sources of the same states whose path lengths are known."""
        learned = {
            path: told for path, told in contents.kinds["sources"].items() if not told["settings"].imported
        }
        for same in alike(learned, states).values():
            yield Planned(CAPTION, "", partial(cls().drawn, same))


def _at_start(family: Family, settings: SourcesSettings, tasks: Tasks, block: dict[str, Any]) -> Any:
    """Lengths (B,) of the greedy paths from the target start."""
    import numpy as np

    start = (slice(None), *_place(family))
    greedy = block["q"][start].argmax(axis=-1)
    return np.take_along_axis(block["eopl"][start], greedy[:, None], axis=-1)[:, 0]


def _place(family: Family) -> tuple[int, ...]:
    """The target start on the state axes."""
    import numpy as np

    return tuple(
        int(np.abs(axis.values - coordinate).argmin())
        for axis, coordinate in zip(family.axes(), family.shown_states()[0], strict=True)
    )


def _shown(name: str, one: Distribution) -> DrawnLengths:
    """The lengths as they are drawn."""
    import numpy as np

    from qinit_cli.analysis.length_sample import LengthSample
    from qinit_cli.analysis.rounded_normal import RESAMPLES
    from qinit_cli.seeding import Stream, generator

    sample = LengthSample.of(np.concatenate(one.found))
    statistic, p = sample.rounded_normal(generator(one.settings.seed, Stream.BOOTSTRAP, 0))
    sets = f" in {one.sets} source sets" if one.sets > 1 else ""
    counted = f"n = {sample.lengths.size}{sets}" + (f", {sample.never} never arrive" if sample.never else "")
    moments = f"\nmean {sample.mean:.1f}, sd {sample.deviation:.1f}, " if sample.lengths.size else ", "
    least = 1 / (RESAMPLES + 1)
    verdict = f"W = {statistic:.3f}, p {'≤' if p <= least else '='} {p:.2g}"
    words = counted + moments + ("not testable" if np.isnan(p) else verdict)
    floor = one.alike
    return DrawnLengths(f"{name}, noise floor" if floor else name, words, sample, floor)


@dataclass(frozen=True)
class DrawnLengths:
    """One distribution's lengths, and what is said of them."""

    name: str
    words: str
    sample: LengthSample
    floor: bool  # all tasks are alike: what spreads is learning


def eopl(shown: Sequence[DrawnLengths], title: str, width: float = TEXT) -> Figure:
    """Histograms below each other, densities beside or beneath them. Call it within `house_style`."""
    import numpy as np
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
    import numpy as np

    known = np.concatenate([np.empty(0), *samples])
    low, high = (float(known.min()), float(known.max())) if known.size else (0.0, 1.0)
    step = max(1.0, np.ceil((high - low + 1) / MOST_BINS))
    edges: Floats = np.arange(low - 0.5 - step, high + 0.5 + 2 * step, step)
    return edges


def _histogram(axes: Axes, each: DrawnLengths, edges: Floats, room: float) -> None:
    import numpy as np
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
