"""Artefacts as arrays by name, each in pieces, so that memory does not grow with the number of tasks."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from qinit_cli.artefacts.long_tables import drawn, layout, texts

if TYPE_CHECKING:
    from qinit_store.reading import Artefact
    from qinit_store.schema import Array, Column

HELD_BYTES = 64 * 2**20  # of columns that are read together in one pass; a larger one takes a pass of its own


@dataclass(frozen=True)
class NamedArray:
    """One array of an artefact, in pieces along its first axis."""

    name: str
    dims: tuple[str, ...]
    shape: tuple[int, ...]
    dtype: str
    unit: str
    long_name: str
    pieces: Iterator[Array]

    @property
    def attributes(self) -> dict[str, str]:
        """What is known of its unit and meaning, as NetCDF and xarray name it."""
        told = {"units": self.unit, "long_name": self.long_name}
        return {name: words for name, words in told.items() if words}


def arrays(artefact: Artefact, table: str | None) -> Iterator[NamedArray]:
    """The axes and datasets of an artefact, or of one of its tables, in order of their sizes' passes: the axes first."""
    schema = artefact.schema
    columns = list(schema.columns)
    if table is not None:
        dims, values = layout(schema, table)
        columns = [*values, *(column for dim in dims for column in drawn(schema, dim))]
    used = {dim for column in columns for dim in column.dims}
    for name, axis in artefact.axes.items():
        if name in used:
            values_ = texts(axis.values)
            yield NamedArray(
                name, (name,), values_.shape, values_.dtype.str, axis.unit, axis.long_name, iter([values_])
            )
    for group in _passes(artefact, columns):
        yield from _read_together(artefact, group)


def _passes(artefact: Artefact, columns: list[Column]) -> list[list[Column]]:
    """Columns that are read together: small ones up to HELD_BYTES, a larger one alone."""
    groups: list[list[Column]] = []
    held = 0
    for column in sorted(columns, key=lambda column: _bytes(artefact, column)):
        size = _bytes(artefact, column)
        if not groups or held + size > HELD_BYTES:
            groups.append([])
            held = 0
        groups[-1].append(column)
        held += size
    return groups


def _bytes(artefact: Artefact, column: Column) -> int:
    return int(np.prod(_shape(artefact, column), dtype=np.int64)) * column.little_endian.itemsize


def _shape(artefact: Artefact, column: Column) -> tuple[int, ...]:
    tasks = (artefact.task_count,) if column.per_task else ()
    return (*tasks, *artefact.schema.row_shape(column))


def _read_together(artefact: Artefact, columns: list[Column]) -> Iterator[NamedArray]:
    """A single column in pieces as it is read, several from memory."""

    def named(column: Column, pieces: Iterator[Array]) -> NamedArray:
        shape, dtype = _shape(artefact, column), column.little_endian.str
        return NamedArray(column.name, column.dims, shape, dtype, column.unit, column.long_name, pieces)

    for column in columns:
        if not column.per_task:
            yield named(column, iter([artefact.read(column.name)]))
    per_task = [column for column in columns if column.per_task]
    blocks = artefact.blocks([column.name for column in per_task], artefact.schema.block_size)
    if len(per_task) == 1:
        yield named(per_task[0], (block[per_task[0].name] for block in blocks))
    elif per_task:
        held = list(blocks)
        for column in per_task:
            none = np.empty((0, *artefact.schema.row_shape(column)), column.little_endian)
            yield named(column, iter([none, *(block[column.name] for block in held)]))
