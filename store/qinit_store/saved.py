"""Which tasks are saved, and where: 48 bytes a task, as a million of them may be."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from qinit_store.schema import DIGEST_BYTES, Array

PLACE = np.dtype([("id", "<i8"), ("part", "<i4"), ("row", "<i4"), ("digest", "u1", DIGEST_BYTES)])


class SavedTasks:
    """The tasks of part files: id, file, row and digest of each.

    Kept in runs that ascend by id, each more than twice as long as the next: so neither adding a part nor asking takes time in
    the number of parts.
    """

    def __init__(self) -> None:
        self._paths: list[Path] = []
        self._counts: list[int] = []  # tasks in each of these
        self._runs: list[Array] = []

    def __len__(self) -> int:
        return sum(self._counts)

    @property
    def ids(self) -> Array:
        """The ids of all tasks, (tasks,), ascending."""
        ids: Array = self._all()["id"].copy()
        return ids

    def add(self, path: Path, ids: Array, digests: Array) -> None:
        """Takes the tasks `ids` (n,), none of them known, which are the rows of the file `path` in this order."""
        run = np.empty(ids.size, PLACE)
        run["id"], run["part"], run["row"], run["digest"] = (
            ids,
            len(self._paths),
            np.arange(ids.size),
            digests,
        )
        self._paths.append(path)
        self._counts.append(ids.size)
        self._runs.append(run[np.argsort(ids, kind="stable")])
        while len(self._runs) > 1 and self._runs[-2].size <= 2 * self._runs[-1].size:
            self._join(2)

    def known(self, ids: Array) -> Array:
        """Which of `ids` (n,) are saved, (n,) bool."""
        found = np.zeros(ids.size, dtype=bool)
        for run in self._runs:
            if run.size:
                found |= run["id"][_nearest(run, ids)] == ids
        return found

    def paths(self, ids: Array) -> list[Path]:
        """The files that hold the tasks `ids`, all of them saved."""
        return [self._paths[part] for part in np.unique(self._places(ids)["part"]).tolist()]

    def by_path(self, ids: Array) -> list[tuple[Path, Array, Array]]:
        """For each file that holds some of `ids`, all of them saved: it, their places in `ids`, and their rows in the file."""
        places = self._places(ids)
        return [
            (self._paths[part], at := np.flatnonzero(places["part"] == part), places["row"][at])
            for part in np.unique(places["part"]).tolist()
        ]

    def digests(self, ids: Array) -> Array:
        """The digests of the tasks `ids`, all of them saved, (n, 32) u1."""
        digests: Array = np.ascontiguousarray(self._places(ids)["digest"])
        return digests

    def count(self, paths: set[Path]) -> int:
        """How many tasks are in files of these `paths`."""
        return sum(count for path, count in zip(self._paths, self._counts, strict=True) if path in paths)

    def _places(self, ids: Array) -> Array:
        every = self._all()
        places: Array = every[_nearest(every, ids)] if ids.size else every[:0]
        return places

    def _all(self) -> Array:
        if not self._runs:
            return np.empty(0, PLACE)
        self._join(len(self._runs))
        return self._runs[0]

    def _join(self, count: int) -> None:
        """Makes one run of the last `count`."""
        if count == 1:
            return
        joined = np.concatenate(self._runs[-count:])
        self._runs[-count:] = [joined[np.argsort(joined["id"], kind="stable")]]


def _nearest(run: Array, ids: Array) -> Array:
    """Where in a run, which is not empty, each of `ids` stands if it is there at all."""
    return np.minimum(np.searchsorted(run["id"], ids), run.size - 1)
