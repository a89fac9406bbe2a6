"""New artefacts out of old ones: what a damaged one still holds, and shards put together."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import numpy as np

from qinit_store.errors import Damaged, Refused
from qinit_store.reading import Artefact, open_artefact, open_doubtful
from qinit_store.schema import Array
from qinit_store.spec import difference, spec_sha256, without_tasks
from qinit_store.work import Work, open_work

Opening = Callable[[Path], Artefact]


def salvage(
    path: Path,
    target: Path,
    provenance: Mapping[str, Any],
    *,
    force: bool = False,
    opening: Opening = open_doubtful,
) -> Array:
    """Publish at `target` the tasks of `path` that hold; the ids of the tasks that are lost.

    `opening` opens it, and knows what its tasks must hold besides their digests.

    Damaged where nothing can be saved: no task holds, or what all tasks share is damaged.
    """
    with opening(path) as old:
        if spec_sha256(old.spec) != old.spec_sha256 or (old.trouble and old.schema.static_columns):
            raise Damaged(f"{path} cannot be salvaged: {old.trouble}; make it again with --force")
        lost = old.damaged_tasks()
        kept = np.setdiff1d(old.tasks, lost)
        if not kept.size:
            raise Damaged(f"{path} cannot be salvaged: no task of it holds; make it again with --force")
        with open_work(target, old.schema, old.spec, tasks=kept, force=force, provenance=provenance) as work:
            if not work.complete:
                _save_rows(work, old, np.setdiff1d(kept, work.saved))
                work.finish(np.union1d(kept, work.saved), _statics(old), provenance, old.inputs)
    return lost


def merge(
    paths: Sequence[Path],
    target: Path,
    provenance: Mapping[str, Any],
    *,
    force: bool = False,
    opening: Opening = open_artefact,
) -> Path:
    """Publish at `target` the tasks of all of `paths`; Refused where they are not shards of one artefact.

    Shards have the same spec apart from "tasks", of which the largest counts. A task in several must be the same in
    all. `opening` opens them, as in `salvage`.
    """
    with ExitStack() as stack:
        shards = [stack.enter_context(opening(path)) for path in paths]
        tasks = _tasks_in_all(shards)
        largest = max(shards, key=lambda shard: int(shard.spec.get("tasks", 0)))
        with open_work(
            target, largest.schema, largest.spec, tasks=tasks, force=force, provenance=provenance
        ) as work:
            if work.complete:
                return work.target
            for shard in shards:
                work.adopt(shard)
            return work.finish(work.saved, _statics(largest), provenance, [_named(shard) for shard in shards])


def _save_rows(work: Work, old: Artefact, ids: Array) -> None:
    size = old.schema.block_size
    rows = np.searchsorted(old.tasks, ids)
    for first in range(0, ids.size, size):
        some = [old.rows(row, row + 1) for row in rows[first : first + size].tolist()]
        columns = [column.name for column in old.schema.task_columns if column.given]
        work.save(
            {name: np.concatenate([one[name] for one in some]) for name in columns}, ids[first : first + size]
        )


def _tasks_in_all(shards: Sequence[Artefact]) -> Array:
    """The ids of their tasks; Refused where they are strangers to one another."""
    first = shards[0]
    digests: dict[int, bytes] = {}
    for shard in shards:
        other = difference(without_tasks(first.spec), without_tasks(shard.spec))
        if shard.kind != first.kind or other:
            reason = other or f"kinds: {first.kind} and {shard.kind}"
            raise Refused(f"{first.path} and {shard.path} are not parts of one artefact ({reason})")
        if any(not np.array_equal(first.read(one), shard.read(one)) for one in _static_names(first)):
            raise Refused(f"{first.path} and {shard.path} differ in what their tasks share")
        for number, digest in zip(shard.tasks.tolist(), shard.digests, strict=True):
            if digests.setdefault(number, digest.tobytes()) != digest.tobytes():
                raise Refused(f"task {number} of {shard.path} is another than in a file before it")
    return np.array(sorted(digests), dtype=np.int64)


def _static_names(artefact: Artefact) -> list[str]:
    return [column.name for column in artefact.schema.static_columns]


def _statics(artefact: Artefact) -> dict[str, Array]:
    return {name: artefact.read(name) for name in _static_names(artefact)}


def _named(shard: Artefact) -> dict[str, str]:
    return {"role": shard.kind, "name": shard.path.name, "content_sha256": shard.content_sha256}
