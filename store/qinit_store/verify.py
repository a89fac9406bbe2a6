"""Whether an artefact is what was written, found out in a child process with little memory and time.

The child reads the whole file. What makes HDF5 crash, hang or ask for memory without end ends there.
"""

from __future__ import annotations

import json
import os
import re
import resource
import signal
import subprocess
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict, dataclass
from importlib import import_module
from pathlib import Path
from typing import IO, cast

from qinit_store.errors import Damaged, NotFound, NotOurs, StoreError, SystemFailed, TooNew
from qinit_store.interpreter import isolated
from qinit_store.presence import exists
from qinit_store.wording import counted, first_few, shell_line

MEMORY = 3 * 1024**3  # address space, of which numpy's thread pools alone take a few hundred MB
SECONDS = 600
UNREAD = "unread"
PROGRESS = re.compile(rb"read (\d{1,10}) of (\d{1,10})\n")  # a line of the child
PROGRESS_SECONDS = 0.2  # between two of them
PROGRAM = "from qinit_store.verify import child; child(sys.argv[1:])"
OPENING = "qinit_store.reading:open_doubtful"
PACKAGES = ("qinit_store", "numpy", "h5py")  # what it imports from elsewhere than the standard library
OUT_OF_MEMORY = "out of memory"  # a verdict
# what Python reports where memory ends before there can be one
WITHOUT_MEMORY = (b"MemoryError", b"failed to map segment", b"Cannot allocate memory")
ALLOWING = {"memory": "ulimit -v", "processor time": "ulimit -t"}  # what shows the limits of a process
ERRORS = {UNREAD: SystemFailed, **{error.state: error for error in (Damaged, NotOurs, TooNew)}}


@dataclass(frozen=True)
class Verification:
    """What verification found."""

    path: Path
    kind: str = ""
    tasks: int = 0
    content_sha256: str = ""
    damaged: tuple[int, ...] = ()  # the ids of the tasks whose digest does not hold
    problem: str = ""  # what else does not hold; "" where all does
    state: str = "sound"  # or "unread", where the system failed, and those of errors.Damaged

    @property
    def sound(self) -> bool:
        return self.state == "sound"

    def raise_if_damaged(self) -> None:
        """Damaged, naming the tasks, unless all holds; SystemFailed where it was not read to the end."""
        if self.damaged:
            raise Damaged(
                f"{self.path} is damaged: {len(self.damaged)} of {counted(self.tasks, 'task')} do not hold "
                f"({first_few(self.damaged, 10)});"
                f" `{shell_line('qinit', 'salvage', self.path)}` keeps the others"
            )
        if self.problem:
            raise ERRORS[self.state](self.problem)


def verify(
    path: Path,
    *,
    memory: int = MEMORY,
    seconds: int = SECONDS,
    opening: str = OPENING,
    told: Callable[[int, int], None] = lambda read, tasks: None,
) -> Verification:
    """What a child process limited to `memory` bytes and `seconds` finds, or to less where this process may have no more.

    `opening` is the function, MODULE:NAME, that opens the file there and knows what it must hold besides its digests. A child
    that a limit ends says nothing of the file: "unread". While it reads, `told` receives how many tasks of how many it has
    read. NotFound where there is nothing.
    """
    if not exists(path):
        raise NotFound(f"there is no {path}; `qinit list` shows what the store holds")
    memory, seconds = _soft(resource.RLIMIT_AS, memory), _soft(resource.RLIMIT_CPU, seconds)
    packages = (*PACKAGES, opening.partition(".")[0])
    command = isolated(PROGRAM, packages, str(path), str(memory), str(seconds), opening)
    try:
        done = _run(command, seconds + 30, told)
    except (TimeoutError, subprocess.TimeoutExpired):
        return _ran_out(path, "processor time", f"{seconds} s")
    if done.returncode == -signal.SIGXCPU:
        return _ran_out(path, "processor time", f"{seconds} s")
    if done.returncode == -signal.SIGKILL:
        problem = f"{path} could not be verified: the system ended the process that read it, as it does when memory runs out"
        return Verification(path, problem=problem, state=UNREAD)
    try:
        found = json.loads(done.stdout)
    except ValueError:
        if any(sign in done.stderr for sign in WITHOUT_MEMORY):
            return _ran_out(path, "memory", f"{memory / 1e9:.1f} GB")
        reason = f"ended by signal {-done.returncode}" if done.returncode < 0 else "ended without a verdict"
        problem = f"{path} is refused: the process that read it {reason}"
        return Verification(path, problem=problem, state=Damaged.state)
    if found == OUT_OF_MEMORY:
        return _ran_out(path, "memory", f"{memory / 1e9:.1f} GB")
    return Verification(**{**found, "path": path, "damaged": tuple(found["damaged"])})


def _run(
    command: list[str], seconds: int, told: Callable[[int, int], None]
) -> subprocess.CompletedProcess[bytes]:
    """The child's end: the last line that it printed, and its stderr; the lines before it are its progress.

    TimeoutError or subprocess.TimeoutExpired where it takes longer.
    """
    end, verdict = time.monotonic() + seconds, b""
    pipe = subprocess.PIPE
    with (
        ThreadPoolExecutor(2) as readers,
        subprocess.Popen(command, stdout=pipe, stderr=pipe, env=_environment()) as process,
    ):
        try:
            printed, complaints = cast(IO[bytes], process.stdout), cast(IO[bytes], process.stderr)
            errors = readers.submit(complaints.read)
            while line := readers.submit(printed.readline).result(end - time.monotonic()):
                verdict = line
                if progress := PROGRESS.fullmatch(line):
                    told(int(progress[1]), int(progress[2]))
            code = process.wait(max(0.0, end - time.monotonic()))
            return subprocess.CompletedProcess(command, code, verdict, errors.result())
        except BaseException:
            process.kill()
            raise


def child(arguments: list[str]) -> None:
    """What the child process does: limit itself, read, print how far it is and at last its verdict as JSON."""
    path, memory, seconds, opening = Path(arguments[0]), int(arguments[1]), int(arguments[2]), arguments[3]
    for limit, most in (
        (resource.RLIMIT_AS, memory),
        (resource.RLIMIT_CPU, seconds),
        (resource.RLIMIT_FSIZE, 0),
        (resource.RLIMIT_CORE, 0),
    ):
        resource.setrlimit(limit, (_soft(limit, most), resource.getrlimit(limit)[1]))
    try:
        found: object = {**asdict(_examined(path, opening)), "path": ""}
    except MemoryError:
        found = OUT_OF_MEMORY
    print(json.dumps(found))


class _Telling:
    """Prints how many tasks are read, now and then."""

    def __init__(self) -> None:
        self._next = time.monotonic() + PROGRESS_SECONDS

    def __call__(self, read: int, tasks: int) -> None:
        if time.monotonic() >= self._next:
            print(f"read {read} of {tasks}", flush=True)
            self._next = time.monotonic() + PROGRESS_SECONDS


def _soft(limit: int, wanted: int) -> int:
    """The limit to set: no more than this process was given, and of processor time less than what would kill without a word."""
    soft, hard = resource.getrlimit(limit)
    if hard != resource.RLIM_INFINITY and limit == resource.RLIMIT_CPU:
        hard -= 1
    given = [one for one in (soft, hard) if one != resource.RLIM_INFINITY]
    return max(0, min([wanted, *given]))


def _ran_out(path: Path, what: str, limit: str) -> Verification:
    problem = f"{path} could not be verified within {limit} of {what}, and may be sound; `{ALLOWING[what]}` shows the limit"
    return Verification(path, problem=problem, state=UNREAD)


def _examined(path: Path, opening: str) -> Verification:
    module, _, name = opening.partition(":")
    try:  # imported here, so that what h5py does is done under the limits
        with getattr(import_module(module), name)(path) as artefact:
            damaged = tuple(artefact.damaged_tasks(_Telling()).tolist())
            state, problem = "sound", ""
            if artefact.strangeness:
                state, problem = NotOurs.state, artefact.strangeness
            if damaged or artefact.trouble:
                state = Damaged.state
            if artefact.trouble:
                problem = f"{path} is damaged: {artefact.trouble}"
            return Verification(
                path,
                artefact.kind,
                artefact.task_count,
                artefact.content_sha256,
                damaged,
                problem,
                state,
            )
    except Damaged as damage:
        return Verification(path, problem=str(damage), state=damage.state)
    except StoreError as error:
        return Verification(path, problem=str(error), state=UNREAD)


def _environment() -> dict[str, str]:
    return {**os.environ, "OPENBLAS_NUM_THREADS": "1"}
