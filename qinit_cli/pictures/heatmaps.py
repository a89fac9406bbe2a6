"""What methods start from, or what a fit holds, over the state axes: a row a method, a column a distribution; Figure 4."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from qinit_cli.comparison.distinctions import above_words, distinctions
from qinit_cli.errors import NotAllowed, UsageError
from qinit_cli.figures.style import TEXT
from qinit_cli.pictures.names import distinct, distribution, listed, number, place, sides

if TYPE_CHECKING:
    from qinit_cli.environments import Family
    from qinit_cli.figures.drawn import Drawn
    from qinit_cli.figures.heatmaps import Layer, Side
    from qinit_cli.pictures.panels import Panels


def drawn(
    paths: Sequence[Path],
    methods: Sequence[str] | None = None,
    quantity: str = "start",
    *,
    logarithmic: bool = False,
    goals: bool = True,
    title: str | None = None,
    width: float = TEXT,
) -> Drawn:
    """The starts of `methods` from fits and of runs, or another quantity of fits; columns in the order of the artefacts.

    Above starts stand the `goals`' chances. None: every initialisation that needs the fit alone; those that a fit does not
    allow are left out, with a note.
    """
    from qinit_cli.figures import heatmaps as drawing
    from qinit_cli.figures.drawn import Drawn
    from qinit_cli.figures.style import house_style
    from qinit_cli.pictures.panels import read_panels

    found, notes = read_panels(paths, methods, quantity)
    upright, across = _sides([panels.family for panels in found])
    words = distinctions([panels.spec for panels in found])
    names = distinct(
        [above_words(distribution(panels.family), own) for panels, own in zip(found, words, strict=True)],
        [f"fit {panels.fit[:8]}" for panels in found],
    )
    shape = (len(upright.places), len(across.places))
    layers = list(_goals(found, names, shape)) if goals and quantity == "start" else []
    layers.append(_layer(found, names, shape, quantity, logarithmic=logarithmic))
    alone = found[0].family.label if len(found) == 1 else ""
    with house_style():
        figure = drawing.heatmaps(layers, upright, across, alone if title is None else title, width)
    named = ", ".join(dict.fromkeys(panels.family.label for panels in found))
    return Drawn(
        figure, title or f"Heatmaps, {named}", _alt(layers[-1], names, upright, across), tuple(notes)
    )


def _sides(families: list[Family]) -> tuple[Side, Side]:
    """The state axes: the first stands upright, the second lies across; a single one lies."""
    from qinit_cli.figures.heatmaps import Side

    if len({(family.name, family.shape) for family in families}) > 1:
        spaces = ", ".join(dict.fromkeys(family.label for family in families))
        raise NotAllowed(f"panels of one picture share their state axes; those of {spaces} differ")
    found = sides(families[0])
    if len(found) > 2:
        names = ", ".join(axis.name for axis in families[0].axes())
        raise NotAllowed(f"a heatmap has one or two state axes, {families[0].name} has {names}")
    return (found[0], found[1]) if len(found) == 2 else (Side("", np.zeros(1)), found[0])


def _goals(found: list[Panels], names: list[str], shape: tuple[int, int]) -> Iterator[Layer]:
    """The chances of the goal, where it differs from task to task."""
    from qinit_cli.figures.heatmaps import Layer
    from qinit_cli.figures.style import CHANCE_COLOURS

    chances = {
        ("goals", name): panels.family.goal_chances().reshape(shape)
        for name, panels in zip(names, found, strict=True)
    }
    changing = {name: chance for name, chance in chances.items() if chance.any()}
    if changing:
        yield Layer("chance that the goal is there", changing, logarithmic=True, colours=CHANCE_COLOURS)


def _layer(
    found: list[Panels], names: list[str], shape: tuple[int, int], quantity: str, *, logarithmic: bool
) -> Layer:
    """What was asked for."""
    from qinit_cli.figures.heatmaps import Layer

    tables = {
        (row, name): table.reshape(shape)
        for name, panels in zip(names, found, strict=True)
        for row, table in panels.tables.items()
    }
    if logarithmic and any((table < 0).any() for table in tables.values()):
        raise UsageError(f"--scale log: {quantity} has values below 0; use --scale linear")
    return Layer(found[0].label, tables, logarithmic=logarithmic)


def _alt(layer: Layer, names: list[str], upright: Side, across: Side) -> str:
    """What is drawn, and where each row is largest in its first and its last column."""
    rows = dict.fromkeys(row for row, _ in layer.panels)
    ends = list(dict.fromkeys((names[0], names[-1])))
    parts = []
    for row in rows:
        shown = [name for name in ends if (row, name) in layer.panels]
        peaks = [_peak(layer, row, name, upright, across, named=len(names) > 1) for name in shown]
        parts.append(f"{row} {', '.join(peaks)}")
    columns = "" if len(names) == 1 else f" for {', '.join(name.replace(chr(10), ', ') for name in names)}"
    return f"Heatmaps over the states{columns}: {layer.label}. Largest: {listed(parts)}."


def _peak(layer: Layer, row: str, name: str, upright: Side, across: Side, *, named: bool) -> str:
    table = layer.panels[row, name]
    if np.isnan(table).all():
        return "unknown everywhere"
    at = np.unravel_index(int(np.nanargmax(table)), table.shape)
    there = [
        float(side.places[i]) for side, i in zip((upright, across), at, strict=True) if len(side.places) > 1
    ]
    where = f" ({name.replace(chr(10), ', ')})" if named else ""
    return f"{number(float(table[at]))} at {place(there)}{where}"
