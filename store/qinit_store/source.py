"""The bytes of a file for HDF5, read by ourselves, so that a failing system is never taken for a damaged file.

HDF5 reports both as one kind of error, and has lost the system's number by then. Here the first failure is kept, HDF5
reads zeros from there on, and whoever asked HDF5 asks for the failure before believing anything.
"""

from __future__ import annotations

import io
import os
import stat
from collections.abc import Callable
from pathlib import Path
from typing import TypeVar

import numpy as np

from qinit_store.errors import Damaged, NotFound, NotOurs, StoreError, SystemFailed
from qinit_store.interrupts import held_back
from qinit_store.presence import refusal
from qinit_store.wording import shell_line

T = TypeVar("T")

# Read before HDF5 is asked, and kept: where HDF5 finds no superblock it loses its hold on us, and would call a Python
# that has ended when the process exits.
HEAD_BYTES = 4096

# What h5py raises on a file that is not as it should be.
HDF5_TROUBLE = (OSError, KeyError, RuntimeError, ValueError, TypeError, AttributeError, EOFError)

# HDF5 reports memory that it did not get in a hundred wordings, as errors like any other; the most that it asks for
# at once is a chunk and its stream.
SPARE_MEMORY = 2 * 64 * 1024**2


class Source(io.RawIOBase):
    """An open regular file. NotFound, NotOurs or SystemFailed where there is none, or none that can be opened."""

    def __init__(self, path: Path) -> None:
        super().__init__()
        self.path = path
        self._position = 0
        self._failure: BaseException | None = None
        try:
            # a pipe must not hold us
            self._descriptor = os.open(path, os.O_RDONLY | os.O_CLOEXEC | os.O_NONBLOCK)
        except (FileNotFoundError, NotADirectoryError):
            raise NotFound(f"there is no {path}; `qinit list` shows what the store holds") from None
        except OSError as problem:
            raise refusal("read", path, problem) from problem
        try:
            self._opened = os.fstat(self._descriptor)
            if not stat.S_ISREG(self._opened.st_mode):
                raise NotOurs(f"{path} is no regular file, so it is no artefact")
            self.head = os.pread(self._descriptor, HEAD_BYTES, 0)
        except OSError as problem:
            os.close(self._descriptor)
            raise refusal("read", path, problem) from problem
        except NotOurs:
            os.close(self._descriptor)
            raise

    @property
    def size(self) -> int:
        """In bytes, as it was opened."""
        return self._opened.st_size

    def peek(self, offset: int, size: int) -> bytes:
        """What there is of `size` bytes at `offset`; SystemFailed."""
        try:
            return os.pread(self._descriptor, size, offset)
        except OSError as problem:
            raise refusal("read", self.path, problem) from problem

    def asked(self, call: Callable[[], T]) -> T:
        """What `call` makes of the file through HDF5, which reads from here; it may be called twice.

        SystemFailed where a read failed, MemoryError where there is none left, Damaged where no sense can be made of
        the file. Signals wait meanwhile: a handler that raises must not do so in a function that HDF5 called.
        """
        try:
            with held_back():
                return self._sound(call)
        except StoreError:
            raise
        except HDF5_TROUBLE as problem:
            self._check()
            np.empty(SPARE_MEMORY, dtype=np.uint8)  # MemoryError, if that was it
            raise self.damage(str(problem)) from problem

    def damage(self, reason: str) -> StoreError:
        """Damaged for this reason; SystemFailed where the file is no longer the one that was opened."""
        if self.closed:  # what was read before is checked
            return self._damage(reason)
        try:
            found = os.fstat(self._descriptor)
        except OSError as problem:
            return refusal("read", self.path, problem)
        if (found.st_size, found.st_mtime_ns) != (self._opened.st_size, self._opened.st_mtime_ns):
            return SystemFailed(
                f"{self.path} was written by another program while it was read; run the same command again"
            )
        return self._damage(reason)

    def _damage(self, reason: str) -> Damaged:
        return Damaged(f"{self.path} is damaged: {reason}; see `{shell_line('qinit', 'verify', self.path)}`")

    def _sound(self, call: Callable[[], T]) -> T:
        try:
            answer = call()
        except HDF5_TROUBLE:
            self._check()
            answer = call()  # damage stays; a lack of memory may have passed
        self._check()
        return answer

    def _check(self) -> None:
        """Raise the first failure of a read, if there was one: zeros came in its place."""
        if isinstance(self._failure, OSError):
            raise refusal("read", self.path, self._failure) from self._failure
        if self._failure is not None:
            raise self._failure

    def readinto(self, buffer: object) -> int:
        raw = memoryview(buffer).cast("B")  # type: ignore[arg-type]  # typeshed: no buffer type
        kept = self.head[self._position : self._position + raw.nbytes]
        there = len(kept)
        raw[:there] = kept
        try:
            while there < raw.nbytes and self._failure is None:
                more = os.preadv(self._descriptor, [raw[there:]], self._position + there)
                if not more:
                    break
                there += more
        except BaseException as failure:  # nothing may pass through HDF5
            self._failure = failure
        raw[there:] = bytes(raw.nbytes - there)  # beyond the end, as HDF5's own driver does
        self._position += raw.nbytes
        return raw.nbytes

    def seek(self, offset: int, whence: int = os.SEEK_SET) -> int:
        base = {os.SEEK_SET: 0, os.SEEK_CUR: self._position, os.SEEK_END: self.size}[whence]
        self._position = base + offset
        return self._position

    def tell(self) -> int:
        return self._position

    def close(self) -> None:
        if not self.closed:
            os.close(self._descriptor)
        super().close()

    def readable(self) -> bool:
        return True

    def seekable(self) -> bool:
        return True
