"""Every change the store makes on the disk, one method each, so that a test can break each of them."""

from __future__ import annotations

import errno
import fcntl
import os
from collections.abc import Callable
from pathlib import Path
from typing import TypeVar

from qinit_store.errors import SystemFailed

T = TypeVar("T")

# What a file system answers that has no such thing as flushing a directory, or a folder that may not be read.
NO_DIRECTORY_FLUSH = (
    errno.EINVAL,
    errno.ENOTSUP,
    errno.EOPNOTSUPP,
    errno.ENOSYS,
    errno.EBADF,
    errno.EACCES,
)


class Disk:
    """The operating system's file operations.

    A missing or already existing file and a lock held elsewhere are reported as FileNotFoundError, FileExistsError and
    BlockingIOError, because the protocol expects them; any other OSError becomes SystemFailed with the path. A test
    overrides `attempt`.
    """

    def attempt(self, operation: str, path: Path, call: Callable[[], T]) -> T:
        """What `call` returns; every operation of this class passes through here."""
        return call()

    def make_directory(self, path: Path) -> None:
        self._do("make the directory", path, lambda: os.mkdir(path))

    def open_lock(self, path: Path) -> int:
        """A descriptor of the lock file, made if need be; a symbolic link there is an error."""
        flags = os.O_RDWR | os.O_CREAT | os.O_NOFOLLOW | os.O_CLOEXEC
        return self._do("open the lock", path, lambda: os.open(path, flags, 0o666))

    def create(self, path: Path) -> int:
        """A descriptor of a new, empty file that did not exist."""
        flags = os.O_RDWR | os.O_CREAT | os.O_EXCL | os.O_NOFOLLOW | os.O_CLOEXEC
        return self._do("create", path, lambda: os.open(path, flags, 0o666))

    def reserve(self, descriptor: int, path: Path, size: int) -> None:
        """Room for `size` bytes, so that a full disk is met before HDF5 writes rather than while it does."""
        self._do("reserve room for", path, lambda: os.posix_fallocate(descriptor, 0, size))

    def write(self, descriptor: int, path: Path, content: memoryview, offset: int) -> int:
        """The number of bytes written, which may be fewer than there are."""
        return self._do("write", path, lambda: os.pwrite(descriptor, content, offset))

    def read(self, descriptor: int, path: Path, size: int, offset: int) -> bytes:
        """What there is of `size` bytes; no change, but it may fail while HDF5 writes."""
        return self._do("read back", path, lambda: os.pread(descriptor, size, offset))

    def truncate(self, descriptor: int, path: Path, size: int) -> None:
        self._do("cut to size", path, lambda: os.ftruncate(descriptor, size))

    def sync(self, descriptor: int, path: Path) -> None:
        self._do("flush to the disk", path, lambda: os.fsync(descriptor))

    def close(self, descriptor: int, path: Path) -> None:
        self._do("close", path, lambda: os.close(descriptor))

    def lock(self, descriptor: int, path: Path, *, wait: bool) -> None:
        """The file locked against other processes; BlockingIOError where one holds it and `wait` is false."""
        how = fcntl.LOCK_EX if wait else fcntl.LOCK_EX | fcntl.LOCK_NB
        self._do("lock", path, lambda: fcntl.flock(descriptor, how))

    def sync_directory(self, path: Path) -> bool:
        """The entries of the directory are on the disk; False where this file system flushes files alone."""
        try:
            self._do("flush the directory", path, lambda: _sync_directory(path))
        except SystemFailed as failure:
            if failure.code not in NO_DIRECTORY_FLUSH:
                raise
            return False
        return True

    def link(self, path: Path, name: Path) -> None:
        """`path` under a second name, never replacing what is there."""
        self._do("link", name, lambda: os.link(path, name))

    def replace(self, path: Path, name: Path) -> None:
        """`path` renamed to `name`, replacing what is there."""
        self._do("rename to", name, lambda: os.replace(path, name))

    def touch(self, path: Path) -> None:
        """The file's time set to now, as make compares times; left as it is where that is not permitted."""
        self._do("set the time of", path, lambda: _set_time(path))

    def remove(self, path: Path) -> None:
        self._do("remove", path, lambda: os.unlink(path))

    def remove_directory(self, path: Path) -> None:
        self._do("remove the directory", path, lambda: os.rmdir(path))

    def _do(self, operation: str, path: Path, call: Callable[[], T]) -> T:
        try:
            return self.attempt(operation, path, call)
        except (FileExistsError, FileNotFoundError, BlockingIOError):
            raise
        except OSError as problem:
            reason = problem.strerror or type(problem).__name__
            raise SystemFailed(f"cannot {operation} {path}: {reason}") from problem


def write_all(disk: Disk, descriptor: int, path: Path, content: bytes | memoryview, offset: int = 0) -> None:
    """Write every byte of `content`; the system may take fewer at a time."""
    left = memoryview(content).cast("B")
    while left:
        written = disk.write(descriptor, path, left, offset)
        left, offset = left[written:], offset + written


def _set_time(path: Path) -> None:
    try:
        os.utime(path, follow_symlinks=False)
    except OSError as problem:
        if problem.errno not in (errno.EPERM, errno.EACCES, errno.EROFS):
            raise


def _sync_directory(path: Path) -> None:
    descriptor = os.open(path, os.O_RDONLY | os.O_DIRECTORY | os.O_CLOEXEC)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)
