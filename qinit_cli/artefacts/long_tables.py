"""Artefacts as long tables: one row per observation, in pieces of bounded size, each verified before it is handed on."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import TYPE_CHECKING

import numpy as np

from qinit_cli.artefacts.kind import DIGEST, Field
from qinit_cli.artefacts.kinds import KINDS
from qinit_cli.errors import NotAllowed

if TYPE_CHECKING:
    from qinit_store.reading import Artefact
    from qinit_store.schema import Array, Column, Schema

ROWS = 16_384  # of a long table in one piece


def tables(artefact: Artefact) -> list[str]:
    """The names of the long tables that the artefact has."""
    return _there(artefact.schema)


def fields(artefact: Artefact, table: str) -> list[Field]:
    """The columns of a long table: which artefact, its axes and what its tasks were drawn as, then the values."""
    dims, values = layout(artefact.schema, table)
    known = {
        column.name: Field(column.name, column.little_endian.str, column.unit, column.long_name)
        for column in artefact.schema.columns
    }
    axes = {
        name: Field(
            name, "str" if axis.values.dtype.kind == "S" else axis.values.dtype.str, axis.unit, axis.long_name
        )
        for name, axis in artefact.axes.items()
    }
    there = {column.name for column in values}
    named = [Field(name, "str", "", f"the {name}") for name in _labels(artefact)]
    coordinates = [
        field
        for dim in dims
        for field in [axes[dim], *(known[column.name] for column in drawn(artefact.schema, dim))]
    ]
    return [
        *named,
        *coordinates,
        *(known[column.name] for column in values),
        *(one for one in KINDS[artefact.kind].derived_fields(table) if one.name not in there),
    ]


def rows(artefact: Artefact, table: str) -> Iterator[dict[str, Array]]:
    """The long table in pieces of at most ROWS rows: a one-dimensional array for each of its fields."""
    dims, values = layout(artefact.schema, table)
    names = [field.name for field in fields(artefact, table)]
    joined = [column for dim in dims for column in drawn(artefact.schema, dim)]
    scales = {dim: texts(artefact.axes[dim].values) for dim in dims}
    for first, block in _blocks(artefact, table, [*values, *joined]):
        lengths = [len(block["task"]) if dim == "task" else len(scales[dim]) for dim in dims]
        total = int(np.prod(lengths, dtype=np.int64))
        for start in range(0, total, ROWS):
            at = np.unravel_index(np.arange(start, min(start + ROWS, total)), lengths)
            place = dict(zip(dims, at, strict=True))
            piece = {dim: scales[dim][place[dim] + (first if dim == "task" else 0)] for dim in dims}
            piece |= {
                column.name: block[column.name][tuple(place[dim] for dim in column.dims)]
                for column in [*values, *joined]
            }
            for name, whole in _derived(artefact, table, block).items():
                piece[name] = whole[at]
            piece |= {name: np.full(at[0].size, text) for name, text in _labels(artefact).items()}
            yield {name: piece[name] for name in names}


def layout(schema: Schema, table: str) -> tuple[tuple[str, ...], list[Column]]:
    """The axes of a long table and the datasets over exactly these, what tasks were drawn as apart."""
    dims = KINDS[schema.kind].table_dims(schema, table)
    if not dims:
        names = ", ".join(_there(schema))
        raise NotAllowed(f"there is no table {table} in these {KINDS[schema.kind].folder}; there is {names}")
    joined = [column for dim in dims for column in drawn(schema, dim)]
    return dims, [column for column in schema.columns if column.dims == dims and column not in joined]


def drawn(schema: Schema, dim: str) -> list[Column]:
    """What belongs to each entry of an axis: the parameters of a task or candidate, the source of a library table."""
    kind = KINDS[schema.kind]
    if dim not in kind.described:
        return []
    return [column for column in schema.columns if column.dims == (dim,) and column.name not in kind.results]


def _there(schema: Schema) -> list[str]:
    kind = KINDS[schema.kind]
    return [name for name in kind.tables if kind.table_dims(schema, name)]


def _labels(artefact: Artefact) -> dict[str, str]:
    """What tells the rows of several artefacts apart."""
    return {"artefact": artefact.path.stem, **KINDS[artefact.kind].labels(artefact.spec)}


def texts(values: Array) -> Array:
    """The same, where it is text as text."""
    return values.astype(str) if values.dtype.kind == "S" else values


def _blocks(
    artefact: Artefact, table: str, columns: Iterable[Column]
) -> Iterator[tuple[int, dict[str, Array]]]:
    """Whole datasets where none has a task axis, else blocks of tasks, each with the number of its first row."""
    statics = {column.name: artefact.read(column.name) for column in columns if not column.per_task}
    names = [column.name for column in columns if column.per_task]
    if "task" not in KINDS[artefact.kind].table_dims(artefact.schema, table) and not names:
        yield 0, statics
        return
    there = {column.name for column in artefact.schema.columns}
    needed = [name for name in KINDS[artefact.kind].needed(table) if name in there]
    names += [name for name in (*needed, DIGEST) if name not in names]
    first = 0
    for block in artefact.blocks(names, artefact.schema.block_size):
        yield first, block | statics
        first += len(block["task"])


def _derived(artefact: Artefact, table: str, block: dict[str, Array]) -> dict[str, Array]:
    """The derived columns of a block of tasks, over the axes of the table."""
    kind = KINDS[artefact.kind]
    found = kind.derived(artefact, table, block)
    if DIGEST in block:
        found[DIGEST] = np.array([row.tobytes().hex() for row in block[DIGEST]])
    return {field.name: found[field.name] for field in kind.derived_fields(table)}
