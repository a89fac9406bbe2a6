"""`qinit plot occupancy`: the states on the optimal paths, over the tasks of each distribution."""

from __future__ import annotations

import typer

from qinit_cli.commands.build import Reference, add_command
from qinit_cli.commands.option_groups import DISPLAY, IMPORTS, READING, Display, Reading
from qinit_cli.commands.plot.picture import Picture, Usual, publish

USUAL = Usual("occupancy", "text", "the start of the paths")


def add_to(plots: typer.Typer) -> None:
    """Adds the picture."""
    add_command(
        plots,
        "occupancy",
        occupancy,
        {"picture": USUAL.group, "reading": READING, "display": DISPLAY},
        imports=IMPORTS,
        references=(
            Reference("sources", "Sources: paths, names in the store, or - for stdin.", several=True),
        ),
        help="States visited on the greedy paths of all tasks from the target start: a map of counts for each distribution, "
        "and the outlines of all; paths that never arrive are counted apart.",
    )


def occupancy(sources: list[str], picture: Picture, reading: Reading, display: Display) -> None:
    """Draws the picture and prints its path; distributions in the order of their sources."""
    from qinit_cli.commands import references
    from qinit_cli.pictures import occupancy as pictures

    file = USUAL.file(picture)
    paths = references.many(sources, reading.store, output=file.path)
    publish(pictures.drawn(paths, title=picture.title, width=USUAL.inches(picture)), file, display)
