"""Learning on a Dask cluster, through the same seam as threads: only this process, the head, writes anything.

Imported only with --dask, and by the workers. Dask sends a batch again to another worker when its worker dies, and every
batch answers once, so nothing is counted twice; numbers do not depend on where or in what batches tasks are learned. An
answer is plain bytes, and is checked before anything of it is saved.
"""

from __future__ import annotations

import json
import logging
import os
import platform
import re
import shlex
import stat
import threading
import time
import uuid
import warnings
from collections import deque
from collections.abc import Callable, Iterator
from concurrent.futures import Executor, Future
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from functools import cache, partial
from importlib.metadata import version
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar
from weakref import WeakValueDictionary

import numpy as np

from qinit_cli.errors import NotAllowed, QinitError, UsageError
from qinit_cli.pipeline.answers import Unfit, WorkerFailed, opened, packed
from qinit_cli.pipeline.workers import IN_FLIGHT, Careful, Outcome, batches, in_words, results
from qinit_cli.watch import Watch
from qinit_store.errors import StoreError, SystemFailed

if TYPE_CHECKING:
    from distributed import Client

    from qinit_cli.arrays import Integers
    from qinit_cli.pipeline.workers import Crew, Learn
    from qinit_store.schema import Schema

Result = TypeVar("Result")

SCHEDULER_SECONDS = (
    30.0  # that a scheduler may take to answer, as Dask's own clients grant it: a busy one takes many
)
VERSION_SECONDS = 30.0  # that the workers may take to say what they have installed: they import it for that
WORKER_SECONDS = 10.0  # that the first worker may take to appear
CLOSE_SECONDS = (
    2.0  # that workers may take to hand in what they have once a signal came, and the client to close
)
LOOK_SECONDS = 1.0  # between two looks at how many threads the cluster has
OVERHEAD = 5e-3  # seconds of head and scheduler per batch, measured (docs/cluster.md) ...
OVERHEAD_SHARE = 0.02  # ... and the share of a batch's work that it may come to
MOST_BYTES = 64 * 2**20  # of rows that travel together
ADDRESS = re.compile(r"[a-z]+://[\w.:\[\]-]+:\d+")
SAME = ("qinit", "numpy", "numba", "distributed")  # packages whose versions must not differ


class WorkersDied(Exception):
    """The workers that learned a batch died, again and again."""


class Unequal(Exception):
    """A worker that came later has other versions."""


@dataclass(frozen=True, eq=False)
class Errand:
    """What a worker does: learns batches. It travels to each worker once."""

    run: str  # tells this run's batches from those of others on the same worker
    learn: Learn
    schema: Schema  # of what is learned
    versions: dict[str, str]  # of the head

    def __call__(self, batch: Integers) -> bytes:
        """The outcome of the tasks with these ids, packed; nothing once the run was stopped. Unequal if versions differ."""
        if versions() != self.versions:
            raise Unequal(_difference(self.versions, versions()))
        watch = _watch(self.run)
        try:
            return packed(_nothing() if watch is None else Careful(self.learn, watch)(batch), self.schema)
        except Exception as error:
            words = in_words(error)
        # not from within: an error that cannot be pickled, as one behind it, would never reach the head
        raise WorkerFailed(words)


@contextmanager
def crew(place: str, learn: Learn, watch: Watch, schema: Schema) -> Iterator[Crew]:
    """The workers of the cluster at an address, or of a scheduler file, as a crew that learns.

    UsageError without the package; SystemFailed (7) without a scheduler or workers, once the scheduler is lost, and where a
    worker's answer does not fit what it was asked; NotAllowed (4) where versions differ. Once `watch` is stopped, workers hand
    in what is finished and the rest is cancelled.
    """
    with _connection(place) as connection, connection.crew():
        cluster = Cluster(connection.client, place, learn, watch, schema, connection.threads)
        with cluster:
            yield cluster.outcomes
    cluster.complain()


@contextmanager
def shared(place: str) -> Iterator[None]:
    """Within the block crews at this place, in whatever thread, have one connection together and share the cluster's threads.

    Errors are those of `crew`. A signal reaches makes in other threads than the main one by `signals.asking_first` around them.
    """
    with _LOCK:
        there = place in _SHARED
    if there:
        yield
        return
    with connected(place) as client:
        connection = Connection(client, place)
        with _LOCK:
            _SHARED[place] = connection
        try:
            yield
        finally:
            with _LOCK:
                del _SHARED[place]


@contextmanager
def _connection(place: str) -> Iterator[Connection]:
    """The connection that is shared, else one for this crew alone."""
    with _LOCK:
        there = _SHARED.get(place)
    if there is not None:
        yield there
        return
    with connected(place) as client:
        yield Connection(client, place)


@contextmanager
def connected(place: str) -> Iterator[Client]:
    """A client of the cluster, of which one worker at least has come and none has other versions."""
    try:
        from distributed import Client
    except ImportError as error:
        raise UsageError(
            "--dask needs the package distributed: in your clone of qinit, pip install -e '.[dask]'"
        ) from error
    _quieten()
    address = _address(place)

    class Ours(Client):  # type: ignore[misc]  # Dask has no types
        def __del__(self) -> None:
            """Does nothing: it is closed below, and Dask's own waits ten seconds for whatever speaks at the address."""

    make = partial(Ours, address, timeout=SCHEDULER_SECONDS, set_as_default=False, name="qinit")
    try:
        with _without_warnings():  # about versions: those that matter are compared below
            client = _within(SCHEDULER_SECONDS, make)
    except Exception as error:  # of whatever speaks there: what cannot be read ends in an error of any kind
        raise SystemFailed(
            f"no Dask scheduler answers at {address} within {SCHEDULER_SECONDS:.0f} s; start one with dask scheduler, "
            "or leave out --dask"
        ) from error
    try:
        _asked(address, WORKER_SECONDS + SCHEDULER_SECONDS, partial(_expect_workers, client, address))
        _asked(address, VERSION_SECONDS, partial(_refuse_other_versions, client))
        yield client
    finally:
        with suppress(OSError, RuntimeError):  # a scheduler that is gone cannot be told good-bye
            _within(CLOSE_SECONDS, partial(client.close, timeout=CLOSE_SECONDS))


@contextmanager
def _without_warnings() -> Iterator[None]:
    with _WARNINGS, warnings.catch_warnings():
        warnings.simplefilter("ignore")
        yield


def _asked(address: str, seconds: float, ask: Callable[[], Result]) -> Result:
    """What the scheduler there answers; SystemFailed where it is silent, or answers what no scheduler does."""
    try:
        return _within(seconds, ask)
    except (QinitError, StoreError):
        raise
    except OSError as error:
        raise SystemFailed(f"the Dask scheduler at {address} no longer answers; start it anew") from error
    except Exception as error:  # what cannot be read ends in an error of any kind, in Dask's code or in ours
        raise SystemFailed(
            f"what answers at {address} answers as no Dask scheduler does ({type(error).__name__}); start it anew"
        ) from error


def _within(seconds: float, call: Callable[[], Result]) -> Result:
    """What the call returns or raises; TimeoutError where it takes longer, and then it is left to itself.

    Dask waits without end for a scheduler that accepts and stays silent, and so that no signal ends the wait.
    """
    ended: Future[Result] = Future()

    def run() -> None:
        try:
            ended.set_result(call())
        except BaseException as error:
            ended.set_exception(error)

    threading.Thread(target=run, daemon=True).start()
    return ended.result(timeout=seconds)


def threads(place: str) -> int:
    """How many threads the cluster has now."""
    with _connection(place) as connection:
        return connection.threads()


@cache
def versions() -> dict[str, str]:
    """Those of this process that a worker's must equal; of Python the part that pickles depend on."""
    return {"python": _release(platform.python_version())} | {package: version(package) for package in SAME}


_LOCK = threading.Lock()
_WARNINGS = threading.Lock()  # the filters of warnings are the process's, not a thread's
_SHARED: dict[str, Connection] = {}  # by place
_WATCHES: WeakValueDictionary[str, Watch] = WeakValueDictionary()  # of the runs that this worker learns for
_STOPPED: set[str] = set()  # runs that want no more


def _watch(run: str) -> Watch | None:
    with _LOCK:
        if run in _STOPPED:
            return None
        watch = _WATCHES.get(run)
        if watch is None:
            watch = _WATCHES[run] = Watch()
        return watch


def stop_there(run: str) -> None:
    """On a worker: batches of this run end soon, and none begins."""
    with _LOCK:
        _STOPPED.add(run)
        if (watch := _WATCHES.get(run)) is not None:
            watch.stop()


class Connection:
    """A client and how many threads its cluster has, for one crew or for several that share both."""

    def __init__(self, client: Client, place: str) -> None:
        self.client = client
        self._count = _asked(place, SCHEDULER_SECONDS, partial(_threads, client))
        self._counting: threading.Thread | None = None
        self._crews = 0
        self._lock = threading.Lock()

    @contextmanager
    def crew(self) -> Iterator[None]:
        """Within the block one more shares the threads."""
        with self._lock:
            self._crews += 1
        try:
            yield
        finally:
            with self._lock:
                self._crews -= 1

    def threads(self) -> int:
        """How many threads a crew has, at least 1: the cluster may grow and shrink, and a batch waits while it has none."""
        with self._lock:
            if self._counting is None or not self._counting.is_alive():
                # beside the main thread: a scheduler that is silent must not hold up the end
                self._counting = threading.Thread(target=self._recount, daemon=True)
                self._counting.start()
            return max(1, -(-self._count // max(1, self._crews)))

    def _recount(self) -> None:
        time.sleep(LOOK_SECONDS)
        if self.client.status == "running":
            # the client may be closed meanwhile, and what answers may answer anything: the count stays as it was
            with suppress(Exception):
                self._count = _threads(self.client) or self._count


def _given(function: Callable[..., Any]) -> Callable[..., Any]:
    return function


def _called(function: Callable[..., Any], *arguments: Any) -> Any:
    return function(*arguments)


@dataclass(frozen=True)
class Answer:
    """What came back for a batch, not looked at yet."""

    key: str  # by which the scheduler knows the batch
    batch: Integers
    future: Future[Any]  # that has ended


class Cluster(Executor):
    """The executor of a client, whose batches always come to an end: also when workers, or the scheduler, die."""

    def __init__(
        self,
        client: Client,
        place: str,
        learn: Learn,
        watch: Watch,
        schema: Schema,
        threads: Callable[[], int],
    ) -> None:
        self._client, self._place, self._watch = client, place, watch
        self._threads = threads  # of the cluster that are this crew's
        self._executor = client.get_executor(pure=False)
        self._errand = Errand(uuid.uuid4().hex, learn, schema, versions())
        self._sent: dict[Callable[..., Any], Any] = {}  # function: the Dask future that it is on the cluster
        self._open: dict[Future[Answer | None], Future[Any]] = {}  # ours: Dask's
        self._lock = threading.Lock()
        self._deadline = float("inf")  # of batches, once stopped
        self._lost: Exception | None = None
        self._unfit = False  # whether an answer did not fit

    def outcomes(self, tasks: Integers, tick: Callable[[], None]) -> Iterator[Outcome]:
        """What became of the tasks with these ids, batch by batch; `tick` is called about ten times a second."""
        sizes = BatchSizes(self._errand.schema.task_bytes)

        def look() -> None:
            self._look()
            tick()

        waiting = sizes.batches(tasks, self._threads)
        # what it is given returns bytes, and what it yields is what `submit` made of them
        answers: Any = results(self, self._threads, self._errand, waiting, lambda: self._watch.stopped, look)
        for answer in answers:
            outcome = _nothing() if answer is None else self._outcome(answer)
            sizes.heed(outcome)
            yield outcome

    def submit(self, function: Callable[..., Any], /, *arguments: Any, **keywords: Any) -> Future[Any]:
        """The future of function(batch) on a worker; its result is an answer, None where none is awaited any longer."""
        [batch] = arguments
        if function not in self._sent:
            self._sent[function] = self._send(function)
        key = f"qinit-{uuid.uuid4().hex}"
        theirs = self._executor.submit(_called, self._sent[function], batch, key=key)
        ours: Future[Answer | None] = Future()
        ours.set_running_or_notify_cancel()  # from here on it ends in a result
        with self._lock:
            self._open[ours] = theirs
        theirs.add_done_callback(lambda _: self._close(ours, Answer(key, batch, theirs)))
        return ours

    def shutdown(self, wait: bool = True, *, cancel_futures: bool = False) -> None:
        """Cancels what is pending; nothing is waited for."""
        for ours in list(self._open):
            self._close(ours, None)
        with suppress(TimeoutError):
            _within(CLOSE_SECONDS, partial(self._executor.shutdown, wait=False))

    def _send(self, function: Callable[..., Any]) -> Any:
        """As a task, not as scattered data: Dask makes it again when the worker that holds it dies."""
        with _without_warnings():  # that it is large, which matters to those who send it with every batch
            return self._client.submit(_given, function, pure=False)

    def _look(self) -> None:
        """Once stopped, tells the workers, and gives up on what takes too long."""
        if not self._watch.stopped:
            return
        if self._deadline == float("inf"):
            self._deadline = time.monotonic() + CLOSE_SECONDS
            # beside the main thread: a worker that hangs must not hold up the end
            threading.Thread(target=self._stop_workers, daemon=True).start()
        elif time.monotonic() > self._deadline:
            for ours in list(self._open):
                self._close(ours, None)

    def complain(self) -> None:
        """Raises what ended the work on the cluster before its time, if anything did."""
        if self._lost is not None:
            raise self._lost

    def _stop_workers(self) -> None:
        with suppress(Exception):  # the deadline holds whatever happens here
            self._client.run(stop_there, self._errand.run, on_error="ignore")

    def _close(self, ours: Future[Answer | None], answer: Answer | None) -> None:
        """Ends the wait for a batch; what came is looked at in the main thread, for Dask's own may not wait."""
        with self._lock:
            theirs = self._open.pop(ours, None)
        if theirs is None:
            return
        theirs.cancel()
        ours.set_result(answer)

    def _outcome(self, answer: Answer) -> Outcome:
        error: BaseException | None
        theirs, batch = answer.future, answer.batch
        if theirs.cancelled():
            return self._end(
                SystemFailed(
                    f"the Dask scheduler at {self._place} was lost; what came back is saved, and the same command goes on"
                )
            )
        if (error := theirs.exception()) is None:
            return self._opened(answer)
        if isinstance(error, Unequal):
            return self._end(NotAllowed(f"a worker has {error}"))
        if type(error).__name__ == "KilledWorker":
            died = in_words(WorkersDied("the workers that learned its batch died, again and again"))
            return Outcome(batch[:0], {}, tuple((int(task), died) for task in batch))
        words = str(error) if isinstance(error, WorkerFailed) else f"{type(error).__name__}: {error}"
        said = " ".join(words.split())  # no task's fault: Careful catches those
        return self._end(
            SystemFailed(f"the Dask cluster at {self._place} cannot run what it is sent, {said}")
        )

    def _opened(self, answer: Answer) -> Outcome:
        # workers that were told to stop answer for what they have finished; once one lied, none is believed that does
        whole = self._unfit or not self._watch.stopped
        try:
            outcome = opened(answer.future.result(), answer.batch, self._errand.schema, whole=whole)
        except Unfit as reason:
            self._unfit = True
            return self._end(
                SystemFailed(
                    f"{self._worker(answer.key)} gave no usable answer, {reason}; nothing of that batch is saved: stop that "
                    "worker, and the same command goes on"
                )
            )
        self._watch.add(int(outcome.rows["steps"].sum()) if len(outcome.ids) else 0)
        return outcome

    def _worker(self, key: str) -> str:
        """Who answered, as the scheduler knows it."""
        ask = partial(self._client.sync, self._client.scheduler.who_has, keys=[key])
        try:
            [[address]] = _asked(self._place, LOOK_SECONDS, ask).values()
        except (SystemFailed, ValueError, TypeError, AttributeError):  # it is silent, or names no worker
            return f"a worker of the Dask cluster at {self._place}"
        return f"the worker {address}"

    def _end(self, error: Exception) -> Outcome:
        if not self._watch.stopped:
            self._lost = error
            self._watch.stop()
        return _nothing()


@dataclass
class BatchSizes:
    """How many tasks make a batch: those of the threads, joined until a batch is worth what scheduling it costs."""

    task_bytes: int
    seconds: float = 0.0  # in the kernels, of the tasks that came back
    tasks: int = 0
    _waiting: deque[Integers] = field(default_factory=deque)

    def heed(self, outcome: Outcome) -> None:
        """Learns from what came back how long a task takes."""
        if len(outcome.ids):
            self.seconds += float(outcome.rows["seconds"].sum())
            self.tasks += len(outcome.ids)

    def batches(self, tasks: Integers, jobs: Callable[[], int]) -> Iterator[Integers]:
        """The task ids, in order, in batches."""
        self._waiting.extend(batches(tasks, jobs()))
        while self._waiting:
            count = self._joined(len(self._waiting[0]), jobs())
            yield np.concatenate([self._waiting.popleft() for _ in range(count)])

    def _joined(self, tasks: int, jobs: int) -> int:
        """How many of the small batches, of so many tasks each, make the next one."""
        each = tasks * self.seconds / self.tasks if self.tasks else 0.0
        if not each:
            return 1
        worth = -(-worthwhile(jobs) // each)
        fits = MOST_BYTES // max(1, tasks * self.task_bytes)
        fair = len(self._waiting) // (IN_FLIGHT * jobs)  # the last ones are shared by all
        return int(max(1, min(worth, fits, fair)))


def worthwhile(jobs: int) -> float:
    """Seconds of work that a batch should hold, so that neither its own overhead nor that of all jobs together shows.

    The head serves one batch after the other: `jobs` threads ask for one in the time that one of them takes to learn it.
    """
    return OVERHEAD * max(1 / OVERHEAD_SHARE, 2.0 * jobs)


def _nothing() -> Outcome:
    return Outcome(np.empty(0, np.int64), {})


def _quieten() -> None:
    """What matters of the loggers' news is said in a sentence of ours."""
    for name in list(logging.root.manager.loggerDict):
        if name.partition(".")[0] in ("distributed", "tornado"):
            logging.getLogger(name).setLevel(logging.CRITICAL)


def _address(place: str) -> str:
    """The scheduler's address: as it stands, or from a scheduler file."""
    path = Path(place)
    if not path.is_file():
        return place
    _check_file(path)
    try:
        address = json.loads(path.read_text())["address"]
    except (OSError, ValueError, KeyError, TypeError, RecursionError) as error:
        raise UsageError(f"--dask {place}: this is no scheduler file, which dask scheduler writes") from error
    if not isinstance(address, str) or not ADDRESS.fullmatch(address):
        raise UsageError(f"--dask {place}: this scheduler file names no address such as tcp://127.0.0.1:8786")
    return address


def _check_file(path: Path) -> None:
    """UsageError where another user could say which scheduler this is: it would run code here."""
    found = path.stat()
    if found.st_uid not in (0, os.geteuid()) or found.st_mode & stat.S_IWOTH:
        reason = (
            f"anybody may write it; forbid that with chmod o-w {shlex.quote(str(path))}"
            if found.st_uid in (0, os.geteuid())
            else f"it belongs to another user (uid {found.st_uid}), whose scheduler could run code here"
        )
        raise UsageError(f"--dask {path}: {reason}, or name the address itself if you trust it")


def _expect_workers(client: Client, address: str) -> None:
    try:
        client.wait_for_workers(1, timeout=WORKER_SECONDS)
    except TimeoutError as error:
        raise SystemFailed(
            f"the Dask scheduler at {address} has no workers after {WORKER_SECONDS:.0f} s; start some with "
            f"dask worker {address}"
        ) from error


def _refuse_other_versions(client: Client) -> None:
    ours = versions()
    told: dict[str, Any] = client.get_versions(check=False, packages=list(SAME))
    everybody = {"scheduler": told["scheduler"]} | {
        f"worker {at}": one for at, one in told["workers"].items()
    }
    for name, there in everybody.items():  # the scheduler reads what it passes on
        packages = there["packages"] | {"python": _release(there["host"]["python"])}
        found = {package: packages.get(package) for package in ours}
        if found != ours:
            raise NotAllowed(
                f"the {name} has {_difference(ours, found)}; results would differ: install the same there"
            )


def _difference(ours: dict[str, str], there: dict[str, Any]) -> str:
    return ", ".join(
        f"{package} {there.get(package) or 'missing'} where this process has {here}"
        for package, here in ours.items()
        if there.get(package) != here
    )


def _release(python: str) -> str:
    return ".".join(python.split(".")[:2])


def _threads(client: Client) -> int:
    """How many the cluster has now; 0 where the scheduler does not say."""
    return int(client.scheduler_info(n_workers=0).get("total_threads", 0))
