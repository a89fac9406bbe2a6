"""What can go wrong in the store; each class carries the exit code a command should end with.

Every message says what was asked, what there is and what to do about it.
"""

from __future__ import annotations


class StoreError(Exception):
    """Any refusal or failure of the store."""

    exit_code = 1


class NotFound(StoreError):
    """There is no such artefact."""

    exit_code = 2


class Refused(StoreError):
    """What is there does not allow it: other settings under that name, the wrong kind, too many tasks."""

    exit_code = 4


class Busy(StoreError):
    """Another process is writing this artefact."""

    exit_code = 5


class Damaged(StoreError):
    """The file is not what was written, or not one that may be read."""

    exit_code = 6
    state = "damaged"  # as a list of artefacts has it


class NotOurs(Damaged):
    """The file is not qinit's, or another program changed it; it need not be damaged."""

    state = "foreign"


class TooNew(Damaged):
    """A later version wrote the file."""

    state = "newer"


class SystemFailed(StoreError):
    """The operating system refused: disk full, no permission, input/output error."""

    exit_code = 7

    @property
    def code(self) -> int | None:
        """The system's number for the error it was raised from; None where there is none."""
        return self.__cause__.errno if isinstance(self.__cause__, OSError) else None
