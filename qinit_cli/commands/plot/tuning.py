"""`qinit plot tuning`: how a method's parameters fared on its sources."""

from __future__ import annotations

import typer

from qinit_cli.commands.build import Reference, add_command
from qinit_cli.commands.option_groups import DISPLAY, READING, Display, Reading
from qinit_cli.commands.plot.picture import Picture, Usual, publish

USUAL = Usual("tuning", "text", "the method, the distribution and the default's return")


def add_to(plots: typer.Typer) -> None:
    """Adds the picture."""
    add_command(
        plots,
        "tuning",
        tuning,
        {"picture": USUAL.group, "reading": READING, "display": DISPLAY},
        references=(
            Reference("tuning", "What qinit tune chose: a path, a name in the store, or - for stdin."),
        ),
        help="Return on the sources minus that of the method by default, with 95 % intervals, over the parameter of most "
        "values; a second makes lines, others panels.",
    )


def tuning(tuning: str, picture: Picture, reading: Reading, display: Display) -> None:
    """Draws the picture and prints its path."""
    from qinit_cli.commands import references
    from qinit_cli.pictures import tuning as pictures

    file = USUAL.file(picture)
    found = references.one(tuning, reading.store, output=file.path)
    publish(pictures.drawn(found, title=picture.title, width=USUAL.inches(picture)), file, display)
