"""Chunks as HDF5's filters would make them: shuffle, deflate, Fletcher-32.

HDF5 lets one thread in at a time, and deflates bytes that nothing makes shorter; here several threads work, and the
last bytes of real numbers, which are noise, are stored. HDF5 reads both with its own filters.
"""

from __future__ import annotations

import math
import zlib
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from functools import partial
from itertools import groupby

import h5py
import numpy as np

from qinit_store.schema import Array

LEVEL = 1
SAMPLE_BYTES = 2048  # deflated of each plane to see whether all of it is worth the time ...
WORTH = 0.95  # ... which it is where they become shorter than this share
ZLIB_HEADER = b"\x78\x01"  # deflate with a window of 32 KiB, level 1
LAST_BLOCK = b"\x03\x00"  # an empty one
FLETCHER_ROW = 256  # words; the sums of so many, and of as many rows, stay below 2**32
ADDED = 65535  # Fletcher-32 adds modulo this


@dataclass(frozen=True)
class Packed:
    """A chunk as it stands in the file."""

    dataset: h5py.Dataset
    offset: tuple[int, ...]
    content: bytes

    def write(self) -> None:
        """Hands it to HDF5, past the filters."""
        self.dataset.id.write_direct_chunk(self.offset, self.content)


class Chunks:
    """The chunks of a dataset whose rows come in order; each spans all dimensions but the first."""

    def __init__(self, dataset: h5py.Dataset) -> None:
        self._dataset = dataset
        self._rows: list[Array] = []  # that fill no chunk yet
        self._held = 0  # how many
        self._first = 0  # row of the next chunk

    def add(self, rows: Array) -> Iterator[Callable[[], Packed]]:
        """Takes rows; the calls that make the chunks that they fill."""
        size = self._dataset.chunks[0]
        while len(rows):
            some, rows = rows[: size - self._held], rows[size - self._held :]
            self._rows.append(some)
            self._held += len(some)
            if self._held == size:
                yield self._call()

    def end(self) -> Iterator[Callable[[], Packed]]:
        """The call that makes the last chunk, filled up with zeros, if there are rows left."""
        if self._held:
            missing = self._dataset.chunks[0] - self._held
            self._rows.append(np.zeros((missing, *self._dataset.shape[1:]), self._dataset.dtype))
            yield self._call()

    def _call(self) -> Callable[[], Packed]:
        rows, offset = self._rows, (self._first, *(0 for _ in self._dataset.shape[1:]))
        self._first += self._dataset.chunks[0]
        self._rows, self._held = [], 0
        return partial(_packed, self._dataset, offset, rows, self._dataset.dtype)


def whole_rows(dataset: h5py.Dataset) -> bool:
    """Whether the chunks of `dataset` can be made here: each spans all dimensions but the first."""
    return dataset.chunks is not None and dataset.chunks[1:] == dataset.shape[1:]


def _packed(
    dataset: h5py.Dataset,
    offset: tuple[int, ...],
    rows: Iterable[Array],
    dtype: np.dtype[np.generic],
) -> Packed:
    """On any thread, so `dataset` is only passed on."""
    values = np.concatenate([np.asarray(some, dtype) for some in rows])
    content = _deflated(shuffled(values))
    return Packed(dataset, offset, content + fletcher32(content).to_bytes(4, "little"))


def shuffled(values: Array) -> Array:
    """The bytes of `values` by planes, (itemsize, values): the first byte of each value, the second of each, ..."""
    one_by_one = np.ascontiguousarray(values).reshape(-1).view(np.uint8).reshape(-1, values.dtype.itemsize)
    return np.ascontiguousarray(one_by_one.T)


def _deflated(planes: Array) -> bytes:
    """One zlib stream of all planes; those that would hardly become shorter are stored in it as they are."""
    pieces = [ZLIB_HEADER]
    for worth, group in groupby(planes, _worth):
        level = LEVEL if worth else 0
        deflating = zlib.compressobj(level, zlib.DEFLATED, -zlib.MAX_WBITS)
        pieces += [deflating.compress(np.concatenate(list(group)).data), deflating.flush(zlib.Z_SYNC_FLUSH)]
    return b"".join([*pieces, LAST_BLOCK, zlib.adler32(planes.data).to_bytes(4, "big")])


def _worth(plane: Array) -> bool:
    middle = (plane.size - SAMPLE_BYTES) // 2
    if middle <= 0:
        return True
    sample = plane[middle : middle + SAMPLE_BYTES]
    return len(zlib.compress(sample.data, LEVEL)) < WORTH * SAMPLE_BYTES


def fletcher32(content: bytes) -> int:
    """HDF5's checksum: the sum of the big-endian words modulo 65535, and above it the sum of these sums."""
    words = np.frombuffer(content + bytes(-len(content) % 2), ">u2")
    count = words.size
    rows = math.ceil(count / FLETCHER_ROW)
    table = np.zeros((rows, FLETCHER_ROW), np.uint32)
    table.reshape(-1)[:count] = words
    by_row = table.sum(axis=1, dtype=np.uint64)
    by_place = table.sum(axis=0, dtype=np.uint64)
    total = int(by_row.sum())
    # the word at place k counts count - k times
    before = FLETCHER_ROW * int(by_row @ np.arange(rows, dtype=np.uint64))
    before += int(by_place @ np.arange(FLETCHER_ROW, dtype=np.uint64))
    return _folded(count * total - before) << 16 | _folded(total)


def _folded(total: int) -> int:
    # carries are added at the end, so no sum but that of zeros becomes 0
    return (total - 1) % ADDED + 1 if total else 0
