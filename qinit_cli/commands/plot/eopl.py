"""`qinit plot eopl`: how long the paths from the target start are, over the tasks of each distribution."""

from __future__ import annotations

import typer

from qinit_cli.commands.build import Reference, add_command
from qinit_cli.commands.option_groups import DISPLAY, IMPORTS, READING, Display, Reading
from qinit_cli.commands.plot.picture import Picture, Usual, publish

USUAL = Usual("eopl", "text", "the state")


def add_to(plots: typer.Typer) -> None:
    """Adds the picture."""
    add_command(
        plots,
        "eopl",
        eopl,
        {"picture": USUAL.group, "reading": READING, "display": DISPLAY},
        imports=IMPORTS,
        references=(
            Reference("sources", "Sources: paths, names in the store, or - for stdin.", several=True),
        ),
        help="Path lengths at the target start: histograms of each distribution, all densities together; sources whose "
        "tasks are all alike (such as --noise 0) are the noise floor.",
    )


def eopl(sources: list[str], picture: Picture, reading: Reading, display: Display) -> None:
    """Draws the picture and prints its path; distributions in the order of their sources, the noise floor last."""
    from qinit_cli.commands import references
    from qinit_cli.pictures import eopl as pictures

    file = USUAL.file(picture)
    paths = references.many(sources, reading.store, output=file.path)
    publish(pictures.drawn(paths, title=picture.title, width=USUAL.inches(picture)), file, display)
