"""`qinit plot posterior`: weights of the sources while targets are learned."""

from __future__ import annotations

import typer

from qinit_cli.commands.build import Reference, add_command
from qinit_cli.commands.option_groups import DISPLAY, READING, Display, Reading
from qinit_cli.commands.plot.picture import Picture, Usual, publish

USUAL = Usual("posterior", "text", "what is shown")


def add_to(plots: typer.Typer) -> None:
    """Adds the picture."""
    add_command(
        plots,
        "posterior",
        posterior,
        {"picture": USUAL.group, "reading": READING, "display": DISPLAY},
        references=(
            Reference("runs", "Runs of posterior: paths, names in the store, or - for stdin.", several=True),
        ),
        help="Weights of the source tables while targets are learned: the effective number of sources and the weight of "
        "the heaviest, over episodes.",
    )


def posterior(runs: list[str], picture: Picture, reading: Reading, display: Display) -> None:
    """Draws the picture and prints its path; a line for each method and distribution in the order of their runs."""
    from qinit_cli.commands import references
    from qinit_cli.pictures import posterior as pictures

    file = USUAL.file(picture)
    paths = references.many(runs, reading.store, output=file.path)
    publish(pictures.drawn(paths, title=picture.title, width=USUAL.inches(picture)), file, display)
