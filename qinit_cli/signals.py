"""SIGINT and SIGTERM: by default they end the command at once; while tasks are learned, the first one only asks to stop.

Nothing that is saved can be harmed by ending at once (the store's protocol), so that is safe everywhere else.
"""

from __future__ import annotations

import signal
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import FrameType

from qinit_cli.errors import Interrupted


def exit_at_once(number: int, frame: FrameType | None) -> None:
    """Raises Interrupted with the shell's exit code for the signal."""
    raise Interrupted("", 128 + number)


def install() -> None:
    """Makes both signals end the command with their exit code and no traceback."""
    signal.signal(signal.SIGINT, exit_at_once)
    signal.signal(signal.SIGTERM, exit_at_once)


@contextmanager
def asking_first(stop: Callable[[], None]) -> Iterator[list[int]]:
    """Within the block the first signal calls `stop`, and its number is appended to the list; a second ends at once."""
    received: list[int] = []

    def ask(number: int, frame: FrameType | None) -> None:
        if received:
            exit_at_once(number, frame)
        received.append(number)
        stop()

    before = {number: signal.signal(number, ask) for number in (signal.SIGINT, signal.SIGTERM)}
    try:
        yield received
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
