"""`qinit plot car`: the car, the hill and where the noise acts."""

from __future__ import annotations

import typer

from qinit_cli.commands.build import Reference, add_command
from qinit_cli.commands.option_groups import DISPLAY, READING, Display, Reading
from qinit_cli.commands.plot.picture import Picture, Usual, publish

USUAL = Usual("car", "column", "the distribution")


def add_to(plots: typer.Typer) -> None:
    """Adds the picture."""
    add_command(
        plots,
        "car",
        car,
        {"picture": USUAL.group, "reading": READING, "display": DISPLAY},
        references=(Reference("sources", "Sources of mountain-car: a path, a name in the store, or -."),),
        help="Mountain Car in profile as these sources have it: the hill, the start, the flag, where the noise acts, and its "
        "distribution.",
    )


def car(sources: str, picture: Picture, reading: Reading, display: Display) -> None:
    """Draws the picture and prints its path."""
    from qinit_cli.commands import references
    from qinit_cli.pictures import car as pictures

    file = USUAL.file(picture)
    named = references.one(sources, reading.store, output=file.path)
    publish(pictures.drawn(named, title=picture.title, width=USUAL.inches(picture)), file, display)
