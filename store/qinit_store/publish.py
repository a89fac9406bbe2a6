"""How bytes get under a name: whole, flushed, and never in place of something else unless that is wanted."""

from __future__ import annotations

import errno
import io
import itertools
import os
from contextlib import suppress
from pathlib import Path

from qinit_store.disk import Disk, write_all
from qinit_store.errors import Refused, SystemFailed
from qinit_store.presence import status

_NUMBERS = (
    itertools.count()
)  # an interrupted attempt leaves its temporary file behind: the next needs another

NO_LINKS = (
    errno.EPERM,
    errno.EACCES,
    errno.ENOTSUP,
    errno.EOPNOTSUPP,
    errno.ENOSYS,
    errno.EMLINK,
    errno.EXDEV,
)
NO_RESERVING = (errno.ENOTSUP, errno.EOPNOTSUPP, errno.EINVAL, errno.ENOSYS)


def place(disk: Disk, path: Path, content: bytes) -> None:
    """Bring `content` durably under `path`, replacing what is there; a temporary file may stay behind."""
    temporary = path.with_name(f"{path.name}.{next(_NUMBERS)}.tmp")
    descriptor = disk.create(temporary)
    try:
        write_all(disk, descriptor, temporary, content)
        disk.sync(descriptor, temporary)
    except BaseException:
        os.close(descriptor)
        raise
    disk.close(descriptor, temporary)
    disk.replace(temporary, path)
    disk.sync_directory(path.parent)


def reveal(disk: Disk, whole: Path, target: Path, *, replace: bool) -> None:
    """Give the finished file `whole` its name in one step; Refused where another file took it meanwhile."""
    if replace:
        disk.replace(whole, target)
    else:
        _link(disk, whole, target)
    disk.sync_directory(target.parent)


def _link(disk: Disk, whole: Path, target: Path) -> None:
    try:
        disk.link(whole, target)
    except FileExistsError:
        raise _taken(target) from None
    except SystemFailed as failure:
        if failure.code not in NO_LINKS:
            raise
        # No hard links on this file system: the lock keeps other writers of ours away from the name.
        if status(target) is not None:
            raise _taken(target) from None
        disk.replace(whole, target)


def _taken(target: Path) -> Refused:
    return Refused(f"{target} appeared while this was being written; give another name with -o, or --force")


class Growing(io.RawIOBase):
    """A new file that HDF5 fills, in front of which no write ever fails.

    HDF5 ends in a segmentation fault when the disk is full. So the first failure is kept for `finish`, and
    what could not be written is held in memory, so that HDF5 reads back what it believes it wrote.
    """

    def __init__(self, disk: Disk, path: Path, room: int) -> None:
        super().__init__()
        self._disk = disk
        self._path = path
        self._descriptor = disk.create(path)
        self._position = 0
        self._size = 0
        self._lost: list[tuple[int, bytes]] = []
        self.failure: BaseException | None = None
        try:
            disk.reserve(self._descriptor, path, room)
        except SystemFailed as failure:
            if failure.code not in NO_RESERVING:
                os.close(self._descriptor)
                raise

    def finish(self) -> None:
        """Flush to the disk and close; the first failure of a write is raised here."""
        self.check()
        self._disk.truncate(self._descriptor, self._path, self._size)
        self._disk.sync(self._descriptor, self._path)
        self._disk.close(self._descriptor, self._path)

    def abandon(self) -> None:
        """Close and remove the file, as far as that goes: the room it holds may be what was missing."""
        with suppress(OSError):
            os.close(self._descriptor)
        with suppress(OSError, SystemFailed):
            self._disk.remove(self._path)

    def check(self) -> None:
        """Raise the first failure of a write, if there was one."""
        if self.failure is not None:
            raise self.failure

    def write(self, content: object) -> int:
        raw = memoryview(content).cast("B")  # type: ignore[arg-type]  # typeshed: no buffer type
        try:
            if self.failure is None:
                write_all(self._disk, self._descriptor, self._path, raw, self._position)
        except BaseException as failure:  # a signal's exception too: nothing may pass through HDF5
            self.failure = failure
        if self.failure is not None:
            self._lost.append((self._position, bytes(raw)))
        self._position += raw.nbytes
        self._size = max(self._size, self._position)
        return raw.nbytes

    def readinto(self, buffer: object) -> int:
        raw = memoryview(buffer).cast("B")  # type: ignore[arg-type]  # as above
        content = bytearray(raw.nbytes)
        try:
            there = self._disk.read(self._descriptor, self._path, raw.nbytes, self._position)
            content[: len(there)] = there
        except BaseException as failure:
            self.failure = self.failure or failure
        for offset, lost in self._lost:
            first = max(offset, self._position)
            stop = min(offset + len(lost), self._position + raw.nbytes)
            if first < stop:
                content[first - self._position : stop - self._position] = lost[first - offset : stop - offset]
        raw[:] = content
        self._position += raw.nbytes
        return raw.nbytes

    def seek(self, offset: int, whence: int = os.SEEK_SET) -> int:
        base = {os.SEEK_SET: 0, os.SEEK_CUR: self._position, os.SEEK_END: self._size}[whence]
        self._position = base + offset
        return self._position

    def tell(self) -> int:
        return self._position

    def truncate(self, size: int | None = None) -> int:
        self._size = self._position if size is None else size
        return self._size

    def readable(self) -> bool:
        return True

    def writable(self) -> bool:
        return True

    def seekable(self) -> bool:
        return True
