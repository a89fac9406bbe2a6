"""One writer at a time for an artefact: flock on a file of the work folder.

The kernel drops the lock with the process, however that ends, so there are no process ids and no timeouts. It
is inherited over fork: a child that outlives its killed parent still holds it, as it should.
"""

from __future__ import annotations

import errno
import fcntl
import os
import stat
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from qinit_store.disk import Disk
from qinit_store.errors import Busy, Refused, SystemFailed

LOCK = "lock"

# `being_held` takes the lock for a moment; a writer that meets it tries again, 50 ms in all.
ATTEMPTS = 5
PAUSE = 0.01


@contextmanager
def held(folder: Path, disk: Disk, *, wait: bool) -> Iterator[None]:
    """The work folder, made, ours and locked; Busy where another process holds it and `wait` is false."""
    descriptor = _acquired(folder, disk, wait)
    try:
        yield
    finally:
        os.close(descriptor)


def being_held(folder: Path) -> bool:
    """Whether a process holds the lock of this work folder just now."""
    try:
        descriptor = os.open(folder / LOCK, os.O_RDONLY | os.O_NOFOLLOW | os.O_NONBLOCK | os.O_CLOEXEC)
    except OSError:
        return False
    try:
        fcntl.flock(descriptor, fcntl.LOCK_SH | fcntl.LOCK_NB)
    except BlockingIOError:
        return True
    finally:
        os.close(descriptor)
    return False


def _acquired(folder: Path, disk: Disk, wait: bool) -> int:
    while True:
        _make(folder, disk)
        try:
            descriptor = _open(folder / LOCK, disk)
        except FileNotFoundError:
            continue  # the holder finished and took the folder away
        try:
            _lock(descriptor, folder, wait)
            if _is_still(descriptor, folder / LOCK):
                return descriptor
        except BaseException:
            os.close(descriptor)
            raise
        os.close(descriptor)


def _make(folder: Path, disk: Disk) -> None:
    with suppress(FileExistsError):
        disk.make_directory(folder)
    try:
        status = os.lstat(folder)
    except FileNotFoundError:
        return
    if not stat.S_ISDIR(status.st_mode) or status.st_uid != os.geteuid():
        raise Refused(
            f"{folder} is no folder of yours, so nothing can be saved there; remove it or choose another -o"
        )
    disk.sync_directory(folder.parent)


def _open(path: Path, disk: Disk) -> int:
    try:
        descriptor = disk.open_lock(path)
    except SystemFailed as failure:
        if isinstance(failure.__cause__, OSError) and failure.__cause__.errno in (errno.ELOOP, errno.EISDIR):
            raise _odd(path) from failure
        raise
    if not stat.S_ISREG(os.fstat(descriptor).st_mode):
        os.close(descriptor)
        raise _odd(path)
    return descriptor


def _odd(path: Path) -> Refused:
    return Refused(f"{path} is no regular file; remove it")


def _lock(descriptor: int, folder: Path, wait: bool) -> None:
    if wait:
        fcntl.flock(descriptor, fcntl.LOCK_EX)
        return
    for attempt in range(ATTEMPTS):
        try:
            fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
            return
        except BlockingIOError:
            if attempt < ATTEMPTS - 1:
                time.sleep(PAUSE)
    target = folder.with_name(folder.name.removeprefix(".").removesuffix(".work"))
    raise Busy(f"another process is writing {target}; wait for it with --wait, or give another name with -o")


def _is_still(descriptor: int, path: Path) -> bool:
    """Whether the locked file is the one under the name, not one that the last holder removed."""
    try:
        named = os.lstat(path)
    except FileNotFoundError:
        return False
    return os.path.samestat(os.fstat(descriptor), named)
