"""Tasks that are stepped in Python, learned by processes: threads would wait for each other.

A process is started once tasks have waited PATIENCE for those that learn already, so that small jobs never wait for one. It is
a new interpreter with this one's path, neither a copy of it nor a second run of its main module. It gets the learner once, then
batches, and ends when its input does: nothing is left behind, however this process ends.
"""

from __future__ import annotations

import os
import pickle
import queue
import signal
import subprocess
import sys
import threading
import time
from collections import Counter
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager, suppress
from typing import TYPE_CHECKING, Any, BinaryIO

from qinit_cli.pipeline.room import memory_available
from qinit_cli.pipeline.workers import Careful, Outcome, batches, in_words, results
from qinit_cli.signals import ENDING
from qinit_cli.watch import Watch

if TYPE_CHECKING:
    from qinit_cli.arrays import Integers
    from qinit_cli.pipeline.workers import Crew, Learn

PATIENCE = 1.0  # seconds: about what a process takes to start
PROCESS_BYTES = 256 * 2**20  # that one takes before it learns: 190 MB measured with gymnasium's CartPole
TELL_SECONDS = 0.1  # between two reports of progress
CLOSE_SECONDS = 2.0  # that a process may take to end
CHILD = "import sys; sys.path[:] = {path!r}; from qinit_cli.pipeline.processes import serve; serve()"


class ProcessDied(Exception):
    """The process that learned a batch ended."""


@contextmanager
def processes_here(jobs: int, learn: Learn, travels: Learn, family: Any, watch: Watch) -> Iterator[Crew]:
    """This process and up to `jobs` - 1 others, as a crew that learns; a thread here waits for each of them.

    The family is one that is stepped in Python; its `beyond_bounds` count what the others observe too. `travels`
    is the learner as other processes take it.
    """
    seats = Seats(learn, travels, family, watch)

    def outcomes(tasks: Integers, tick: Callable[[], None]) -> Iterator[Outcome]:
        def look() -> None:
            if watch.stopped:
                seats.stop()
            tick()

        return results(threads, lambda: jobs, seats, batches(tasks, jobs), lambda: watch.stopped, look)

    with ThreadPoolExecutor(jobs) as threads:
        try:
            yield outcomes
        finally:
            seats.close()


class Seats:
    """Who learns a batch: this process, or another one that is free or is started."""

    def __init__(self, learn: Learn, travels: Learn, family: Any, watch: Watch) -> None:
        self._learner, self._family, self._watch = (travels, family), family, watch
        self._here = Careful(learn, watch)
        self._free: list[Process | None] = [None]  # None is this process
        self._processes: list[Process] = []
        self._changed = threading.Condition()
        self._closed = False

    def __call__(self, batch: Integers) -> Outcome:
        """The outcome of the tasks with these ids; they have failed where the process that learned them ended."""
        seat = self._taken()
        try:
            if seat is None:
                return self._here(batch)
            outcome, beyond = seat.learn(batch, self._watch)
        except ProcessDied as died:
            return Outcome(batch[:0], {}, tuple((int(task), in_words(died)) for task in batch))
        finally:
            with self._changed:
                if seat is None or seat.alive:
                    self._free.append(seat)
                self._changed.notify()
        self._family.beyond_bounds.update(beyond)
        return outcome

    def _taken(self) -> Process | None:
        with self._changed:
            while not self._changed.wait_for(lambda: self._free, PATIENCE):
                if self._closed or self._watch.stopped or not self._has_room():
                    continue
                try:
                    started = Process(self._learner)
                except OSError:  # the system has none to give: the batch waits for a process that there is
                    continue
                self._processes.append(started)
                return started
            return self._free.pop()

    def _has_room(self) -> bool:
        """Whether there is memory for one more, beside those that have not taken theirs yet."""
        starting = sum(process.starting for process in self._processes)
        return memory_available() > PROCESS_BYTES * (1 + starting)

    def stop(self) -> None:
        """Batches end soon; to be called again until they have."""
        for process in self._processes:
            process.stop()

    def close(self) -> None:
        """Ends all processes; what they learn is lost."""
        with self._changed:
            self._closed = True
            for process in self._processes:
                process.close()


class Process:
    """Another process that learns."""

    def __init__(self, learner: tuple[Learn, Any]) -> None:
        _leave_signals_to_others()  # the process inherits it: Ctrl-C reaches all, and this one is to say what it means
        self._process = subprocess.Popen(
            [sys.executable, "-P", "-c", CHILD.format(path=sys.path)],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
        )
        self._lock = threading.Lock()
        self._stopped = False
        self._learner: tuple[Learn, Any] | None = learner
        self.alive = True

    def learn(self, batch: Integers, watch: Watch) -> tuple[Outcome, Counter[int]]:
        """The outcome, and the observations beyond an environment's bounds; ProcessDied where the process ends first."""
        told: Any = None
        part = watch.part()
        try:
            if self._learner is not None:
                self._tell(self._learner)
                self._learner = None
            self._tell(batch)
            assert self._process.stdout is not None
            while isinstance(told := pickle.load(self._process.stdout), Advance):
                part.add(*told)
        except (OSError, EOFError, ValueError, pickle.UnpicklingError) as error:
            self.close()
            part.take_back()
            raise ProcessDied(
                f"the process that learned it ended, code {self._process.returncode}"
            ) from error
        found: tuple[Outcome, Counter[int]] = told
        return found

    @property
    def starting(self) -> bool:
        """Whether it has not got the learner yet."""
        return self.alive and self._learner is not None

    def stop(self) -> None:
        """What is learned ends soon, if it has begun."""
        if not (self._stopped or self.starting):
            self._stopped = True
            with suppress(OSError, ValueError):  # it has ended
                self._tell(None)

    def close(self) -> None:
        """Ends the process."""
        if self.starting:  # it may not have begun to read, and whoever writes has the lock
            self._process.kill()
        self.alive = False
        with suppress(OSError, ValueError), self._lock:
            assert self._process.stdin is not None
            self._process.stdin.close()
        try:
            self._process.wait(CLOSE_SECONDS)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
        assert self._process.stdout is not None
        self._process.stdout.close()  # whoever waits for an answer has got its end by now

    def _tell(self, what: object) -> None:
        with self._lock:
            assert self._process.stdin is not None
            pickle.dump(what, self._process.stdin)
            self._process.stdin.flush()


class Advance(tuple[int, float, int]):
    """Steps, tasks and finished tasks since the last report."""

    __slots__ = ()


class Telling(Watch):
    """A watch whose progress another process is told."""

    def __init__(self, answers: BinaryIO) -> None:
        super().__init__()
        self._answers, self._told, self._when = answers, (0, 0.0, 0), time.monotonic()

    def add(self, steps: int, tasks: float = 0.0, finished: int = 0) -> None:
        """Counts, and tells now and then."""
        super().add(steps, tasks, finished)
        if time.monotonic() - self._when > TELL_SECONDS:
            self.tell()

    def tell(self) -> None:
        """Tells what has been counted since."""
        now, before = (self.steps, self.tasks, self.finished), self._told
        self._told, self._when = now, time.monotonic()
        send(self._answers, Advance(new - old for new, old in zip(now, before, strict=True)))


def send(stream: BinaryIO, what: object) -> None:
    """Writes it as a pickle."""
    pickle.dump(what, stream)
    stream.flush()


def serve() -> None:
    """In the other process: learns what stdin brings, and answers on what was stdout."""
    asked, answers = os.fdopen(os.dup(0), "rb"), os.fdopen(os.dup(1), "wb")
    with open(os.devnull, "rb") as nothing:
        os.dup2(nothing.fileno(), 0)
    os.dup2(2, 1)  # what an environment prints is no answer
    watch = Telling(answers)
    learn, family = pickle.load(asked)
    waiting: queue.SimpleQueue[Integers] = queue.SimpleQueue()

    def listen() -> None:
        try:
            while True:
                batch = pickle.load(asked)
                watch.stop() if batch is None else waiting.put(batch)
        finally:  # whoever asked has ended, or wants no more
            os._exit(0)

    threading.Thread(target=listen, daemon=True).start()
    careful = Careful(learn, watch)
    while True:
        outcome = careful(waiting.get())
        watch.tell()
        send(answers, (outcome, Counter(family.beyond_bounds)))
        family.beyond_bounds.clear()


def _leave_signals_to_others() -> None:
    signal.pthread_sigmask(signal.SIG_BLOCK, ENDING)
