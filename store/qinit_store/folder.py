"""The work folder beside an unfinished artefact: its settings, its part files, and taking it away again."""

from __future__ import annotations

import errno
import os
import re
import stat
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from qinit_store.disk import Disk
from qinit_store.errors import SystemFailed
from qinit_store.lock import LOCK
from qinit_store.presence import names, refusal, status
from qinit_store.publish import place
from qinit_store.spec import Spec, canonical_json, read_json, settings, texts
from qinit_store.wording import recorded_command

RECORD = "spec.json"
LARGEST_RECORD = 4 * 1024**2
WHOLE = "whole.tmp"
NO_RECORD = (errno.ENOENT, errno.ENOTDIR, errno.ELOOP, errno.EINVAL)  # nothing, a link, or no regular file
PART = re.compile(r"part-(\d{12})-(\d+)-[0-9a-f]{16}\.h5")


@dataclass(frozen=True)
class Record:
    """What an unfinished artefact is to become."""

    kind: str
    spec: Spec
    provenance: dict[str, Any] = field(default_factory=dict)

    @property
    def command(self) -> str:
        """The command that began it, as a message advises it; a stand-in where none of ours is recorded."""
        line = recorded_command(self.provenance.get("command"))
        return f"`{line}`" if line else "the command that began it"


def work_folder(target: Path) -> Path:
    """`.NAME.h5.work` beside `target`."""
    return target.with_name(f".{target.name}.work")


def read_record(folder: Path) -> Record | None:
    """The settings kept in `folder`; None where there are none, or none that make sense. SystemFailed."""
    path = folder / RECORD
    try:
        raw = _small_file(path)
    except OSError as problem:
        if problem.errno not in NO_RECORD:
            raise refusal("read", path, problem) from problem
        return None
    try:
        kept = read_json(raw.decode())
        return Record(str(kept["kind"]), settings(kept["spec"]), texts(kept["provenance"]))
    except (ValueError, KeyError, TypeError):
        return None  # every part carries its own settings, so nothing depends on this file


def _small_file(path: Path) -> bytes:
    """The content of a regular file; EINVAL where it is none. A pipe must not hold us."""
    descriptor = os.open(path, os.O_RDONLY | os.O_NOFOLLOW | os.O_NONBLOCK | os.O_CLOEXEC)
    try:
        if not stat.S_ISREG(os.fstat(descriptor).st_mode):
            raise OSError(errno.EINVAL, os.strerror(errno.EINVAL))
        return os.read(descriptor, LARGEST_RECORD)
    finally:
        os.close(descriptor)


def write_record(folder: Path, record: Record, disk: Disk) -> None:
    kept = {"kind": record.kind, "spec": record.spec, "provenance": record.provenance}
    place(disk, folder / RECORD, canonical_json(kept).encode("ascii"))


def part_name(first: int, count: int, sha256: str) -> str:
    return f"part-{first:012d}-{count}-{sha256[:16]}.h5"


def part_paths(folder: Path) -> list[Path]:
    """The part files of `folder` in the order of their names."""
    return [folder / name for name in names(folder) if PART.fullmatch(name)]


def tasks_saved(folder: Path) -> int:
    """The number of tasks in the part files, by their names alone."""
    return sum(int(match[2]) for name in names(folder) if (match := PART.fullmatch(name)))


def set_bad_aside(path: Path, disk: Disk) -> None:
    """Rename a part file that does not hold to `*.bad`, beside any earlier one."""
    number = 1
    while status(path.with_name(f"{path.name}.{number}.bad")) is not None:
        number += 1
    disk.replace(path, path.with_name(f"{path.name}.{number}.bad"))
    disk.sync_directory(path.parent)


def remove_temporaries(folder: Path, disk: Disk) -> None:
    for name in names(folder):
        if name.endswith(".tmp"):
            disk.remove(folder / name)


def remove_parts(folder: Path, disk: Disk) -> None:
    """Forget everything saved here; the settings go last, and the lock stays."""
    for name in names(folder):
        if name.endswith((".tmp", ".bad")) or PART.fullmatch(name):
            disk.remove(folder / name)
    if status(folder / RECORD) is not None:
        disk.remove(folder / RECORD)


def remove_folder(folder: Path, disk: Disk) -> None:
    """Take the folder away, the lock last; one that holds files not ours is left with them."""
    remove_parts(folder, disk)
    foreign = [name for name in names(folder) if name != LOCK]
    with suppress(FileNotFoundError):
        disk.remove(folder / LOCK)
    if not foreign:
        _remove_directory(folder, disk)


def _remove_directory(folder: Path, disk: Disk) -> None:
    try:
        disk.remove_directory(folder)
    except (FileNotFoundError, FileExistsError):
        return
    except SystemFailed as failure:
        # The next writer may have moved in as soon as the lock was gone.
        if failure.code != errno.ENOTEMPTY:
            raise
