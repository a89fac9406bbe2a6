"""Arrays in the files of other programs, read in blocks along their first axis: npy, npz and HDF5; nothing is unpickled."""

from __future__ import annotations

import zipfile
from collections.abc import Callable, Collection, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import IO, Any

import numpy as np

from qinit_cli.errors import NotAllowed, UsageError
from qinit_cli.npy import UNREADABLE, header
from qinit_store.wording import counted, shell_line

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
            there = _npz(path, wanted.values())
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


def conversion(path: Path, name: str = "") -> str:
    """The line that converts a pickle, or the array of that name, where it is trusted."""
    plain = str(path.with_name(f"{path.stem}-plain.npy"))
    read = f"numpy.load({str(path)!r}, allow_pickle=True)" + (f"[{name!r}]" if name else "")
    if path.suffix.lower() in PICKLES:
        read = f"pickle.load(open({str(path)!r}, 'rb'))"
    line = f"import numpy, pickle; numpy.save({plain!r}, numpy.asarray({read}, dtype=float))"
    return f"where you trust it, convert it: {shell_line('python', '-c', line)}"


def _npy(path: Path) -> StoredArray:
    found = _streamed(path, "", lambda: path.open("rb"))
    if found is None:
        raise _pickled(path, "")
    return found


def _npz(path: Path, wanted: Collection[str]) -> dict[str, StoredArray]:
    """The arrays of an archive but for those of objects; NotAllowed where one of these is `wanted`, or stands alone."""

    def opener(name: str) -> Callable[[], IO[bytes]]:
        return lambda: zipfile.ZipFile(path).open(name)

    try:
        with zipfile.ZipFile(path) as archive:
            names = [name.removesuffix(".npy") for name in archive.namelist() if name.endswith(".npy")]
    except UNREADABLE as error:
        raise NotAllowed(f"{path} is no npz file: {error}") from error
    found = {}
    for name in names:
        array = _streamed(path, name, opener(f"{name}.npy"))
        if array is not None:
            found[name] = array
        elif len(names) == 1 or name in wanted:
            raise _pickled(path, name)
    return found


def _pickled(path: Path, name: str) -> NotAllowed:
    place = f"{path}:{name}" if name else str(path)
    return NotAllowed(f"{place} holds Python objects, which are a pickle; {conversion(path, name)}")


def _streamed(path: Path, name: str, opened: Callable[[], IO[bytes]]) -> StoredArray | None:
    """An array in numpy's own format, read as a stream; None for one of objects, which is a pickle."""
    place = f"{path}:{name}" if name else str(path)
    with _readable(place), opened() as file:
        shape, fortran, dtype = _header(file, place)
    if dtype.hasobject:
        return None

    def blocks(rows: int) -> Iterator[Any]:
        with _readable(place), opened() as file:
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


@contextmanager
def _readable(place: str) -> Iterator[None]:
    """NotAllowed where an archive is damaged, or packed in a way that is not read."""
    try:
        yield
    except UNREADABLE as error:
        raise NotAllowed(f"{place} cannot be read: {error}; write the file again") from error


def _header(file: IO[bytes], place: str) -> tuple[tuple[int, ...], bool, np.dtype[Any]]:
    try:
        return header(file)
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
