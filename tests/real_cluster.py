"""A Dask scheduler and two workers on this machine, each a process of its own that a test may kill."""

from __future__ import annotations

import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

PATIENCE = 180  # seconds on a busy machine, where workers import what they compile with for the first time


@dataclass
class RealCluster:
    """A scheduler and its workers."""

    file: Path
    scheduler: subprocess.Popen[bytes]
    workers: list[subprocess.Popen[bytes]] = field(default_factory=list)

    def complete(self) -> RealCluster:
        """Two workers live, started anew where a test killed one."""
        import distributed

        self.workers = [worker for worker in self.workers if worker.poll() is None]
        while len(self.workers) < 2:
            words = ("--scheduler-file", self.file, "--no-nanny", "--nthreads", 1, "--host", "127.0.0.1")
            self.workers.append(_dask("worker", *words))
        with distributed.Client(
            scheduler_file=str(self.file), timeout=PATIENCE, set_as_default=False
        ) as client:
            client.wait_for_workers(2, timeout=PATIENCE)
        return self

    def end(self) -> None:
        for process in [*self.workers, self.scheduler]:
            process.kill()
            process.wait()


@contextmanager
def scheduler_in(folder: Path) -> Iterator[RealCluster]:
    """A scheduler without workers, whose file is in the folder; it ends with the block."""
    file = folder / "scheduler.json"
    process = _dask("scheduler", "--host", "127.0.0.1", "--port", 0, "--scheduler-file", file)
    made = RealCluster(file, process)
    try:
        wait_for(lambda: file.exists() and file.read_text().endswith("}"), process)
        yield made
    finally:
        made.end()


def wait_for(ready: Callable[[], Any], process: subprocess.Popen[Any]) -> None:
    """Waits until it is ready, while the process lives."""
    deadline = time.monotonic() + PATIENCE
    while not ready():
        assert process.poll() is None, "it ended early"
        assert time.monotonic() < deadline
        time.sleep(0.01)


def _dask(*words: object) -> subprocess.Popen[bytes]:
    quiet = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
    return subprocess.Popen([sys.executable, "-m", "dask", *map(str, words), "--no-dashboard"], **quiet)
