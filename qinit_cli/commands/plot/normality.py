"""`qinit plot normality`: where over the states ln Q, or the path length, is normal over the source tasks."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import typer

from qinit_cli.commands.build import Reference, add_command
from qinit_cli.commands.option_groups import DISPLAY, IMPORTS, READING, Display, Group, Reading
from qinit_cli.commands.plot.picture import Picture, Usual, publish
from qinit_cli.fields import check, option

USUAL = Usual("normality", "text", "the distribution, and what is tested")


@dataclass(frozen=True)
class MapOptions:
    """What the maps show."""

    of: Literal["values", "lengths"] = option("values", "The test of ln Q, or that of the path lengths.")
    action: Literal["greedy", "all"] = option(
        "greedy", "At the action of the largest mean of each state, or at every action."
    )

    def __post_init__(self) -> None:
        check(self)


def add_to(plots: typer.Typer) -> None:
    """Adds the picture."""
    add_command(
        plots,
        "normality",
        normality,
        {"picture": USUAL.group, "maps": Group(MapOptions, "Maps"), "reading": READING, "display": DISPLAY},
        imports=IMPORTS,
        references=(Reference("fit", "A fit: a path, a name in the store, or - for stdin."),),
        help="Maps of a fit's test of normality over the states: its statistic (W) and its raw p.",
    )


def normality(fit: str, picture: Picture, maps: MapOptions, reading: Reading, display: Display) -> None:
    """Draws the picture and prints its path."""
    from qinit_cli.commands import references
    from qinit_cli.pictures import normality as pictures

    file = USUAL.file(picture)
    named = references.one(fit, reading.store, output=file.path)
    drawn = pictures.drawn(named, maps.of, maps.action, title=picture.title, width=USUAL.inches(picture))
    publish(drawn, file, display)
