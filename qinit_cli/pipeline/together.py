"""Several artefacts made at once by threads of this process, which learn elsewhere: on a cluster whose connection they share.

    with cluster.shared(address):
        for number, made in together([partial(make, plan, keeping, machine) for plan in plans], at_once=8):
            made.result()

The head's work is Python's and HDF5's, which let one thread at a time work: more threads make it no faster, they keep workers
busy that one artefact alone, with few tasks left, would leave idle.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Future, ThreadPoolExecutor, as_completed
from typing import TypeVar

from qinit_cli import signals

Result = TypeVar("Result")


def together(calls: Sequence[Callable[[], Result]], at_once: int) -> Iterator[tuple[int, Future[Result]]]:
    """Which of the calls has ended, and its future, in the order in which they end; so many are at work at once.

    A signal stops all that are at work, as it would one alone: the futures of those end with Interrupted, what they had
    finished is saved, and the futures of those that had not begun are cancelled. What else a call raises is its own.
    """
    futures: dict[Future[Result], int] = {}

    def stop() -> None:
        for future in list(futures):
            future.cancel()

    with signals.asking_first(stop) as received, ThreadPoolExecutor(at_once) as threads:
        for number, call in enumerate(calls):
            futures[threads.submit(call)] = number
        if received:  # while they were handed over
            stop()
        try:
            for future in as_completed(futures):
                yield futures[future], future
        finally:
            stop()
