"""How many processors there are for this process: by its affinity, and by the quota of the container that it runs in."""

from __future__ import annotations

import math
import os
from collections.abc import Iterator
from pathlib import Path, PurePosixPath

MOST_JOBS = 1_024  # threads: more than the processors of any machine so far, fewer than systems start
GROUPS = Path("/sys/fs/cgroup")
OWN_GROUPS = Path("/proc/self/cgroup")
CONTROLLERS = (
    "cpu",
    "cpu,cpuacct",
    "cpuacct,cpu",
)  # folders of version 1, where processors' time is shared out


def usable() -> int:
    """The processors that this process may use at once: a quota of 1.5 makes 2; at least 1."""
    quotas = list(_quotas(GROUPS, OWN_GROUPS))
    return max(1, min([_by_affinity(), *(math.ceil(quota) for quota in quotas)]))


def _by_affinity() -> int:
    if hasattr(os, "sched_getaffinity"):  # not on macOS
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def _quotas(groups: Path, own_groups: Path) -> Iterator[float]:
    """Processors by the quotas of the control groups that this process is in, and of those that these are in."""
    try:
        lines = own_groups.read_text().splitlines()
    except (OSError, UnicodeDecodeError):  # no Linux, or no /proc
        return
    for line in lines:
        _, names, place = line.split(":", 2)
        if not names:
            for folder in _upwards(groups, place):
                yield from _quota(folder, "cpu.max", "cpu.max")
        elif "cpu" in names.split(","):
            for controller in CONTROLLERS:
                for folder in _upwards(groups / controller, place):
                    yield from _quota(folder, "cpu.cfs_quota_us", "cpu.cfs_period_us")


def _upwards(top: Path, place: str) -> Iterator[Path]:
    """The folder of a group and of each one around it; in a container the top may be the group itself, whatever its name."""
    parts = PurePosixPath(place).parts[1:]
    for length in range(len(parts), -1, -1):
        yield top.joinpath(*parts[:length])


def _quota(folder: Path, quota: str, period: str) -> Iterator[float]:
    """The quota in processors; nothing where there is none."""
    try:
        words = (folder / quota).read_text().split()
        words += (folder / period).read_text().split() if period != quota else []
        time, every = (float(word) for word in words)
    except (OSError, ValueError):  # no such file; "max 100000"
        return
    if time > 0 and every > 0:  # version 1 writes -1 for no quota
        yield time / every
