"""SIGINT and SIGTERM: by default they end the command at once; while tasks are learned, the first one only asks to stop.

Nothing that is saved can be harmed by ending at once (the store's protocol), so that is safe everywhere else.

The handler raises Interrupted. Our own code lets it through, but modules that are being imported turn it into an ImportError
or ignore it, as destructors and callbacks of C code do. It is therefore raised when an import has ended, and the process ends
once Python reports that it ignored the exception, and after some seconds in which the exception has not ended it.
"""

from __future__ import annotations

import atexit
import os
import signal
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import FrameType
from typing import Any, NoReturn

from qinit_cli.errors import Interrupted

ENDING = (signal.SIGINT, signal.SIGTERM)
PATIENCE = 5.0  # seconds in which Interrupted is to end the process: threads are joined, pictures' temporary files removed
LOOK = 0.02  # seconds between two looks whether an import has ended
IMPORTING = ("<frozen importlib._bootstrap>", "<frozen importlib._bootstrap_external>")
SHOW_CURSOR = b"\x1b[?25h"

_received: list[int] = []  # signals that were to end this process
_asked: list[list[int]] = []  # what the blocks of the main thread received, the innermost last
_elsewhere: dict[int, tuple[Callable[[], None], list[int]]] = {}  # of other threads, by their lists' identity


def exit_at_once(number: int, frame: FrameType | None) -> None:
    """Raises Interrupted with the shell's exit code for the signal."""
    raise Interrupted("", 128 + number)


def install() -> None:
    """Makes both signals end the process with their exit code and no traceback, whatever it is doing."""
    for number in ENDING:
        signal.signal(number, _end_soon)
    sys.unraisablehook = _unless_interrupted(sys.unraisablehook)
    # the last that runs while there are handlers: without one the alarm would end the process with its own code, 142
    atexit.register(signal.setitimer, signal.ITIMER_REAL, 0.0)


def end_from_now_on() -> None:
    """From now on both signals end the process at once: while it ends, no code handles exceptions any more."""
    for number in ENDING:
        signal.signal(number, _end)
    if _received:
        signal.signal(signal.SIGALRM, lambda *_: _end(_received[0]))


def exit_code() -> int | None:
    """That of the first signal that was to end this process, even if its exception was lost; None without a signal."""
    return 128 + _received[0] if _received else None


@contextmanager
def asking_first(stop: Callable[[], None]) -> Iterator[list[int]]:
    """Within the block the first signal calls `stop`, and its number is appended to the list; a second ends at once.

    The main thread alone receives signals. A block in another thread is asked where the main thread is in such a block too:
    one signal stops all of them, also those that are entered after it came.
    """
    received: list[int] = []
    if threading.current_thread() is not threading.main_thread():
        with _asked_by_the_main_thread(stop, received):
            yield received
        return

    def ask(number: int, frame: FrameType | None) -> None:
        if received:
            (_end_soon if before[signal.Signals(number)] is _end_soon else exit_at_once)(number, frame)
        received.append(number)
        stop()
        for others, theirs in list(_elsewhere.values()):
            _ask(others, theirs, number)

    _asked.append(received)
    before = {number: signal.signal(number, ask) for number in ENDING}
    try:
        yield received
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
        _asked.pop()


@contextmanager
def _asked_by_the_main_thread(stop: Callable[[], None], received: list[int]) -> Iterator[None]:
    _elsewhere[id(received)] = stop, received
    try:
        for number in _asked[-1][:1] if _asked else []:
            _ask(stop, received, number)
        yield
    finally:
        del _elsewhere[id(received)]


def _ask(stop: Callable[[], None], received: list[int], number: int) -> None:
    if not received:
        received.append(number)
        stop()


def _end_soon(number: int, frame: FrameType | None) -> None:
    _received.append(number)
    if len(_received) > 1:
        _end(number)
    _end_by(number, time.monotonic() + PATIENCE)


def _end_by(number: int, deadline: float) -> None:
    """Raises Interrupted, after the import at work if there is one; what still runs at the deadline is ended there."""
    left = deadline - time.monotonic()
    if left <= 0.0:
        _end(number)
    if _importing():
        signal.signal(signal.SIGALRM, lambda *_: _end_by(number, deadline))
        signal.setitimer(signal.ITIMER_REAL, LOOK)
        return
    signal.signal(signal.SIGALRM, lambda *_: _end(number))
    signal.setitimer(signal.ITIMER_REAL, left)
    raise Interrupted("", 128 + number)


def _importing() -> bool:
    """Whether a module is being imported just now."""
    frame: FrameType | None = sys._getframe()
    while frame is not None:
        if frame.f_code.co_filename in IMPORTING:
            return True
        frame = frame.f_back
    return False


def _end(number: int, frame: FrameType | None = None) -> NoReturn:
    """Ends the process here; a terminal gets back the cursor that a bar had hidden."""
    if os.isatty(2):
        os.write(2, SHOW_CURSOR)
    os._exit(128 + number)


def _unless_interrupted(usual: Callable[[Any], object]) -> Callable[[Any], object]:
    """Ends the process for a signal's exception that Python ignores, as it does in destructors and callbacks."""

    def hook(ignored: Any) -> object:
        if isinstance(ignored.exc_value, Interrupted):
            os._exit(ignored.exc_value.exit_code)
        return usual(ignored)

    return hook
