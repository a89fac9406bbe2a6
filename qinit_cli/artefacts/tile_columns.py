"""Columns and axes of artefacts whose values are sums of weights of tiles."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from qinit_cli.artefacts.columns import index
from qinit_cli.environments import Family
from qinit_cli.environments.tiled import PROBES, PROJECTED, WEIGHTS, TiledFamily
from qinit_store.schema import TASK, Axis, Column

Layout = tuple[tuple[Axis, ...], tuple[Column, ...]]

_PROBES = Column(
    PROBES,
    ("probe", "dimension"),
    "f8",
    long_name="continuous states at which values are kept, the first where targets start",
)


def joined(*layouts: Layout) -> Layout:
    """Several axes and columns as one, each axis once."""
    axes = {axis.name: axis for layout in layouts for axis in layout[0]}
    return tuple(axes.values()), tuple(column for layout in layouts for column in layout[1])


def probe_columns(family: Family) -> Layout:
    """The axis of a state's dimensions and the column of the probes; nothing for a family of tables."""
    if not isinstance(family, TiledFamily):
        return (), ()
    names = np.array([name for name, _, _ in family.box()], "S")
    return (Axis("dimension", names, "", "dimension of a state"),), (_PROBES,)


def weight_columns(family: Family, *, kept: bool) -> Layout:
    """The axis of the tiles and the column of the weights that each task learned, if they are kept; nothing for tables."""
    if not (isinstance(family, TiledFamily) and kept):
        return (), ()
    weights = Column(WEIGHTS, (TASK, "tile", "action"), "f8", long_name="learned weights of the tiles")
    return (index("tile", family.coding.weights),), (weights,)


def fit_columns(family: Family, axes: Mapping[str, Axis]) -> Layout:
    """The columns of the probes and of the library's weights, over `axes` of the sources by name; nothing for tables."""
    if not isinstance(family, TiledFamily):
        return (), ()
    weights = Column("library_weights", ("library", "tile", "action"), "f8", long_name="weights of a source")
    return (axes["dimension"], axes["tile"]), (_PROBES, weights)


def start_columns(family: Family, *, per_task: bool) -> Layout:
    """The axis of the tiles and the columns of the weights that stand for a start, and of their values at the probes.

    Nothing for tables, and where starts are `per_task`.
    """
    if not isinstance(family, TiledFamily) or per_task:
        return (), ()
    return (index("tile", family.coding.weights),), (
        Column("start_weights", ("tile", "action"), "f8", long_name="initial weights of the tiles"),
        Column(PROJECTED, ("probe", "action"), "f8", long_name="initial action values by these weights"),
    )
