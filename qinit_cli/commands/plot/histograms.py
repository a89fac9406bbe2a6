"""`qinit plot histograms`: are the values of a state-action log-normal over source tasks?"""

from __future__ import annotations

from dataclasses import dataclass

import typer

from qinit_cli.commands.build import Reference, add_command
from qinit_cli.commands.option_groups import DISPLAY, IMPORTS, READING, Display, Group, Reading
from qinit_cli.commands.plot.picture import Picture, Usual, publish
from qinit_cli.fields import check, option

USUAL = Usual("histograms", "text", "the distribution, and how many tasks")


@dataclass(frozen=True)
class Binning:
    """Which states are shown."""

    state: list[str] | None = option(
        None,
        "A state by its coordinates, such as 0,0; may be given several times.",
        metavar="COORDINATES",
        default_text="from the family: the paper's three",
    )

    def __post_init__(self) -> None:
        check(self)


def add_to(plots: typer.Typer) -> None:
    """Adds the picture."""
    add_command(
        plots,
        "histograms",
        histograms,
        {"picture": USUAL.group, "binning": Group(Binning, "States"), "reading": READING, "display": DISPLAY},
        imports=IMPORTS,
        references=(Reference("sources", "Sources: a path, a name in the store, or - for stdin."),),
        help="Histograms of Q and ln Q over source tasks at some states, with the fitted log-normal and its quantiles; "
        "of the action whose mean over the tasks is largest.",
    )


def histograms(sources: str, picture: Picture, binning: Binning, reading: Reading, display: Display) -> None:
    """Draws the picture and prints its path."""
    from qinit_cli.commands import references
    from qinit_cli.pictures import histograms as pictures

    file = USUAL.file(picture)
    named = references.one(sources, reading.store, output=file.path)
    drawn = pictures.drawn(named, binning.state, title=picture.title, width=USUAL.inches(picture))
    publish(drawn, file, display)
