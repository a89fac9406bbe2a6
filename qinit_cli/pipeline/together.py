"""Several artefacts made at once by threads of this process: on a cluster whose connection they share, or on its own cores.

    with cluster.shared(address):
        for name, made in together({name: partial(make, plan, keeping, machine)}, {}, at_once=8):
            made.result()

The head's work is Python's and HDF5's, which let one thread at a time work: more threads make it no faster, they keep workers
busy that one artefact alone, with few tasks left, would leave idle.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Hashable, Iterator, Mapping
from concurrent.futures import FIRST_COMPLETED, Future, ThreadPoolExecutor, wait
from typing import TypeVar

from qinit_cli import signals
from qinit_cli.errors import Interrupted

Key = TypeVar("Key", bound=Hashable)
Result = TypeVar("Result")


def together(
    calls: Mapping[Key, Callable[[], Result]], needs: Mapping[Key, Collection[Key]], at_once: int
) -> Iterator[tuple[Key, Future[Result]]]:
    """Which of the calls has ended, and its future, in the order in which they end; so many are at work at once.

    They begin in their own order, each once those that it `needs` have ended and whoever asks has taken note of that. A signal
    stops all that are at work, as it would one alone: what they had finished is saved, none begins any more, and Interrupted is
    raised in the end. What a call raises is its future's.
    """
    waiting, ended = dict(calls), set[Key]()
    running: dict[Future[Result], Key] = {}
    with signals.asking_first(lambda: None) as received, ThreadPoolExecutor(at_once) as threads:
        while (waiting and not received) or running:
            for key in list(waiting):
                if received or len(running) == at_once:
                    break
                if ended.issuperset(needs.get(key, ())):
                    running[threads.submit(waiting.pop(key))] = key
            if not running:
                if received:  # since the loop's own look at it
                    break
                raise ValueError(f"{next(iter(waiting))} needs what is not made")
            for future in wait(running, return_when=FIRST_COMPLETED).done:
                key = running.pop(future)
                ended.add(key)
                if not isinstance(future.exception(), Interrupted):
                    yield key, future
    if received:
        raise Interrupted("", 128 + received[0])
