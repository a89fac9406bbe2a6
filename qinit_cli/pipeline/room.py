"""Whether what is asked for fits into an artefact, into memory and onto the disk; what does not is refused before it begins.

Each figure is a lower bound, so that nothing is refused that could have succeeded. Time is no reason to refuse.
"""

from __future__ import annotations

import os
import resource
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from qinit_cli.errors import NotAllowed
from qinit_store.errors import SystemFailed
from qinit_store.wording import counted, noun, sized

KEPT_OF_A_TASK = 300  # bytes in memory: its id, its digest and where it is saved, as Python keeps them
CGROUP = Path("/sys/fs/cgroup")


@dataclass(frozen=True)
class Footprint:
    """The bytes that tasks take."""

    tasks: int
    task: int  # of one, its row in the artefact; it takes as much on the disk while tasks are learned
    learning: int = 0  # what a task takes in memory while it is learned, beside its row


def check_artefact(size: Footprint) -> None:
    """NotAllowed where no reader would open such an artefact."""
    from qinit_store import guard

    if size.task > guard.LARGEST_TASK:
        raise NotAllowed(
            f"a task would take {sized(size.task)}, and may take {sized(guard.LARGEST_TASK)} in an artefact; ask for fewer "
            "--episodes, fewer evaluations or a smaller table"
        )
    most = min(guard.LARGEST_DECLARED // size.task, guard.MOST_TASKS)
    if size.tasks > most:
        raise NotAllowed(
            f"{size.tasks} tasks would take {sized(size.tasks * size.task)}; an artefact holds {most} of them at most, so ask "
            "for fewer --tasks, or for several artefacts by --seed"
        )


def check_room(size: Footprint, count: int, where: Path | None, threads: int | None) -> None:
    """SystemFailed where this machine has no room for `count` tasks more.

    `where` is the file, None where the artefact is held in memory; `threads` learn, None where workers elsewhere do.
    """
    if threads is not None:
        check_memory(size, count, threads, held=where is None)
    if where is not None:
        check_disk(size, count, where)


def check_memory(size: Footprint, count: int, threads: int, *, held: bool = False) -> None:
    """SystemFailed where what is learned at once, and what is kept of each task, does not fit into memory."""
    from qinit_cli.pipeline.workers import BATCH

    kept = KEPT_OF_A_TASK + (size.task if held else 0)
    needed = min(count, threads * BATCH) * (size.task + size.learning) + count * kept
    if needed > (there := memory_available()):
        raise SystemFailed(
            f"learning needs at least {sized(needed)} of memory, {sized(there)} are available; ask for fewer --jobs, --tasks or "
            "--episodes"
        )


def check_disk(size: Footprint, count: int, where: Path) -> None:
    """SystemFailed where what is saved while tasks are learned does not fit onto the disk."""
    folder = next(one for one in (where, *where.absolute().parents) if one.is_dir())
    free = free_on_disk(folder)
    if free is not None and (needed := count * size.task) > free:
        raise SystemFailed(
            f"{counted(count, 'task')} {noun(count, 'needs', 'need')} at least {sized(needed)} on the disk of {folder}, where "
            f"{sized(free)} are free; name another --store or -o, or ask for fewer --tasks"
        )


def free_on_disk(folder: Path) -> int | None:
    """Bytes that are free in a folder; None where its file system does not tell, as some of networks do not."""
    try:
        status = os.statvfs(folder)
    except OSError:
        return None
    # no blocks at all: a file system without a size of its own
    return status.f_bavail * status.f_frsize if status.f_blocks else None


def memory_available() -> int:
    """Bytes of memory that this process may still take: of the machine, of its control group, and by `ulimit -v`."""
    limit, _ = resource.getrlimit(resource.RLIMIT_AS)
    known = [*_of_the_machine(), *_of_control_groups(), *([] if limit == resource.RLIM_INFINITY else [limit])]
    return min(known, default=2**63)


def _of_the_machine() -> Iterator[int]:
    for line in _lines(Path("/proc/meminfo")):
        if line.startswith("MemAvailable:"):
            yield int(line.split()[1]) * 1024


def _of_control_groups() -> Iterator[int]:
    """What is left to the process's group and those above it; pages of files give way, and count as left."""
    for line in _lines(Path("/proc/self/cgroup")):
        path = line.strip().partition("::")[2]
        group = CGROUP / path.lstrip("/") if path else CGROUP
        for one in (group, *group.parents):
            most = next(iter(_lines(one / "memory.max")), "max").strip()
            if most != "max":
                used = int(next(iter(_lines(one / "memory.current")), "0"))
                files = [
                    int(said.split()[1])
                    for said in _lines(one / "memory.stat")
                    if said.startswith("inactive_file ")
                ]
                yield max(0, int(most) - used + sum(files))
            if one == CGROUP:
                break


def _lines(path: Path) -> list[str]:
    """The lines of a file; none if there is no such file, as on other systems."""
    try:
        return path.read_text().splitlines()
    except (OSError, UnicodeDecodeError):
        return []
