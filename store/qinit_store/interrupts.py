"""Signals that wait while HDF5 writes through Python.

Handlers run between any two instructions of Python. One that raises in a function that HDF5 called crashes it.
"""

from __future__ import annotations

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType
from typing import Any

WAITING = (signal.SIGINT, signal.SIGTERM)


class HeldBack:
    """The signals that came; `deliver` is called where an exception does no harm."""

    def __init__(self) -> None:
        self._received: list[int] = []
        self._handlers: dict[int, Any] = {}

    def deliver(self) -> None:
        """Let the handlers have what came; they may raise."""
        while self._received:
            number = self._received.pop(0)
            handler = self._handlers[number]
            if callable(handler):
                handler(number, None)
            else:
                signal.signal(number, handler)
                signal.raise_signal(number)

    def hold(self) -> None:
        """From now on signals wait; outside the main thread they do not come anyway."""
        if threading.current_thread() is threading.main_thread():
            handlers = {number: signal.getsignal(number) for number in WAITING}
            kept = (None, signal.SIG_IGN)  # not ours to replace, or of no effect
            self._handlers = {number: one for number, one in handlers.items() if one not in kept}
            for number in self._handlers:
                signal.signal(number, self._receive)

    def release(self) -> None:
        """The handlers are in place again."""
        for number, handler in self._handlers.items():
            signal.signal(number, handler)

    def _receive(self, number: int, frame: FrameType | None) -> None:
        self._received.append(number)


@contextmanager
def held_back() -> Iterator[HeldBack]:
    """SIGINT and SIGTERM wait until they are delivered within the block, or until it is left."""
    signals = HeldBack()
    signals.hold()
    try:
        yield signals
    finally:
        signals.release()
        signals.deliver()
