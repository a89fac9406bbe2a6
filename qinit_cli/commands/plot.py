"""`qinit plot`: pictures from stored artefacts, a subcommand for each plot in the registry."""

from __future__ import annotations

import inspect
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer

from qinit_cli.commands import references
from qinit_cli.commands.console import note, print_path
from qinit_cli.commands.option_groups import DISPLAY, IMPORTS, READING, Display, Group, Reading
from qinit_cli.commands.typer_commands import Reference, add_command, add_each
from qinit_cli.options import check, option
from qinit_cli.plots import PLOTS, Frame, Plot
from qinit_cli.plots.plot import Width

if TYPE_CHECKING:
    from qinit_cli.plots.drawn import PictureFile


@dataclass(frozen=True)
class Picture:
    """Where the picture goes; None: as this picture has it."""

    output: str | None = option(
        None,
        "The picture: .png, .svg or .pdf; one of the same command is drawn anew.",
        short="-o",
        metavar="FILE",
    )
    title: str | None = option(None, "Title above the picture; '' for none.")
    width: Width | None = option(None, "As wide as a paper's column, 3.5 inches, or as its text, 7 inches.")
    force: bool = option(False, "Replace a file of that name that another command made.")

    def __post_init__(self) -> None:
        check(self)

    def file(self, plot: str) -> PictureFile:
        """Where it goes; UsageError where that names no picture, NotAllowed where another command's file stands."""
        from qinit_cli.plots.drawn import PictureFile
        from qinit_cli.plots.style import checked_path

        path = checked_path(self.output or f"{plot}.png")
        file = PictureFile(path, f"qinit plot {plot}", self.force)
        file.output.check()
        return file


def add_to(plots: typer.Typer, only: str | None = None) -> None:
    """Adds a subcommand for each plot, or that of the `only` name asked for."""
    add_each(plots, PLOTS, _add, only)


def _add(plots: typer.Typer, name: str, kind: type[Plot]) -> None:
    texts = {"output": f"{name}.png", "title": kind.titled, "width": kind.wide}
    add_command(
        plots,
        name,
        partial(plot, kind),
        {
            "picture": Group(Picture, "Picture", texts),
            "chosen": Group(kind, kind.heading),
            "reading": READING,
            "display": DISPLAY,
        },
        imports=IMPORTS,
        references=(Reference(kind.takes.argument, kind.takes.help, several=kind.takes.several),),
        help=" ".join((inspect.getdoc(kind) or "").split("\n\n")[0].split()),
    )


def plot(
    kind: type[Plot], *, picture: Picture, chosen: Plot, reading: Reading, display: Display, **given: Any
) -> None:
    """Draws the picture and prints its path; what is not in it is noted."""
    file = picture.file(kind.name)
    [named] = given.values()
    if kind.takes.several:
        paths = references.many(named, reading.store, output=file.path)
    else:
        paths = [references.one(named, reading.store, output=file.path)]
    drawn = chosen.drawn(paths, Frame(picture.title, kind.inches(picture.width), Path(reading.store)))
    for said in drawn.notes:
        note(display, said)
    drawn.save(file)
    print_path(file.path)
