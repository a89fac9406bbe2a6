"""The errors of the command line, each with the exit code that scripts see.

    QinitError
    |- UsageError   2  options that cannot be meant, a reference that leads nowhere
    |- TasksFailed  3  some tasks failed, the rest are saved
    |- NotAllowed   4  the input does not allow it: wrong kind, too few sources, other targets

    Interrupted   130 or 143  a signal; what was learned is kept

The store has its own tree (qinit_store.errors) with codes of the same meaning.
"""

from __future__ import annotations


class QinitError(Exception):
    """What was asked, what there is, what to do: one sentence, and the exit code it leads to."""

    exit_code = 1


class UsageError(QinitError):
    """The command line or the configuration cannot be meant so."""

    exit_code = 2


class TasksFailed(QinitError):
    """Some tasks failed; the rest are saved, and the artefact's path was printed."""

    exit_code = 3


class NotAllowed(QinitError):
    """The input is sound, but does not allow what was asked of it."""

    exit_code = 4


class Interrupted(BaseException):
    """A signal came; the message says what is kept and how to go on, the exit code is 128 + the signal's number.

    Not an Exception, as KeyboardInterrupt is none: whoever catches everything must not swallow it.
    """

    def __init__(self, message: str, exit_code: int) -> None:
        super().__init__(message)
        self.exit_code = exit_code
