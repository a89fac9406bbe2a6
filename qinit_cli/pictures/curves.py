"""Learning curves of methods on the same targets, with 95 % bands; Figures 6, 9, A2 and A3."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from qinit_cli.errors import NotAllowed
from qinit_cli.figures.style import COLUMN
from qinit_cli.pictures.names import METRIC_LABELS, listed, marked

if TYPE_CHECKING:
    from qinit_cli.analysis.intervals import Interval
    from qinit_cli.arrays import Floats
    from qinit_cli.figures.curves import Curve
    from qinit_cli.figures.drawn import Drawn
    from qinit_cli.runs import Run
    from qinit_cli.stages.scores import Metric
    from qinit_cli.stages.source_sets import Entry, Group

POINTS = 200  # along a curve: more than a column's width shows
BAND_RESAMPLES = 2_000  # enough for the edge of a shaded band
SMOOTH = 20  # episodes


def drawn(
    runs: Sequence[Run],
    metric: Metric = "return",
    smooth: int = SMOOTH,
    *,
    title: str | None = None,
    width: float = COLUMN,
) -> Drawn:
    """The metric over episodes, each point the mean of the last `smooth`, over source sets and targets.

    Runs that met only the first of the others' targets are drawn beside them and labelled so, as `optimal` where its tables
    are costly.
    """
    from qinit_cli.environments import label_of
    from qinit_cli.figures import curves as drawing
    from qinit_cli.figures.drawn import Drawn
    from qinit_cli.figures.style import house_style
    from qinit_cli.stages.source_sets import grouped

    group, *others = sorted(grouped(runs), key=lambda group: -len(group.any_run.steps))
    if not all(_met_the_first(other.any_run, group.any_run) for other in others):
        raise NotAllowed("these runs did not meet the same targets; draw those that did, one picture each")
    lines = [_curve(entry, group, metric, smooth) for entry in group.entries]
    for other in others:
        few = f", first {len(other.any_run.steps)} targets"
        lines += [_curve(entry, other, metric, smooth, few) for entry in other.entries]
    own = label_of(group.any_run.spec)
    with house_style():
        figure = drawing.curves(
            lines, METRIC_LABELS[metric], own if title is None else title, _band_words(group), width
        )
    alt = f"Learning curves, {METRIC_LABELS[metric]}, first and last point: {own}: {listed([_ends(line) for line in lines])}."
    return Drawn(figure, title or f"Learning curves, {own}", alt)


def _ends(line: Curve) -> str:
    return f"{line.label} {line.band.estimate[0]:.3g} to {line.band.estimate[-1]:.3g}"


def _band_words(group: Group) -> str:
    targets = len(group.any_run.steps)
    sets = "" if group.sets == 1 else f"{group.sets} source sets, "
    return f"95 %, {sets}{targets} targets{'' if group.shared else ' of each'}"


def _met_the_first(run: Run, of: Run) -> bool:
    """Whether the run's targets are the first of those of another."""
    count = len(run.steps)
    return count < len(of.steps) and of.first(count).target_digest == run.target_digest


def _curve(entry: Entry, group: Group, metric: Metric, smooth: int, addition: str = "") -> Curve:
    import numpy as np

    from qinit_cli.analysis import returns
    from qinit_cli.figures.curves import Curve
    from qinit_cli.stages.scores import curve

    curves = [returns.smoothed(curve(run, metric), smooth) for run in entry.runs]
    shown = np.unique(np.linspace(0, curves[0].shape[1] - 1, POINTS).astype(np.int64))
    values = np.stack([each[:, shown] for each in curves])
    return Curve(marked(entry.label, entry.method) + addition, shown + 1, _band(values, group))


def _band(values: Floats, group: Group) -> Interval:
    """The mean of values (R, T, P) over source sets and targets at each point, resampled as `qinit compare` does."""
    from qinit_cli.analysis import intervals
    from qinit_cli.seeding import Stream, generator

    chance = generator(int(group.any_run.spec["seed"]), Stream.BOOTSTRAP, 0)
    if len(values) == 1:
        return intervals.over_targets(values[0], chance, BAND_RESAMPLES)
    over = intervals.pigeonhole if group.shared else intervals.nested
    return over(values, chance, BAND_RESAMPLES)
