"""Calls on several threads, with their results in the order of the calls."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from typing import TypeVar

T = TypeVar("T")


def in_order(calls: Iterable[Callable[[], T]], threads: int, ahead: int) -> Iterator[T]:
    """What each of the `calls` returns or raises, on `threads` threads, this one among them.

    At most `ahead` results wait, so that memory is bounded. The iterator of the calls stays on this thread; so
    does all where `threads` is 1.
    """
    if threads == 1:
        for call in calls:
            yield call()
        return
    waiting: deque[tuple[Future[T], Callable[[], T]]] = deque()
    with ThreadPoolExecutor(threads - 1, "store") as others:
        try:
            for call in calls:
                waiting.append((others.submit(call), call))
                if len(waiting) > ahead:
                    yield _result(*waiting.popleft())
            while waiting:
                yield _result(*waiting.popleft())
        finally:
            for future, _ in waiting:
                future.cancel()


def _result(future: Future[T], call: Callable[[], T]) -> T:
    # a call that no other thread has begun is cancelled there and made here, instead of waiting
    return call() if future.cancel() else future.result()
