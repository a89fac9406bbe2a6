"""Files of tasks of one's own, an archive of arrays or a folder with a file for each task, read once and known by a digest."""

from __future__ import annotations

import hashlib
import struct
import zipfile
from collections.abc import Callable, Sequence
from functools import lru_cache
from os import SEEK_CUR
from pathlib import Path
from threading import Lock
from typing import Any, BinaryIO, TypeVar

import numpy as np
from numpy.typing import NDArray

from qinit_cli.errors import NotAllowed, UsageError
from qinit_cli.grid_map import MOVES
from qinit_cli.npy import UNREADABLE, header
from qinit_cli.task_files.maps import map_task
from qinit_cli.task_files.tables import OwnTask, OwnTaskSet, own_tasks, told_apart

Read = TypeVar("Read")
MAPPED_BYTES = 1 << 24  # from which on an array is not copied
LOCAL_NAMES = 26  # bytes of a member's header before the lengths of its name and of what follows that
ARCHIVE, MAP = ".npz", ".txt"
_READING = Lock()  # several threads ask for the same file at once


def digest_of(path: Path) -> str:
    """The SHA-256 of a file's bytes, or of the names and bytes of the task files in a folder; UsageError if there is none."""
    try:
        stamps = tuple((one, one.stat().st_mtime_ns, one.stat().st_size) for one in _parts(path))
        return _digest(path, stamps)
    except OSError as error:
        raise UsageError(
            f"{path} cannot be read: {error.strerror or error}; name a file or folder of tasks"
        ) from error


def tasks_in(path: Path, sha256: str) -> OwnTaskSet:
    """The tasks of a file; NotAllowed where it is missing, has changed since its digest was this one, or holds what cannot be."""
    if not path.exists():
        raise NotAllowed(
            f"the tasks stand in {path}, and there is no such file here; run the command where it is"
        )
    if digest_of(path) != sha256:
        raise NotAllowed(
            f"{path} has changed since its tasks were learned; train its sources again, or bring it back"
        )
    with _READING:
        return _tasks_in(path, sha256)


@lru_cache(maxsize=2)
def _tasks_in(path: Path, sha256: str) -> OwnTaskSet:
    return _from_folder(path) if path.is_dir() else _from_archive(path)


@lru_cache(maxsize=8)
def _digest(path: Path, stamps: tuple[tuple[Path, int, int], ...]) -> str:
    """The digest of files that have these names, times and sizes: a large one is read once."""
    held = hashlib.sha256()
    for part, _, _ in stamps:
        if part != path:
            held.update(part.name.encode() + b"\0")
        with part.open("rb") as file:
            held.update(hashlib.file_digest(file, "sha256").digest())
    return held.hexdigest()


def _parts(path: Path) -> list[Path]:
    """The files that tasks are read from, in order of their names."""
    if not path.is_dir():
        return [path]
    return sorted(one for one in path.iterdir() if one.suffix in (ARCHIVE, MAP))


def _from_archive(path: Path) -> OwnTaskSet:
    if path.suffix != ARCHIVE:
        raise UsageError(
            f"{path} is no file of tasks; give an archive of arrays ({ARCHIVE}) or a folder of maps ({MAP})"
        )
    arrays = _arrays(path)
    tasks = told_apart(own_tasks(arrays, str(path)))
    labels = arrays.get("split", np.empty(0, "U1"))
    states, actions, _ = tasks[0].after.shape
    splits = tuple(str(label) for label in labels.tolist())
    return OwnTaskSet(tasks, splits, f"state={states}", tuple(map(str, range(actions))))


def _from_folder(path: Path) -> OwnTaskSet:
    parts = _parts(path)
    kinds = {part.suffix for part in parts}
    if len(kinds) != 1:
        there = f"both {ARCHIVE} and {MAP} files" if kinds else f"neither {ARCHIVE} nor {MAP} files"
        raise UsageError(f"{path} holds {there}; put one kind into a folder, a file for each task")
    return _of_maps(path, parts) if kinds == {MAP} else _of_archives(path, parts)


def _of_maps(path: Path, parts: Sequence[Path]) -> OwnTaskSet:
    read = [map_task(_text(part), str(part)) for part in parts]
    down, across = _alike(path, parts, [shape for _, shape in read], "rows and columns")
    return OwnTaskSet([task for task, _ in read], (), f"row={down},col={across}", MOVES)


def _of_archives(path: Path, parts: Sequence[Path]) -> OwnTaskSet:
    tasks = told_apart([_only(own_tasks(_arrays(part), str(part)), part) for part in parts])
    states, actions = _alike(path, parts, [task.after.shape[:2] for task in tasks], "states and actions")
    return OwnTaskSet(tasks, (), f"state={states}", tuple(map(str, range(actions))))


def _only(tasks: list[OwnTask], part: Path) -> OwnTask:
    if len(tasks) > 1:
        raise NotAllowed(f"{part} holds {len(tasks)} tasks; in a folder each file holds one")
    return tasks[0]


def _alike(
    path: Path, parts: Sequence[Path], shapes: Sequence[tuple[int, ...]], what: str
) -> tuple[int, int]:
    """The shape that all have; NotAllowed where one has another."""
    for part, shape in zip(parts, shapes, strict=True):
        if shape != shapes[0]:
            raise NotAllowed(
                f"{part.name} of {path} has {shape[0]} x {shape[1]} {what}, and {parts[0].name} {shapes[0][0]} x {shapes[0][1]}; "
                "tasks of a file share their states and actions"
            )
    return shapes[0][0], shapes[0][1]


def _text(part: Path) -> str:
    return _read(part, lambda: part.read_text(encoding="ascii"))


def _arrays(path: Path) -> dict[str, NDArray[Any]]:
    def read() -> dict[str, NDArray[Any]]:
        with np.load(path, allow_pickle=False) as archive, path.open("rb") as file:
            members = {one.filename.removesuffix(".npy"): one for one in archive.zip.infolist()}
            return {
                key: archive[key] if (mapped := _mapped(file, members[key])) is None else mapped
                for key in archive.files
            }

    return _read(path, read)


def _mapped(file: BinaryIO, member: zipfile.ZipInfo) -> NDArray[Any] | None:
    """A large array that stands in an archive as it is, mapped into memory: reading a copy of a gigabyte takes seconds."""
    if member.compress_type != zipfile.ZIP_STORED or member.file_size < MAPPED_BYTES:
        return None
    file.seek(member.header_offset + LOCAL_NAMES)
    name, extra = struct.unpack("<HH", file.read(4))
    file.seek(name + extra, SEEK_CUR)
    shape, by_columns, dtype = header(file)
    if dtype.hasobject:
        return None
    return np.memmap(file, dtype, "r", file.tell(), shape, "F" if by_columns else "C")


def _read(path: Path, reader: Callable[[], Read]) -> Read:
    """What a reader reads; NotAllowed where the file is not what its name says."""
    try:
        return reader()
    except (OSError, ValueError, TypeError, *UNREADABLE) as error:
        kind = "archive of numpy's arrays" if path.suffix == ARCHIVE else "map in plain text"
        raise NotAllowed(f"{path} is no {kind} that can be read: {error}") from error
