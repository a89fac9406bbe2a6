"""`qinit plot curves`: learning curves of methods on the same targets."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

import typer

from qinit_cli.commands.build import Group, Reference, add_command
from qinit_cli.commands.groups import DISPLAY, READING, Display, Reading
from qinit_cli.commands.plot.picture import METRIC_LABELS, Picture, Usual, marked, publish
from qinit_cli.errors import NotAllowed
from qinit_cli.fields import check, option

if TYPE_CHECKING:
    from qinit_cli.analysis.intervals import Interval
    from qinit_cli.arrays import Floats
    from qinit_cli.figures.curves import Curve
    from qinit_cli.stages.source_sets import Entry
    from qinit_cli.stages.source_sets import Group as SharedTargets

USUAL = Usual("curves", "column", "the targets' distribution")
POINTS = 200  # along a curve: more than a column's width shows
BAND_RESAMPLES = 2_000  # enough for the edge of a shaded band


@dataclass(frozen=True)
class Curving:
    """What the curves show."""

    metric: Literal["return", "success", "steps"] = option(
        "return", "Discounted return, share of episodes that reach the goal, or min(steps, horizon)."
    )
    smooth: int = option(20, "Episodes averaged into each point, looking back.", low=1)

    def __post_init__(self) -> None:
        check(self)


def add_to(plots: typer.Typer) -> None:
    """Adds the picture."""
    add_command(
        plots,
        "curves",
        curves,
        {
            "picture": USUAL.group,
            "curving": Group(Curving, "Curves"),
            "reading": READING,
            "display": DISPLAY,
        },
        references=(Reference("runs", "Runs: paths, names in the store, or - for stdin.", several=True),),
        help="Learning curves of methods that met the same targets, mean over source sets and targets with a 95 % band.",
    )


def curves(runs: list[str], picture: Picture, curving: Curving, reading: Reading, display: Display) -> None:
    """Draws the picture and prints its path."""
    from qinit_cli.commands.compare import read_runs
    from qinit_cli.environments import family_of
    from qinit_cli.figures import curves as drawing
    from qinit_cli.figures.style import house_style
    from qinit_cli.stages.source_sets import grouped

    path = USUAL.path(picture)
    groups = grouped(read_runs(runs, reading.store))
    if len(groups) > 1:
        raise NotAllowed("these runs did not meet the same targets; draw those that did, one picture each")
    [group] = groups
    lines = [_curve(entry, group, curving) for entry in group.entries]
    title = family_of(group.any_run.spec).label if picture.title is None else picture.title
    targets = len(group.any_run.steps)
    sets = "" if group.sets == 1 else f"{group.sets} source sets, "
    with house_style():
        figure = drawing.curves(
            lines,
            METRIC_LABELS[curving.metric],
            title,
            f"95 %, {sets}{targets} targets{'' if group.shared else ' of each'}",
            USUAL.inches(picture),
        )
        publish(figure, path)


def _curve(entry: Entry, group: SharedTargets, curving: Curving) -> Curve:
    import numpy as np

    from qinit_cli.analysis import returns
    from qinit_cli.figures.curves import Curve
    from qinit_cli.stages.compare import curve

    smooth = [returns.smoothed(curve(run, curving.metric), curving.smooth) for run in entry.runs]
    shown = np.unique(np.linspace(0, smooth[0].shape[1] - 1, POINTS).astype(np.int64))
    values = np.stack([each[:, shown] for each in smooth])
    return Curve(marked(entry.label, entry.method), shown + 1, _band(values, group))


def _band(values: Floats, group: SharedTargets) -> Interval:
    """The mean of values (R, T, P) over source sets and targets at each point, resampled as `qinit compare` does."""
    from qinit_cli.analysis import intervals
    from qinit_cli.seeding import Stream, generator

    chance = generator(int(group.any_run.spec["seed"]), Stream.BOOTSTRAP, 0)
    if len(values) == 1:
        return intervals.over_targets(values[0], chance, BAND_RESAMPLES)
    over = intervals.pigeonhole if group.shared else intervals.nested
    return over(values, chance, BAND_RESAMPLES)
