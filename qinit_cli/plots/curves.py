"""Learning curves of methods on the same targets, with 95 % bands; Figures 6, 9, A2 and A3."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import TYPE_CHECKING, ClassVar, Literal

from qinit_cli.errors import NotAllowed, UsageError
from qinit_cli.options import option
from qinit_cli.plots import legend
from qinit_cli.plots.drawn import Drawn
from qinit_cli.plots.looks import Appearance, appearances
from qinit_cli.plots.names import METRIC_LABELS, families, group_names, listed, marked, number
from qinit_cli.plots.order import KINDS, of_kind, ordered
from qinit_cli.plots.plot import PLAIN, Frame, RunsPlot, Takes, Width
from qinit_cli.plots.reported import Contents, Planned
from qinit_cli.plots.style import COLUMN, TALLEST, folded, house_style, plain_numbers
from qinit_store.wording import noun

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from qinit_cli.analysis.intervals import Interval
    from qinit_cli.arrays import Floats, Integers
    from qinit_cli.comparison.runs import ComparedRun
    from qinit_cli.comparison.scores import Metric
    from qinit_cli.comparison.source_sets import Entry, RunGroup

POINTS = 200  # along a curve: more than a column's width shows
BAND_RESAMPLES = 2_000  # enough for the edge of a shaded band
ALONE, HEIGHT, LEAST = 2.4, 1.75, 1.1  # inches: one panel, one of several, one of many
TITLED, LINE = (
    0.4,
    0.14,
)  # inches beside a panel's axes: its title and its numbers, a further line of the title
FEW = 6  # lines, whose bands may be darker
XLABEL = "episode"

CAPTION = "Each point is the mean of the last 20 episodes, over targets and source sets."


@dataclass(frozen=True)
class CurvesPlot(RunsPlot):
    """Learning curves of methods, mean over source sets and targets with a 95 % band, a panel for each set of
    targets.
    """

    name: ClassVar[str] = "curves"
    takes: ClassVar[Takes] = Takes(("run",), "Runs", several=True)
    titled: ClassVar[str] = "the targets' distribution, or their family"
    wide: ClassVar[Width] = "column"
    heading: ClassVar[str] = "Curves"

    metric: Literal["return", "success", "steps"] = option(
        "return", "Discounted return, share of episodes that reach the goal, or min(steps, horizon)."
    )
    smooth: int = option(20, "Episodes averaged into each point, looking back.", low=1)
    by_kind: bool = option(
        False,
        "Initialisations and other methods in panels of their own, with zero, optimal and logqinit-median in both.",
    )

    def of_runs(self, runs: Sequence[ComparedRun], frame: Frame = PLAIN) -> Drawn:
        """A panel for each set of targets, in the order of the runs.

        Runs that met only the first of the others' targets are drawn beside them and labelled so, as `optimal` where its
        tables are costly.
        """
        from qinit_cli.comparison.source_sets import grouped

        groups = grouped(runs)
        wholes = [group for group in groups if not any(_met_the_first(group, other) for other in groups)]
        names = group_names(wholes)
        panels = [
            Panel(name, _band_words(whole), _lines(whole, groups, self.metric, self.smooth))
            for name, whole in zip(names, wholes, strict=True)
        ]
        own, label = families(wholes), METRIC_LABELS[self.metric]
        if self.smooth > 1:
            label = f"{label},\nmean of the last {self.smooth} episodes"
        with house_style():
            figure = curves(
                list(_apart(panels)) if self.by_kind else panels,
                label,
                own if frame.title is None else frame.title,
                frame.width,
                across=len(KINDS) if self.by_kind else None,
            )
        return Drawn(figure, frame.title or f"Learning curves, {own}", _alt(panels, label.replace("\n", " ")))

    @classmethod
    def in_report(cls, contents: Contents) -> Iterator[Planned]:
        """A picture for each set of targets."""
        from qinit_cli.comparison.distinctions import joined
        from qinit_cli.comparison.source_sets import grouped, told_of_groups

        groups = grouped(contents.runs)
        for group, words in zip(groups, told_of_groups(groups), strict=True):
            same = [run for entry in group.entries for run in entry.runs]
            yield Planned(CAPTION, joined(words), partial(cls().of_runs, same, Frame(width=COLUMN)))


def _apart(panels: Sequence[Panel]) -> Iterator[Panel]:
    """Each panel as one of either kind; NotAllowed where there are no curves of one."""
    for panel in panels:
        for kind in KINDS:
            lines = [line for line in panel.lines if of_kind(line, kind)]
            if not lines:
                raise NotAllowed(f"{panel.title} has no runs of {kind}; draw these in one panel")
            yield replace(panel, title=f"{panel.title}, {kind}", lines=lines)


def _alt(panels: Sequence[Panel], label: str) -> str:
    """Where each curve begins and ends."""
    parts = []
    for panel in panels:
        ends = [
            f"{line.label} {number(line.band.estimate[0])} to {number(line.band.estimate[-1])}"
            for line in panel.lines
        ]
        parts.append(f"{panel.title.replace(chr(10), ', ')} (band {panel.band}): {', '.join(ends)}")
    return f"Learning curves, {label}, first to last point of each method. {listed(parts)}."


def _band_words(group: RunGroup) -> str:
    targets = len(group.any_run.steps)
    sets = "" if group.sets == 1 else f"{group.sets} source sets, "
    return f"95 %, {sets}{targets} {noun(targets, 'target')}{'' if group.shared else ' of each'}"


def _met_the_first(group: RunGroup, of: RunGroup) -> bool:
    """Whether the group's targets are the first of those of another."""
    few, many = group.any_run, of.any_run
    count = len(few.steps)
    return count < len(many.steps) and many.first(count).target_digest == few.target_digest


def _lines(whole: RunGroup, groups: Sequence[RunGroup], metric: Metric, smooth: int) -> list[Curve]:
    """The group's curves, and those of groups that met the first of its targets."""
    lines = [_curve(entry, whole, metric, smooth) for entry in whole.entries]
    for group in groups:
        if _met_the_first(group, whole):
            count = len(group.any_run.steps)
            few = f", first {count} targets" if count > 1 else ", first target"
            lines += [_curve(entry, group, metric, smooth, few) for entry in group.entries]
    return ordered(lines)


def _curve(entry: Entry, group: RunGroup, metric: Metric, smooth: int, addition: str = "") -> Curve:
    import numpy as np

    from qinit_cli.analysis import returns
    from qinit_cli.comparison.scores import curve

    curves = [returns.smoothed(curve(run, metric), smooth) for run in entry.runs]
    shown = np.unique(np.linspace(0, curves[0].shape[1] - 1, POINTS).astype(np.int64))
    values = np.stack([each[:, shown] for each in curves])
    imported = entry.runs[0].settings.imported
    label = marked(entry.label, entry.method, imported=imported, blended=entry.blended) + addition
    return Curve(label, shown + 1, _band(values, group), entry.method, entry.plus)


def _band(values: Floats, group: RunGroup) -> Interval:
    """The mean of values (R, T, P) over source sets and targets at each point, resampled as `qinit compare` does."""
    from qinit_cli.analysis.intervals import Resampling
    from qinit_cli.seeding import Stream, generator

    rng = generator(group.any_run.settings.seed, Stream.BOOTSTRAP, 0)
    return Resampling(group.shared, BAND_RESAMPLES).interval(values, rng)


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
        _draw_lines(axes, panel, own)
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


def _draw_lines(axes: Axes, panel: Panel, own: dict[str, Appearance]) -> None:
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
