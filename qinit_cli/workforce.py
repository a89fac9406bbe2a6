"""The seam between stages and the machine: batches go through one concurrent.futures.Executor, results come as they are ready.

Kernels run without the interpreter's lock, so threads use every core; a cluster's executor fits the same seam.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import FIRST_COMPLETED, Executor, Future, wait
from typing import TYPE_CHECKING, TypeVar

if TYPE_CHECKING:
    from qinit_cli.arrays import Integers

Batch = TypeVar("Batch")
Result = TypeVar("Result")

BATCH = (
    16  # tasks: enough to keep every lane of the kernels busy, few enough that little is lost with a batch
)
IN_FLIGHT = 2  # batches per worker: one at work, one waiting
TICK = 0.1  # seconds between two looks at progress


def batches(tasks: Integers, jobs: int) -> list[Integers]:
    """The task ids in batches of at most BATCH, as many for one worker as for another; no number depends on it."""
    import numpy as np

    rounds = -(-len(tasks) // (BATCH * jobs))
    return [batch for batch in np.array_split(tasks, rounds * jobs) if len(batch)] if rounds else []


def results(
    executor: Executor,
    jobs: int,
    learn: Callable[[Batch], Result],
    waiting: Iterable[Batch],
    stopped: Callable[[], bool],
    tick: Callable[[], None],
) -> Iterator[Result]:
    """Yields `learn(batch)` in order of completion; once `stopped`, nothing new is submitted and what runs is awaited.

    `tick` is called about ten times a second. An exception of a batch is raised here, after the others were cancelled.
    """
    ahead = iter(waiting)
    running: set[Future[Result]] = set()
    try:
        while True:
            while (
                not stopped() and len(running) < IN_FLIGHT * jobs and (batch := next(ahead, None)) is not None
            ):
                running.add(executor.submit(learn, batch))
            if not running:
                return
            done, running = wait(running, timeout=TICK, return_when=FIRST_COMPLETED)
            tick()
            for future in done:
                yield future.result()
    finally:
        for future in running:
            future.cancel()
