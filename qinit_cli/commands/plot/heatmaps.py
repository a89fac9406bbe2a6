"""`qinit plot heatmaps`: what methods start from, or what a fit holds, over the state axes."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import typer

from qinit_cli.commands.build import Reference, add_command
from qinit_cli.commands.option_groups import DISPLAY, IMPORTS, READING, Display, Group, Reading
from qinit_cli.commands.plot.picture import Picture, Usual, publish
from qinit_cli.fields import check, option

USUAL = Usual("heatmaps", "text", "the distribution, where there is one")
Quantity = Literal[
    "start",
    "mu",
    "sigma",
    "mean",
    "std",
    "min",
    "max",
    "lognormal-median",
    "lognormal-mean",
    "n",
    "n-masked",
    "eopl-mean",
    "eopl-std",
    "eopl-n",
]


@dataclass(frozen=True)
class Mapping:
    """What the panels show."""

    method: list[str] | None = option(
        None,
        "Draw this initialisation's start from each fit; may be given several times.",
        default_text="every initialisation that needs the fit alone",
    )
    quantity: Quantity = option(
        "start",
        "The start, largest over actions; or a table of the fits, at the action of the largest mean.",
    )
    scale: Literal["linear", "log"] = option("linear", "Colours by the value, or by its logarithm.")
    bare: bool = option(False, "Leave out the chances of the goal.")

    def __post_init__(self) -> None:
        check(self)
        if self.method and self.quantity != "start":
            raise ValueError(f"--method draws starts; with --quantity {self.quantity} leave it out")


def add_to(plots: typer.Typer) -> None:
    """Adds the picture."""
    add_command(
        plots,
        "heatmaps",
        heatmaps,
        {"picture": USUAL.group, "mapping": Group(Mapping, "Panels"), "reading": READING, "display": DISPLAY},
        imports=IMPORTS,
        references=(
            Reference("artefacts", "Fits and runs: paths, names in the store, or - for stdin.", several=True),
        ),
        help="What methods start from over the states: a row a method, a column a distribution, one colour scale.",
    )


def heatmaps(
    artefacts: list[str], picture: Picture, mapping: Mapping, reading: Reading, display: Display
) -> None:
    """Draws the picture and prints its path; columns stand in the order of the artefacts."""
    from qinit_cli.commands import references
    from qinit_cli.pictures import heatmaps as pictures

    file = USUAL.file(picture)
    drawn = pictures.drawn(
        references.many(artefacts, reading.store, output=file.path),
        mapping.method,
        mapping.quantity,
        logarithmic=mapping.scale == "log",
        goals=not mapping.bare,
        title=picture.title,
        width=USUAL.inches(picture),
    )
    publish(drawn, file, display)
