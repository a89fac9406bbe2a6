"""Running what somebody else has written: what it prints goes to stderr, and its faults bear its name.

Stdout is for results, and the stage behind a pipe reads them: what an environment prints there would be read as a path.
"""

from __future__ import annotations

import ctypes
import os
import signal
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from typing import Any

from qinit_cli.errors import Interrupted, NotAllowed, QinitError

STDOUT, STDERR = 1, 2
LONGEST = 300  # characters of somebody else's message


class Improper(ValueError):
    """An environment gave what cannot be learned from: an observation outside its space, a reward that is not a number."""


@contextmanager
def aside() -> Iterator[None]:
    """Descriptor 1 and sys.stdout are stderr, in all threads, until the last of several such blocks ends."""
    _TURN.begin()
    try:
        yield
    finally:
        _TURN.end()


@contextmanager
def calling(name: str, call: str) -> Iterator[None]:
    """Runs a call of somebody's environment aside; NotAllowed names both where it raises anything but an error of ours."""
    with aside():
        try:
            yield
        except BaseException as error:
            raise fault(name, call, error) from error


def fault(name: str, call: str, error: BaseException) -> BaseException:
    """The sentence for what a call of somebody's environment raised; our own errors and MemoryError as they are."""
    if ends_our_work(error) or isinstance(error, MemoryError):
        return error
    if isinstance(error, Improper):
        return NotAllowed(f"{error} ({call} of {name})")
    return NotAllowed(f"{call} of {name} raised {told(error)}; that is a fault of the environment")


def ends_our_work(error: BaseException) -> bool:
    """Whether it is an error or an interruption of ours; all else, panics of compiled code among it, somebody else has raised."""
    if isinstance(error, KeyboardInterrupt):  # Ctrl-C raises it only where Python's own handler stands
        return signal.getsignal(signal.SIGINT) is signal.default_int_handler
    return isinstance(error, QinitError | Interrupted | GeneratorExit)


def told(error: BaseException) -> str:
    """The kind and the message of somebody else's error, on one line."""
    text = " ".join(str(error).split())
    text = text if len(text) <= LONGEST else f"{text[:LONGEST]}..."
    return f"{type(error).__name__}: {text}" if text else type(error).__name__


class _Turn:
    """Standard output, for as long as anybody wants it aside."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._depth = 0
        self._kept: int | None = None  # a copy of descriptor 1 as it was; None where it is closed
        self._stream: Any = None  # sys.stdout as it was ...
        self._instead: Any = None  # ... and what stands in its place

    def begin(self) -> None:
        with self._lock:
            if self._depth == 0:
                self._away()
            self._depth += 1

    def end(self) -> None:
        with self._lock:
            self._depth -= 1
            if self._depth == 0:
                self._back()

    def _away(self) -> None:
        if sys.stdout is not None:
            sys.stdout.flush()  # what is ours by now goes where it belongs
        self._kept = _copied(STDOUT)
        if self._kept is not None:
            _point_at_stderr(STDOUT)
        self._stream, self._instead = sys.stdout, sys.stderr
        sys.stdout = self._instead

    def _back(self) -> None:
        if sys.stdout is self._instead:  # else somebody, such as a progress bar, has put another one there
            sys.stdout = self._stream
        with suppress(OSError, ValueError):  # whoever kept the old stream has filled its buffer
            if self._stream is not None:
                self._stream.flush()
        _flush_c()
        if self._kept is not None:
            os.dup2(self._kept, STDOUT)
            os.close(self._kept)


_TURN = _Turn()


def _copied(descriptor: int) -> int | None:
    try:
        return os.dup(descriptor)
    except OSError:  # it is closed: there is nothing to keep clean
        return None


def _point_at_stderr(descriptor: int) -> None:
    try:
        os.dup2(STDERR, descriptor)
    except OSError:  # stderr is closed
        nowhere = os.open(os.devnull, os.O_WRONLY)
        os.dup2(nowhere, descriptor)
        os.close(nowhere)


def _flush_c() -> None:
    """Writes out what C code has printed: its buffer knows nothing of Python's."""
    with suppress(OSError, AttributeError, TypeError):  # no C library that can be asked
        ctypes.CDLL(None).fflush(None)
