"""How much of the machine is used: threads, a share of the tasks, or a cluster."""

from __future__ import annotations

import os
import re
from dataclasses import dataclass
from typing import ClassVar

from qinit_cli import cores
from qinit_cli.options import check, option


@dataclass(frozen=True)
class Machine:
    """How much of the machine is used; no number depends on it."""

    jobs: int | None = option(
        None, "Tasks learned at once.", low=1, high=cores.MOST_JOBS, default_text="all cores", metavar="N"
    )
    shard: str | None = option(
        None,
        "Learn only the K-th of N shares, into an artefact of its own; qinit merge joins them.",
        metavar="K/N",
        default_text="all tasks",
        seldom=True,
    )
    dask: str | None = option(
        None,
        "Learn on the Dask cluster of this scheduler.",
        metavar="ADDRESS|SCHEDULER-FILE",
        default_text="this machine",
        seldom=True,
    )
    fail_fast: bool = option(False, "Stop at the first task that fails; else the others go on.", seldom=True)

    processes: ClassVar[bool] = True  # whether tasks that are stepped in Python may be learned by several

    def __post_init__(self) -> None:
        check(self)
        if self.shard is not None:
            shape = re.fullmatch(r"(\d+)/(\d+)", self.shard)
            if shape is None or not 1 <= int(shape[1]) <= int(shape[2]):
                raise ValueError(f"--shard is {self.shard}; it must be K/N with K from 1 to N, such as 2/4")
        if self.dask is not None:
            self._check_dask(self.dask)

    def _check_dask(self, place: str) -> None:
        if self.jobs is not None:
            raise ValueError(
                "--jobs counts threads and processes of this machine, and --dask uses none; leave one of them out"
            )
        if re.fullmatch(r"\w+://[^\s/]+:\d{1,5}", place) is None and not os.path.isfile(place):
            raise ValueError(
                f"--dask is {place!r}; it must be an address such as tcp://127.0.0.1:8786, or a file that "
                "dask scheduler --scheduler-file wrote"
            )

    @property
    def share(self) -> tuple[int, int]:
        """Which of how many shares is learned, counted from 1; (1, 1) is all of it."""
        if self.shard is None:
            return 1, 1
        share, _, shares = self.shard.partition("/")
        return int(share), int(shares)

    @property
    def threads(self) -> int:
        """Worker threads, each of which may wait for a process: as asked, else the cores that this process may use."""
        return self.jobs or cores.usable()


@dataclass(frozen=True)
class OneProcess(Machine):
    """As Machine for callers of the library: what they have defined or registered is in this process alone."""

    processes: ClassVar[bool] = False
