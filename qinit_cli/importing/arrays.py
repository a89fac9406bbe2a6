"""Arrays in the files of other programs, read in blocks along their first axis: npy, npz and HDF5; nothing is unpickled."""

from __future__ import annotations

import zipfile
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import IO, Any

import numpy as np

from qinit_cli.errors import NotAllowed, UsageError
from qinit_store.wording import counted

PICKLES = (".pkl", ".pickle", ".joblib", ".msh")
HDF5 = (".h5", ".hdf5", ".hdf")
ARRAYS = (".npy", ".npz", *HDF5)
HELD_BYTES = 8 * 2**20  # of an array that are read at a time

Blocks = Callable[[int], Iterator[Any]]


@dataclass(frozen=True)
class StoredArray:
    """An array in a file."""

    place: str  # the file and the name within it, in messages
    shape: tuple[int, ...]
    dtype: np.dtype[Any]
    blocks: Blocks  # of so many entries of the first axis each, in order


def stored_arrays(path: Path, inner: str, wanted: Mapping[str, str]) -> dict[str, StoredArray]:
    """The arrays that the file has of those `wanted`, a role to a name, by role; "q" is there or UsageError.

    `inner` is the path within an HDF5 file, "" the file itself: a group whose arrays have these names, or the array of q.
    """
    match path.suffix.lower():
        case ".npy":
            there = {wanted["q"]: _npy(path)}
        case ".npz":
            there = _npz(path)
        case _:
            there = _hdf5(path, inner, wanted["q"])
    found = {role: there[name] for role, name in wanted.items() if name in there}
    if "q" not in found and len(there) == 1:
        found["q"] = next(iter(there.values()))
    if "q" not in found:
        raise UsageError(
            f"{path} has no array {wanted['q']!r}; it has {', '.join(sorted(there)) or 'none'}; give --key NAME"
        )
    return found


def refuse_pickle(path: Path) -> None:
    """NotAllowed for the name of a pickle, which runs code when it is opened."""
    if path.suffix.lower() in PICKLES:
        raise NotAllowed(f"{path} is a pickle, and opening one can run any code; {conversion(path)}")


def conversion(path: Path) -> str:
    """The line that converts a pickle where it is trusted."""
    plain = str(path.with_name(f"{path.stem}-plain.npy"))
    read = f"numpy.load({str(path)!r}, allow_pickle=True)"
    if path.suffix.lower() in PICKLES:
        read = f"pickle.load(open({str(path)!r}, 'rb'))"
    line = f"import numpy, pickle; numpy.save({plain!r}, numpy.asarray({read}, dtype=float))"
    return f'where you trust it, convert it: python -c "{line}"'


def _npy(path: Path) -> StoredArray:
    array = _streamed(str(path), lambda: path.open("rb"))
    if array is None:
        raise NotAllowed(f"{path} holds Python objects, which are a pickle; {conversion(path)}")
    return array


def _npz(path: Path) -> dict[str, StoredArray]:
    def opener(name: str) -> Callable[[], IO[bytes]]:
        return lambda: zipfile.ZipFile(path).open(name)

    try:
        with zipfile.ZipFile(path) as archive:
            names = [name for name in archive.namelist() if name.endswith(".npy")]
    except zipfile.BadZipFile as error:
        raise NotAllowed(f"{path} is no npz file: {error}") from error
    found = {}
    for name in names:
        inner = name.removesuffix(".npy")
        array = _streamed(f"{path}:{inner}", opener(name))
        if array is not None:
            found[inner] = array
    return found


def _streamed(place: str, opened: Callable[[], IO[bytes]]) -> StoredArray | None:
    """An array in numpy's own format, read as a stream; None for one of objects, which is a pickle."""
    with opened() as file:
        shape, fortran, dtype = _header(file, place)
    if dtype.hasobject:
        return None

    def blocks(rows: int) -> Iterator[Any]:
        with opened() as file:
            _header(file, place)
            if fortran and len(shape) > 1:  # entries of one task lie apart: the whole is needed
                whole = np.frombuffer(file.read(), dtype).reshape(shape, order="F")
                yield from (whole[first : first + rows] for first in range(0, shape[0], rows))
                return
            size = int(np.prod(shape[1:], dtype=np.int64))
            for first in range(0, shape[0], rows):
                count = min(rows, shape[0] - first)
                data = file.read(count * size * dtype.itemsize)
                if len(data) < count * size * dtype.itemsize:
                    raise NotAllowed(f"{place} ends within its data: it is cut short")
                yield np.frombuffer(data, dtype).reshape(count, *shape[1:])

    return StoredArray(place, shape, dtype, blocks)


def _header(file: IO[bytes], place: str) -> tuple[tuple[int, ...], bool, np.dtype[Any]]:
    formats = np.lib.format
    try:
        version = formats.read_magic(file)
        read = formats.read_array_header_1_0 if version == (1, 0) else formats.read_array_header_2_0
        return read(file)
    except ValueError as error:
        raise NotAllowed(f"{place} is no array in numpy's format: {error}") from error


def _hdf5(path: Path, inner: str, key: str) -> dict[str, StoredArray]:
    """The datasets of the group at `inner`; where that is a dataset itself, those beside it, and it as the `key`."""
    import h5py

    try:
        with h5py.File(path) as file:
            if inner and inner not in file:
                raise UsageError(
                    f"{path} has nothing at {inner}; it has {', '.join(sorted(file)) or 'nothing'}"
                )
            there = file[inner or "/"]
            alone = isinstance(there, h5py.Dataset)
            group = there.parent if alone else there
            found = {name: _stored(path, one) for name, one in group.items() if isinstance(one, h5py.Dataset)}
            return {**found, key: _stored(path, there)} if alone else found
    except OSError as error:
        raise NotAllowed(f"{path} is no HDF5 file: {error}") from error


def _stored(path: Path, dataset: Any) -> StoredArray:
    name, shape = str(dataset.name), tuple(dataset.shape)

    def blocks(rows: int) -> Iterator[Any]:
        import h5py

        with h5py.File(path) as file:
            for first in range(0, shape[0], rows):
                yield file[name][first : first + rows]

    return StoredArray(f"{path}:{name}", shape, dataset.dtype, blocks)


def check_numbers(arrays: Mapping[str, StoredArray]) -> None:
    """NotAllowed for an array of anything but real numbers, without states and actions, or of no task."""
    for array in arrays.values():
        if array.dtype.kind not in "iuf":
            raise NotAllowed(f"{array.place} is of the type {array.dtype}; action values are real numbers")
        if len(array.shape) < 2:
            raise NotAllowed(
                f"{array.place} has the shape {array.shape}; tables have states and actions at least"
            )
        if not all(array.shape):
            raise NotAllowed(f"{array.place} has the shape {array.shape}: {counted(0, 'entry', 'entries')}")
