"""Whether an artefact is what was written, found out in a child process with little memory and time.

The child reads the whole file. What makes HDF5 crash, hang or ask for memory without end ends there.
"""

from __future__ import annotations

import json
import os
import resource
import subprocess
from dataclasses import asdict, dataclass
from pathlib import Path

from qinit_store.errors import Damaged, NotFound, NotOurs, StoreError, SystemFailed, TooNew
from qinit_store.interpreter import isolated
from qinit_store.presence import exists
from qinit_store.wording import shell_line

MEMORY = 3 * 1024**3  # address space, of which numpy's thread pools alone take a few hundred MB
SECONDS = 600
UNREAD = "unread"
PROGRAM = "from qinit_store.verify import child; child(sys.argv[1:])"
PACKAGES = ("qinit_store", "numpy", "h5py")  # what it imports from elsewhere than the standard library
ERRORS = {UNREAD: SystemFailed, **{error.state: error for error in (Damaged, NotOurs, TooNew)}}


@dataclass(frozen=True)
class Verdict:
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
            some = ", ".join(map(str, self.damaged[:10])) + (", ..." if len(self.damaged) > 10 else "")
            raise Damaged(
                f"{self.path} is damaged: {len(self.damaged)} of {self.tasks} tasks do not hold ({some});"
                f" `{shell_line('qinit', 'salvage', self.path)}` keeps the others"
            )
        if self.problem:
            raise ERRORS[self.state](self.problem)


def verify(path: Path, *, memory: int = MEMORY, seconds: int = SECONDS) -> Verdict:
    """What a child process limited to `memory` bytes and `seconds` finds; NotFound where there is nothing."""
    if not exists(path):
        raise NotFound(f"there is no {path}; `qinit list` shows what there is")
    command = isolated(PROGRAM, PACKAGES, str(path), str(memory), str(seconds))
    try:
        done = subprocess.run(
            command, capture_output=True, timeout=seconds + 30, env=_environment(), check=False
        )
    except subprocess.TimeoutExpired:
        problem = f"{path} is refused: reading it takes more than {seconds} s"
        return Verdict(path, problem=problem, state=Damaged.state)
    try:
        found = json.loads(done.stdout)
    except ValueError:
        reason = f"ended by signal {-done.returncode}" if done.returncode < 0 else "ended without a verdict"
        problem = f"{path} is refused: the process that read it {reason}"
        return Verdict(path, problem=problem, state=Damaged.state)
    return Verdict(path, **{**found, "damaged": tuple(found["damaged"])})


def child(arguments: list[str]) -> None:
    """What the child process does: limit itself, read, print its verdict as JSON."""
    path, memory, seconds = Path(arguments[0]), int(arguments[1]), int(arguments[2])
    for limit, most in (
        (resource.RLIMIT_AS, memory),
        (resource.RLIMIT_CPU, seconds),
        (resource.RLIMIT_FSIZE, 0),
        (resource.RLIMIT_CORE, 0),
    ):
        resource.setrlimit(limit, (most, most))
    found = asdict(_examined(path))
    del found["path"]
    print(json.dumps(found))


def _examined(path: Path) -> Verdict:
    from qinit_store.reading import open_doubtful  # here, so that what h5py does is done under the limits

    try:
        with open_doubtful(path) as artefact:
            damaged = tuple(artefact.damaged_tasks().tolist())
            state, problem = "sound", ""
            if artefact.strangeness:
                state, problem = NotOurs.state, artefact.strangeness
            if damaged or artefact.trouble:
                state = Damaged.state
            if artefact.trouble:
                problem = f"{path} is damaged: {artefact.trouble}"
            return Verdict(
                path,
                artefact.kind,
                artefact.task_count,
                artefact.content_sha256,
                damaged,
                problem,
                state,
            )
    except MemoryError:
        problem = f"{path} is refused: reading it takes more memory than it may"
        return Verdict(path, problem=problem, state=Damaged.state)
    except Damaged as damage:
        return Verdict(path, problem=str(damage), state=damage.state)
    except StoreError as error:
        return Verdict(path, problem=str(error), state=UNREAD)


def _environment() -> dict[str, str]:
    return {**os.environ, "OPENBLAS_NUM_THREADS": "1"}
