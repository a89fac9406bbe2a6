"""`qinit plot heatmaps`: what methods start from, or what a fit holds, over the state axes."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

import typer

from qinit_cli.commands.build import Group, Reference, add_command
from qinit_cli.commands.groups import DISPLAY, READING, Display, Reading
from qinit_cli.commands.plot.picture import Picture, Usual, axis_label, distinct, distribution, publish
from qinit_cli.errors import NotAllowed, UsageError
from qinit_cli.fields import check, option

if TYPE_CHECKING:
    from qinit_cli.commands.plot.panels import Panels
    from qinit_cli.environments import Family
    from qinit_cli.figures.heatmaps import Layer, Side

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
    from qinit_cli.commands.plot.panels import read_panels
    from qinit_cli.figures import heatmaps as drawing
    from qinit_cli.figures.style import house_style

    path = USUAL.path(picture)
    paths = references.many(artefacts, reading.store)
    found = read_panels(paths, mapping.method, mapping.quantity, display)
    upright, across = _sides([panels.family for panels in found])
    names = distinct(
        [distribution(panels.family.name, panels.family.label) for panels in found],
        [panels.origin for panels in found],
        [f"fit {panels.fit[:8]}" for panels in found],
    )
    alone = found[0].family.label if len(found) == 1 else ""
    with house_style():
        figure = drawing.heatmaps(
            list(_layers(found, names, mapping, (len(upright.places), len(across.places)))),
            upright,
            across,
            alone if picture.title is None else picture.title,
            USUAL.inches(picture),
        )
        publish(figure, path)


def _sides(families: list[Family]) -> tuple[Side, Side]:
    """The state axes: the first stands upright, the second lies across; a single one lies."""
    import numpy as np

    from qinit_cli.figures.heatmaps import Side

    if len({(family.name, family.shape) for family in families}) > 1:
        spaces = ", ".join(dict.fromkeys(family.label for family in families))
        raise NotAllowed(f"panels of one picture share their state axes; those of {spaces} differ")
    axes = families[0].axes()
    if len(axes) > 2:
        names = ", ".join(axis.name for axis in axes)
        raise NotAllowed(f"a heatmap has one or two state axes, {families[0].name} has {names}")
    sides = [
        Side(
            axis_label(axis),
            axis.values.astype(np.float64),
            downwards=axis.values.dtype.kind in "iu",  # cells are counted as the rows of a matrix
        )
        for axis in axes
    ]
    return (sides[0], sides[1]) if len(sides) == 2 else (Side("", np.zeros(1)), sides[0])


def _layers(
    found: list[Panels], names: list[str], mapping: Mapping, shape: tuple[int, int]
) -> Iterator[Layer]:
    """The chances of the goal where they differ from task to task, and what was asked for."""
    from qinit_cli.figures.heatmaps import Layer
    from qinit_cli.figures.style import CHANCE_COLOURS

    chances = {
        ("goals", name): panels.family.goal_chances().reshape(shape)
        for name, panels in zip(names, found, strict=True)
    }
    changing = {name: chance for name, chance in chances.items() if chance.any()}
    if changing and mapping.quantity == "start" and not mapping.bare:
        yield Layer("chance that the goal is there", changing, logarithmic=True, colours=CHANCE_COLOURS)
    tables = {
        (row, name): table.reshape(shape)
        for name, panels in zip(names, found, strict=True)
        for row, table in panels.tables.items()
    }
    if mapping.scale == "log" and any((table < 0).any() for table in tables.values()):
        raise UsageError(f"--scale log: {mapping.quantity} has values below 0; use --scale linear")
    yield Layer(found[0].label, tables, logarithmic=mapping.scale == "log")
