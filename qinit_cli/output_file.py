"""The one way to write a file that is no artefact: whole under its name or not at all, and never in place of another's.

What stands there is replaced only by the command that made it, or with --force. A link is replaced, never followed; a device,
a pipe, a socket or a folder is never replaced.
"""

from __future__ import annotations

import filecmp
import os
import secrets
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import IO

from qinit_cli.errors import NotAllowed, UsageError
from qinit_store.disk import Disk
from qinit_store.errors import SystemFailed
from qinit_store.publish import Growing
from qinit_store.wording import printable

NEW = os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_NOFOLLOW | os.O_CLOEXEC
PROCESSES = Path("/proc")  # whose links, such as /dev/stdout, lead to what a process has open


def check_one_line(path: Path) -> None:
    """UsageError for a path with line breaks: the next command reads one path a line."""
    if set("\n\r") & set(str(path)):
        raise UsageError(
            f"{printable(path)} has a line break in it, and paths are printed one a line; choose another name"
        )


@dataclass(frozen=True)
class OutputFile:
    """Where a command writes, and what it may replace there."""

    path: Path
    force: bool  # replaces any regular file
    maker: str = ""  # the command, in words
    mark: bytes = (
        b""  # in every file that it makes; in forms without room for one only equal content is replaced
    )
    remedy: str = "--force replaces it, or choose another name with -o"

    def check(self) -> None:
        """NotAllowed where what stands there is not to be replaced, as far as that is known before anything is made.

        UsageError for a name that `check_one_line` refuses.
        """
        check_one_line(self.path)
        if not os.path.lexists(self.path):
            return
        if (self.path.exists() and not self.path.is_file()) or _leads_to_a_process(self.path):
            raise NotAllowed(f"{self.path} is no regular file, and is never replaced; choose another name")
        if self.mark and not self.force and self.mark not in self._there():
            raise NotAllowed(f"{self.path} was not made by {self.maker}; {self.remedy}")

    def check_content(self, content: bytes) -> None:
        """NotAllowed where this content is not to take the place of what stands there."""
        self.check()
        if os.path.lexists(self.path) and not (self.force or self.mark or content == self._there()):
            raise NotAllowed(f"{self.path} is there already, with other content; {self.remedy}")

    @contextmanager
    def writing(self) -> Iterator[IO[bytes]]:
        """A file that gets the name once it is whole; nothing of it is left after an error or a signal.

        NotAllowed as `check` says it, SystemFailed where the system refuses.
        """
        with self._beside() as beside, os.fdopen(os.open(beside, NEW, 0o666), "wb") as file:
            yield file
            file.flush()
            os.fsync(file.fileno())

    @contextmanager
    def growing(self) -> Iterator[Growing]:
        """The same for what HDF5 fills: its writes never fail, the first failure is raised once it is done with the file."""
        with self._beside() as beside:
            file = Growing(Disk(), beside, 0)
            try:
                yield file
                file.finish()
            except BaseException:
                file.abandon()
                file.check()
                raise

    def write(self, content: bytes) -> None:
        """Writes the whole content."""
        with self.writing() as file:
            file.write(content)

    def settle(self, content: bytes) -> bool:
        """Whether the file has this content already; its time is then set to now, as make compares times."""
        alike = self.path.is_file() and not self.path.is_symlink() and self._there() == content
        if alike:
            Disk().touch(self.path)
        return alike

    @contextmanager
    def _beside(self) -> Iterator[Path]:
        """Where the file is made before it gets the name."""
        self.check()
        beside = self.path.with_name(f".{secrets.token_hex(8)}.part")
        try:
            yield beside
            self._check_written(beside)  # another may have appeared meanwhile
            os.replace(beside, self.path)
        except OSError as error:
            raise SystemFailed(f"{self.path} cannot be written: {error.strerror or error}") from error
        finally:
            beside.unlink(missing_ok=True)

    def _check_written(self, beside: Path) -> None:
        self.check()
        if self.force or self.mark or not os.path.lexists(self.path):
            return
        if not (self.path.is_file() and filecmp.cmp(beside, self.path, shallow=False)):
            raise NotAllowed(f"{self.path} is there already, with other content; {self.remedy}")

    def _there(self) -> bytes:
        """What stands there, empty where it cannot be read: then it is not ours."""
        try:
            return self.path.read_bytes()
        except (FileNotFoundError, PermissionError):
            return b""


def _leads_to_a_process(path: Path) -> bool:
    """True where the path, or a link that stands there, leads through /proc."""
    while True:
        parent = path.parent.resolve()
        if parent.is_relative_to(PROCESSES):
            return True
        if not path.is_symlink():
            return False
        path = parent / path.readlink()
