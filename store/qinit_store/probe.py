"""Whether the file system of a folder does what the store asks of it: tried there, with nothing left behind."""

from __future__ import annotations

import os
import tempfile
from dataclasses import dataclass
from pathlib import Path

from qinit_store.disk import Disk
from qinit_store.errors import SystemFailed
from qinit_store.lock import held
from qinit_store.publish import NO_LINKS


@dataclass(frozen=True)
class FileSystem:
    """What works in a folder."""

    links: str  # "" where a file can have a second name, else the system's answer
    flushes_directories: bool


def tried(folder: Path, disk: Disk) -> FileSystem:
    """What works in `folder`, which must exist; SystemFailed where nothing can be stored there, as without locks."""
    try:
        with tempfile.TemporaryDirectory(prefix=".qinit-", dir=folder) as name:
            work = Path(name) / ".tried.h5.work"
            with held(work, disk, wait=False):
                return FileSystem(_links(work, disk), disk.sync_directory(work))
    except OSError as problem:
        raise SystemFailed(f"cannot write in {folder}: {problem.strerror}") from problem


def _links(work: Path, disk: Disk) -> str:
    """Why a file cannot have a second name; "" where it can."""
    path = work / "one"
    disk.close(disk.create(path), path)
    try:
        disk.link(path, work / "two")
    except SystemFailed as failure:
        if failure.code not in NO_LINKS:
            raise
        return os.strerror(failure.code)
    return ""
