"""Learning curves of methods on the same targets, with 95 % bands; Figures 6, 9, A2 and A3."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from qinit_cli.errors import NotAllowed
from qinit_cli.figures.style import COLUMN
from qinit_cli.pictures.names import METRIC_LABELS, listed, marked, number
from qinit_cli.pictures.order import KINDS, of_kind, ordered
from qinit_store.wording import noun

if TYPE_CHECKING:
    from qinit_cli.analysis.intervals import Interval
    from qinit_cli.arrays import Floats
    from qinit_cli.comparison.runs import ComparedRun
    from qinit_cli.comparison.scores import Metric
    from qinit_cli.comparison.source_sets import Entry, RunGroup
    from qinit_cli.figures.curves import Curve, Panel
    from qinit_cli.figures.drawn import Drawn

POINTS = 200  # along a curve: more than a column's width shows
BAND_RESAMPLES = 2_000  # enough for the edge of a shaded band
SMOOTH = 20  # episodes


def drawn(
    runs: Sequence[ComparedRun],
    metric: Metric = "return",
    smooth: int = SMOOTH,
    *,
    by_kind: bool = False,
    title: str | None = None,
    width: float = COLUMN,
) -> Drawn:
    """The metric over episodes, each point the mean of the last `smooth`, over source sets and targets.

    A panel for each set of targets, in the order of the runs; `by_kind` two, initialisations and other methods, with
    the reference methods in both.
    Runs that met only the first of the others' targets are drawn beside them and labelled so, as `optimal` where its tables
    are costly.
    """
    from qinit_cli.comparison.source_sets import grouped
    from qinit_cli.figures import curves as drawing
    from qinit_cli.figures.drawn import Drawn
    from qinit_cli.figures.style import house_style
    from qinit_cli.pictures.groups import families, group_names

    groups = grouped(runs)
    wholes = [group for group in groups if not any(_met_the_first(group, other) for other in groups)]
    names = group_names(wholes)
    panels = [
        drawing.Panel(name, _band_words(whole), _lines(whole, groups, metric, smooth))
        for name, whole in zip(names, wholes, strict=True)
    ]
    own, label = families(wholes), METRIC_LABELS[metric]
    if smooth > 1:
        label = f"{label},\nmean of the last {smooth} episodes"
    with house_style():
        figure = drawing.curves(
            list(_apart(panels)) if by_kind else panels,
            label,
            own if title is None else title,
            width,
            across=len(KINDS) if by_kind else None,
        )
    return Drawn(figure, title or f"Learning curves, {own}", _alt(panels, label.replace("\n", " ")))


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
    from qinit_cli.analysis import returns
    from qinit_cli.comparison.scores import curve
    from qinit_cli.figures.curves import Curve

    curves = [returns.smoothed(curve(run, metric), smooth) for run in entry.runs]
    shown = np.unique(np.linspace(0, curves[0].shape[1] - 1, POINTS).astype(np.int64))
    values = np.stack([each[:, shown] for each in curves])
    label = marked(entry.label, entry.method) + addition
    return Curve(label, shown + 1, _band(values, group), entry.method, entry.plus)


def _band(values: Floats, group: RunGroup) -> Interval:
    """The mean of values (R, T, P) over source sets and targets at each point, resampled as `qinit compare` does."""
    from qinit_cli.analysis.intervals import Resampling
    from qinit_cli.seeding import Stream, generator

    rng = generator(int(group.any_run.spec["seed"]), Stream.BOOTSTRAP, 0)
    return Resampling(group.shared, BAND_RESAMPLES).interval(values, rng)
