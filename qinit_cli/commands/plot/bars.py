"""`qinit plot bars`: methods side by side, one group of bars for each set of targets."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import typer

from qinit_cli.commands.build import Reference, add_command
from qinit_cli.commands.option_groups import DISPLAY, READING, Display, Group, Reading
from qinit_cli.commands.plot.picture import Picture, Usual, publish
from qinit_cli.fields import check, option

USUAL = Usual("bars", "text", "none")


@dataclass(frozen=True)
class Barring:
    """What the bars show."""

    metric: Literal["return", "success", "steps"] = option(
        "return", "Discounted return, share of episodes that reach the goal, or min(steps, horizon)."
    )
    minus: str | None = option(
        None,
        "Draw differences to this method on the same targets.",
        metavar="METHOD",
        default_text="none: averages",
    )
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
        "bars",
        bars,
        {"picture": USUAL.group, "barring": Group(Barring, "Bars"), "reading": READING, "display": DISPLAY},
        references=(Reference("runs", "Runs: paths, names in the store, or - for stdin.", several=True),),
        help="Averages over all episodes by method, a group of bars for each set of targets, with 95 % intervals.",
    )


def bars(runs: list[str], picture: Picture, barring: Barring, reading: Reading, display: Display) -> None:
    """Draws the picture and prints its path; groups stand in the order of the runs."""
    from qinit_cli.commands import references
    from qinit_cli.comparison.runs import read_runs
    from qinit_cli.pictures import bars as pictures

    file = USUAL.file(picture)
    found = read_runs(references.many(runs, reading.store, output=file.path))
    drawn = pictures.drawn(
        found,
        barring.metric,
        barring.minus,
        by_kind=barring.by_kind,
        title=picture.title,
        width=USUAL.inches(picture),
    )
    publish(drawn, file, display)
