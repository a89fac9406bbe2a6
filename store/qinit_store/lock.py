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
from qinit_store.presence import refusal, status

LOCK = "lock"

# `being_held` takes the lock for a moment; a writer that meets it tries again, 50 ms in all.
ATTEMPTS = 5
PAUSE = 0.01

NO_LOCK_FILE = (errno.ENOENT, errno.ENOTDIR, errno.ELOOP, errno.ENXIO)  # the last: a pipe or socket there
NO_LOCKS = (errno.ENOLCK, errno.ENOTSUP, errno.EOPNOTSUPP, errno.ENOSYS, errno.EINVAL)


class Lock:
    """A locked file under its name."""

    def __init__(self, descriptor: int, path: Path) -> None:
        self._descriptor = descriptor
        self.path = path

    @property
    def holds(self) -> bool:
        """Whether the locked file is the one under the name, not one that was removed or moved; SystemFailed."""
        named = status(self.path)
        try:
            return named is not None and os.path.samestat(os.fstat(self._descriptor), named)
        except OSError as problem:
            raise refusal("look at", self.path, problem) from problem

    def release(self) -> None:
        os.close(self._descriptor)


@contextmanager
def held(folder: Path, disk: Disk, *, wait: bool) -> Iterator[Lock]:
    """The work folder, made, ours and locked; Busy where another process holds it and `wait` is false."""
    lock = _acquired(folder, disk, wait)
    try:
        yield lock
    finally:
        lock.release()


def being_held(folder: Path) -> bool:
    """Whether a process holds the lock of this work folder just now; SystemFailed where that cannot be told."""
    path = folder / LOCK
    try:
        descriptor = os.open(path, os.O_RDONLY | os.O_NOFOLLOW | os.O_NONBLOCK | os.O_CLOEXEC)
    except OSError as problem:
        if problem.errno in NO_LOCK_FILE:
            return False
        raise refusal("look at", path, problem) from problem
    try:
        fcntl.flock(descriptor, fcntl.LOCK_SH | fcntl.LOCK_NB)
    except BlockingIOError:
        return True
    except OSError as problem:
        if problem.errno not in NO_LOCKS:
            raise refusal("look at", path, problem) from problem
    finally:
        os.close(descriptor)
    return False


def _acquired(folder: Path, disk: Disk, wait: bool) -> Lock:
    while True:
        _make(folder, disk)
        try:
            descriptor = _open(folder / LOCK, disk)
        except FileNotFoundError:
            continue  # the holder finished and took the folder away
        lock = Lock(descriptor, folder / LOCK)
        try:
            _lock(descriptor, folder, disk, wait)
            if lock.holds:
                return lock
        except BaseException:
            lock.release()
            raise
        lock.release()


def _make(folder: Path, disk: Disk) -> None:
    try:
        with suppress(FileExistsError):
            disk.make_directory(folder)
    except FileNotFoundError as problem:
        raise SystemFailed(
            f"the folder {folder.parent} is no longer there: it was moved or removed meanwhile; run the command again"
        ) from problem
    found = status(folder)
    if found is None:
        return
    if not stat.S_ISDIR(found.st_mode) or found.st_uid != os.geteuid():
        raise Refused(
            f"{folder} is no folder of yours, so nothing can be saved there; remove it or choose another -o"
        )
    disk.sync_directory(folder.parent)


def _open(path: Path, disk: Disk) -> int:
    try:
        descriptor = disk.open_lock(path)
    except SystemFailed as failure:
        if failure.code in (errno.ELOOP, errno.EISDIR):
            raise _odd(path) from failure
        raise
    if not stat.S_ISREG(os.fstat(descriptor).st_mode):
        os.close(descriptor)
        raise _odd(path)
    return descriptor


def _odd(path: Path) -> Refused:
    return Refused(f"{path} is no regular file; remove it")


def _lock(descriptor: int, folder: Path, disk: Disk, wait: bool) -> None:
    for attempt in range(ATTEMPTS):
        try:
            disk.lock(descriptor, folder / LOCK, wait=wait)
            return
        except BlockingIOError:
            if attempt < ATTEMPTS - 1:
                time.sleep(PAUSE)
        except SystemFailed as failure:
            if failure.code not in NO_LOCKS:
                raise
            raise SystemFailed(
                f"{failure}: this file system has no locks, which keep two writers of one artefact apart;"
                " name a folder on another with --store or -o"
            ) from failure.__cause__
    target = folder.with_name(folder.name.removeprefix(".").removesuffix(".work"))
    raise Busy(f"another process is writing {target}; wait for it with --wait, or give another name with -o")
