"""`qinit plot lifetime`: returns of tasks that are learned one after another."""

from __future__ import annotations

from pathlib import Path

import typer

from qinit_cli.commands.build import Reference, add_command
from qinit_cli.commands.option_groups import DISPLAY, READING, Display, Reading
from qinit_cli.commands.plot.picture import Picture, Usual, publish

USUAL = Usual("lifetime", "text", "what is shown")


def add_to(plots: typer.Typer) -> None:
    """Adds the picture."""
    add_command(
        plots,
        "lifetime",
        lifetime,
        {"picture": USUAL.group, "reading": READING, "display": DISPLAY},
        references=(
            Reference(
                "runs",
                "Runs of lifelong or transfer: paths, names in the store, or - for stdin.",
                several=True,
            ),
        ),
        help="Return against the number of the task; where finished tasks were added (lifelong --update), the spread of ln Q, "
        "and what it was as fitted.",
    )


def lifetime(runs: list[str], picture: Picture, reading: Reading, display: Display) -> None:
    """Draws the picture and prints its path; a line for each run, in their order."""
    from qinit_cli.commands import references
    from qinit_cli.pictures import lifetime as pictures
    from qinit_store.catalog import Store

    file, store = USUAL.file(picture), Store(Path(reading.store))
    paths = references.many(runs, reading.store, output=file.path)
    publish(pictures.drawn(paths, store, title=picture.title, width=USUAL.inches(picture)), file, display)
