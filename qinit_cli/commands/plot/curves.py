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
    from qinit_cli.figures.curves import Curve
    from qinit_cli.runs import Run

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
        help="Learning curves of runs that met the same targets, mean and 95 % band.",
    )


def curves(runs: list[str], picture: Picture, curving: Curving, reading: Reading, display: Display) -> None:
    """Draws the picture and prints its path."""
    from qinit_cli.commands.compare import read_runs
    from qinit_cli.environments import family_of
    from qinit_cli.figures import curves as drawing
    from qinit_cli.figures.style import house_style
    from qinit_cli.stages.compare import labels

    path = USUAL.path(picture)
    found = read_runs(runs, reading.store)
    if len({run.target_digest for run in found}) > 1:
        raise NotAllowed("these runs did not meet the same targets; draw those that did, one picture each")
    lines = [
        _curve(run, marked(label, run.method), curving)
        for run, label in zip(found, labels(found), strict=True)
    ]
    title = family_of(found[0].spec).label if picture.title is None else picture.title
    with house_style():
        figure = drawing.curves(
            lines,
            METRIC_LABELS[curving.metric],
            title,
            f"95 %, {len(found[0].steps)} targets",
            USUAL.inches(picture),
        )
        publish(figure, path)


def _curve(run: Run, label: str, curving: Curving) -> Curve:
    import numpy as np

    from qinit_cli.analysis import intervals, returns
    from qinit_cli.figures.curves import Curve
    from qinit_cli.seeding import Stream, generator
    from qinit_cli.stages.compare import curve

    values = returns.smoothed(curve(run, curving.metric), curving.smooth)
    shown = np.unique(np.linspace(0, values.shape[1] - 1, POINTS).astype(np.int64))
    chance = generator(int(run.spec["seed"]), Stream.BOOTSTRAP, 0)
    return Curve(label, shown + 1, intervals.over_targets(values[:, shown], chance, BAND_RESAMPLES))
