"""The seam between stages and the machine: batches go through one concurrent.futures.Executor, results come as they are ready.

Kernels run without the interpreter's lock, so threads use every core; a cluster's executor fits the same seam, and processes
do where steps are Python's.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import Executor, Future, ThreadPoolExecutor
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from queue import Empty, SimpleQueue
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np

if TYPE_CHECKING:
    from qinit_cli.arrays import Integers
    from qinit_cli.watch import Watch

    Learn = Callable[[Integers, Watch], tuple[Integers, dict[str, Any]]]

Batch = TypeVar("Batch")
Result = TypeVar("Result")

# tasks: the kernels learn four or eight side by side, and a few long ones (a car that is pushed back takes twelve times the
# steps) must not leave the other lanes idle; few enough that little is lost with a batch
BATCH = 32
IN_FLIGHT = 2  # batches per worker: one at work, one waiting
TICK = 0.1  # seconds between two looks at progress


@dataclass(frozen=True)
class Outcome:
    """What became of a batch of tasks."""

    ids: Integers  # of those that were learned
    rows: dict[str, Any]  # column name: array with a leading task axis; empty where no task was learned
    failures: tuple[tuple[int, str], ...] = ()  # tasks, and errors in words


@dataclass(frozen=True)
class Careful:
    """Learns a batch; where that fails, one task at a time, so that a bad task does not take others with it."""

    learn: Learn
    watch: Watch

    def __call__(self, batch: Integers) -> Outcome:
        """The outcome of the tasks with these ids; no exception of theirs is raised."""
        watch = self.watch.part()
        try:
            return Outcome(*self.learn(batch, watch))
        except Exception as error:
            watch.take_back()
            if len(batch) == 1:
                return Outcome(batch[:0], {}, ((int(batch[0]), in_words(error)),))
        return _together([self(batch[place : place + 1]) for place in range(len(batch))])


def in_words(error: BaseException) -> str:
    """Type and words of an error, as it is told: somebody else's may not travel between processes."""
    return f"{type(error).__name__}: {error}"


def _together(outcomes: list[Outcome]) -> Outcome:
    learned = [outcome for outcome in outcomes if len(outcome.ids)]
    names = learned[0].rows if learned else {}
    return Outcome(
        ids=np.concatenate([outcome.ids for outcome in outcomes]),
        rows={name: np.concatenate([outcome.rows[name] for outcome in learned]) for name in names},
        failures=tuple(failure for outcome in outcomes for failure in outcome.failures),
    )


Crew = Callable[
    ["Integers", Callable[[], None]], Iterator[Outcome]
]  # outcomes of tasks; calls the second now and then


@contextmanager
def threads_here(jobs: int, learn: Learn, watch: Watch) -> Iterator[Crew]:
    """So many threads of this process, as a crew that learns."""
    with ThreadPoolExecutor(jobs) as threads:
        yield lambda tasks, tick: results(
            threads,
            lambda: jobs,
            Careful(learn, watch),
            batches(tasks, jobs),
            lambda: watch.stopped,
            tick,
        )


def batches(tasks: Integers, jobs: int) -> list[Integers]:
    """The task ids in batches of at most BATCH, as many for one worker as for another; no number depends on it."""
    busy = min(jobs, len(tasks))  # else as many empty batches are made as jobs are asked for
    if not busy:
        return []
    rounds = -(-len(tasks) // (BATCH * busy))
    return [batch for batch in np.array_split(tasks, rounds * busy) if len(batch)]


def results(
    executor: Executor,
    jobs: Callable[[], int],
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
    ended: SimpleQueue[Future[Result]] = SimpleQueue()  # wait() would look at all that run each time
    ticked = -math.inf
    try:
        while True:
            while (
                not stopped()
                and len(running) < IN_FLIGHT * jobs()
                and (batch := next(ahead, None)) is not None
            ):
                future = executor.submit(learn, batch)
                running.add(future)
                future.add_done_callback(ended.put)
            if not running:
                return
            done = _ended(ended, TICK)
            if not done or time.monotonic() - ticked >= TICK:
                tick()
                ticked = time.monotonic()
            for future in done:
                running.remove(future)
                yield future.result()
    finally:
        for future in running:
            future.cancel()


def _ended(queue: SimpleQueue[Result], seconds: float) -> list[Result]:
    """What is in the queue, awaited for so long where it is empty."""
    found: list[Result] = []
    with suppress(Empty):
        found.append(queue.get(timeout=seconds))
        while True:
            found.append(queue.get_nowait())
    return found
