"""`qinit plot curves`: learning curves of methods on the same targets."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import typer

from qinit_cli.commands.build import Reference, add_command
from qinit_cli.commands.option_groups import DISPLAY, READING, Display, Group, Reading
from qinit_cli.commands.plot.picture import Picture, Usual, publish
from qinit_cli.fields import check, option

USUAL = Usual("curves", "column", "the targets' distribution, or their family")


@dataclass(frozen=True)
class Curving:
    """What the curves show."""

    metric: Literal["return", "success", "steps"] = option(
        "return", "Discounted return, share of episodes that reach the goal, or min(steps, horizon)."
    )
    smooth: int = option(20, "Episodes averaged into each point, looking back.", low=1)
    by_kind: bool = option(
        False,
        "Initialisations and other methods in panels of their own, with zero, optimal and logqinit-median in both.",
    )

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
        help="Learning curves of methods, mean over source sets and targets with a 95 % band, a panel for each set of targets.",
    )


def curves(runs: list[str], picture: Picture, curving: Curving, reading: Reading, display: Display) -> None:
    """Draws the picture and prints its path; panels stand in the order of the runs."""
    from qinit_cli.commands import references
    from qinit_cli.comparison.runs import read_runs
    from qinit_cli.pictures import curves as pictures

    file = USUAL.file(picture)
    found = read_runs(references.many(runs, reading.store, output=file.path))
    drawn = pictures.drawn(
        found,
        curving.metric,
        curving.smooth,
        by_kind=curving.by_kind,
        title=picture.title,
        width=USUAL.inches(picture),
    )
    publish(drawn, file, display)
