"""How an artefact is laid out in HDF5. Knows nothing of files: it fills an open h5py.File.

libver v110: with v108 the chunk index carries no checksum, and one flipped bit there changed thousands of
values with fletcher32 silent. No variable-length types, but for the dimension scales' own attributes.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import h5py
import numpy as np

from qinit_store.digest import content_sha256
from qinit_store.in_order import in_order
from qinit_store.packing import Chunks, Packed, whole_rows
from qinit_store.schema import BLOCK_BYTES, TASK, TASK_DIGEST, Array, Axis, Column, Schema
from qinit_store.spec import Spec, canonical_json, spec_sha256

SCHEMA_VERSION = 1
MIN_READER = 1
LIBVER = ("v110", "v110")

PACKING: Mapping[str, Any] = {"shuffle": True, "compression": "gzip", "compression_opts": 1}
CHUNK_BYTES = 256 * 1024
IMAGE_ROOM = 64 * 1024  # of a part file, for what is not rows
MOST_WAITING = 64  # chunks, and blocks to be checked
WAITING_BYTES = BLOCK_BYTES // 2  # of chunks that are made and not yet written
LARGEST_CHUNK_BYTES = 16 * 1024 * 1024  # one task alone may exceed CHUNK_BYTES; readers refuse 64 MiB


_NUMBERS = itertools.count()
Check = Callable[[], None]  # raises where rows are not what was saved


@dataclass(frozen=True)
class Header:
    """What the root attributes say, but for the content hash."""

    format: str  # "qinit/KIND", or "qinit/part/KIND" for a part file
    spec: Spec
    provenance: Mapping[str, Any]
    inputs: tuple[Mapping[str, str], ...]  # role, name, content_sha256 of each


def write(
    file: h5py.File,
    header: Header,
    schema: Schema,
    ids: Array,
    digests: Array,
    statics: Mapping[str, Array],
    blocks: Iterable[tuple[Mapping[str, Array], Check]],
    *,
    passing: bool = False,
    threads: int = 1,
) -> str:
    """Fill `file`; the content hash in hexadecimal.

    `ids` are ascending; `blocks` yield (columns with a leading task axis, what checks them), in that order, so that
    memory is bounded by the block. Blocks are checked and chunks made on `threads` threads; the file's bytes do not
    depend on how many. A schema without task columns writes no task scale. `passing`: the file is there
    until its rows are in another, and its hashed columns stand there as they are: compression and checksums
    would take nine tenths of the time that writing takes, and the digests tell what is damaged.
    """
    datasets = {axis.name: axis.values for axis in schema.axes} | dict(statics)
    content = content_sha256(schema.kind, canonical_json(header.spec), ids, digests, datasets)
    _write_header(file, header, content, ids.size)
    task = Axis(TASK, ids, "1", "task id")
    axes = (*([task] if schema.task_columns else []), *schema.axes)
    scales = {axis.name: _write_scale(file, axis) for axis in axes}
    written = {
        column.name: _create_column(file, column, scales, bare=passing and column.hashed)
        for column in schema.columns
    }
    for column in schema.static_columns:
        written[column.name][...] = statics[column.name]
    per_task = {column.name: written[column.name] for column in schema.task_columns}
    chunks = {name: Chunks(dataset) for name, dataset in per_task.items() if whole_rows(dataset)}
    largest = max(
        (math.prod(one.chunks) * one.dtype.itemsize for one in per_task.values() if one.chunks), default=1
    )
    ahead = threads + min(MOST_WAITING, WAITING_BYTES // largest)
    for made in in_order(_calls(blocks, per_task, chunks), threads, ahead):
        if made is not None:
            made.write()
    return content


def image(
    header: Header,
    schema: Schema,
    ids: Array,
    digests: Array,
    rows: Mapping[str, Array],
    *,
    passing: bool = False,
) -> bytes:
    """The bytes of a file that holds these tasks and no column without a task axis."""
    # as much memory at once as the rows take: it would grow by 64 KiB, and copy what is there
    room = IMAGE_ROOM + sum(values.nbytes for values in rows.values())
    name = f"image {next(_NUMBERS)}"  # HDF5 opens none twice, in whatever thread
    with h5py.File(name, "w", driver="core", backing_store=False, libver=LIBVER, block_size=room) as file:
        write(file, header, schema, ids, digests, {}, [(rows, _sound)], passing=passing)
        file.flush()
        content: bytes = file.id.get_file_image()
    return content


def checked(
    schema: Schema, columns: Iterable[Column], values: Mapping[str, Any], tasks: int
) -> dict[str, Array]:
    """`values` in the columns' dtypes; ValueError where a name, a shape or a value does not fit."""
    columns = [column for column in columns if column.given]
    if values.keys() != {column.name for column in columns}:
        there, wanted = sorted(values), sorted(column.name for column in columns)
        raise ValueError(f"{schema.kind}: given {there}, wanted {wanted}")
    fitted = {
        column.name: _fitted(schema, column, np.asarray(values[column.name]), tasks) for column in columns
    }
    if fault := schema.fault(fitted):
        raise ValueError(f"{schema.kind}: {fault}")
    return fitted


def text(value: str) -> Array:
    """A fixed-length UTF-8 attribute."""
    raw = value.encode()
    return np.array(raw, dtype=h5py.string_dtype("utf-8", max(1, len(raw))))


def create(
    file: h5py.Group,
    name: str,
    shape: tuple[int, ...],
    dtype: np.dtype[Any],
    *,
    bare: bool = False,
    ordered: bool = False,
) -> h5py.Dataset:
    """An empty dataset with checksums, in chunks that a reader can take one by one; `ordered` as its attributes are made.

    A `bare` one is its bytes in one piece, neither compressed nor with checksums.
    """
    if bare or 0 in shape:
        return file.create_dataset(name, shape, dtype, track_order=ordered)
    chunks = _chunks(shape, dtype.itemsize)
    return file.create_dataset(
        name, shape, dtype, chunks=chunks, fletcher32=True, track_order=ordered, **PACKING
    )


def _sound() -> None:
    """The check of rows that are at hand."""


def _calls(
    blocks: Iterable[tuple[Mapping[str, Array], Check]],
    datasets: Mapping[str, h5py.Dataset],
    chunks: Mapping[str, Chunks],
) -> Iterator[Callable[[], Packed | None]]:
    """Checks the blocks and makes the chunks; a task that is larger than a chunk goes through HDF5's own filters."""
    first = 0
    for rows, check in blocks:
        yield check
        for name, dataset in datasets.items():
            if name in chunks:
                yield from chunks[name].add(rows[name])
            elif dataset.size:
                dataset[first : first + len(rows[name])] = rows[name]
        first += len(rows[TASK_DIGEST])
    for one in chunks.values():
        yield from one.end()


def _write_header(file: h5py.File, header: Header, content: str, tasks: int) -> None:
    attributes = {
        "qinit_format": header.format,
        "spec_json": canonical_json(header.spec),
        "spec_sha256": spec_sha256(header.spec),
        "content_sha256": content,
        "provenance_json": canonical_json(header.provenance),
        "inputs_json": canonical_json(header.inputs),
    }
    for name, value in attributes.items():
        file.attrs[name] = text(value)
    for name, number in (
        ("qinit_schema", SCHEMA_VERSION),
        ("qinit_min_reader", MIN_READER),
        ("tasks", tasks),
    ):
        file.attrs[name] = np.int64(number)


def _write_scale(file: h5py.File, axis: Axis) -> h5py.Dataset:
    values = np.ascontiguousarray(axis.values, dtype=axis.values.dtype.newbyteorder("<"))
    dataset = create(file, axis.name, values.shape, values.dtype)
    dataset[...] = values
    dataset.make_scale(axis.name)
    _describe(dataset, (axis.name,), axis.unit, axis.long_name)
    if values.dtype.kind == "S":
        dataset.attrs["_Encoding"] = text("utf-8")  # so that xarray shows text labels, not bytes
    return dataset


def _create_column(
    file: h5py.File, column: Column, scales: Mapping[str, h5py.Dataset], *, bare: bool
) -> h5py.Dataset:
    shape = tuple(scales[name].size for name in column.dims)
    dataset = create(file, column.name, shape, column.little_endian, bare=bare)
    for position, name in enumerate(column.dims):
        dataset.dims[position].attach_scale(scales[name])
    _describe(dataset, column.dims, column.unit, column.long_name)
    if not column.hashed:
        dataset.attrs["hashed"] = np.int64(0)
    return dataset


def _chunks(shape: tuple[int, ...], itemsize: int) -> tuple[int, ...]:
    row_bytes = itemsize * int(np.prod(shape[1:], dtype=np.int64))
    chunks = [min(shape[0], max(1, CHUNK_BYTES // row_bytes)), *shape[1:]]
    axis = 1
    while itemsize * int(np.prod(chunks, dtype=np.int64)) > LARGEST_CHUNK_BYTES:
        if chunks[axis] == 1:
            axis += 1
        chunks[axis] = (chunks[axis] + 1) // 2
    return tuple(chunks)


def _describe(dataset: h5py.Dataset, dims: tuple[str, ...], unit: str, long_name: str) -> None:
    dataset.attrs["dims"] = text(" ".join(dims))  # what readers go by: they dereference nothing
    if unit:
        dataset.attrs["units"] = text(unit)
    if long_name:
        dataset.attrs["long_name"] = text(long_name)


def _fitted(schema: Schema, column: Column, values: Array, tasks: int) -> Array:
    shape = (tasks, *schema.row_shape(column)) if column.per_task else schema.row_shape(column)
    if values.shape != shape:
        raise ValueError(f"{schema.kind}: {column.name} has shape {values.shape}, wanted {shape}")
    fitted = np.ascontiguousarray(values.astype(column.little_endian, casting="same_kind", copy=False))
    if fitted.dtype.kind in "iu" and not np.array_equal(fitted, values):
        raise ValueError(f"{schema.kind}: {column.name} has values that {column.dtype} cannot hold")
    return fitted
