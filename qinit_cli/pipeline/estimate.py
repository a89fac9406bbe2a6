"""`--dry-run`: what an artefact would take, from learning a few of its tasks for a short while; nothing is made."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np

from qinit_cli.pipeline.job import place, share_of
from qinit_cli.pipeline.keeping import Keeping
from qinit_cli.pipeline.machine import Machine

if TYPE_CHECKING:
    from qinit_cli.pipeline.job import Plan
    from qinit_cli.tasks import SourceTasks, TargetTasks

Tasks = TypeVar("Tasks", "SourceTasks", "TargetTasks")

TRIAL_TASKS = 4  # learned side by side, as the kernels like it
TRIAL_SHARE = 25  # one episode in so many is tried ...
FEWEST_TRIED, MOST_TRIED = 20, 20_000  # ... within these bounds
SETTLED_SHARE = 5  # the last fifth of what was tried stands for all that follows


@dataclass(frozen=True)
class Expected:
    """What making an artefact would take."""

    path: str
    tasks: int
    missing: int  # tasks that are still to be learned
    steps: int
    seconds: float  # on the clock, with the jobs asked for
    bytes: int


def expected(
    plan_of: Callable[[Tasks, int], Plan], tasks: Tasks, count: int, keeping: Keeping, machine: Machine
) -> Expected:
    """What `plan_of(tasks, count)` would take, judged by a few of the tasks and a few of their episodes."""
    episodes = tasks.learning.episodes
    tried = min(episodes, MOST_TRIED, max(FEWEST_TRIED, episodes // TRIAL_SHARE))
    fewer = replace(tasks, learning=replace(tasks.learning, episodes=tried))
    trial = plan_of(fewer, min(count, TRIAL_TASKS))
    return foresee(plan_of(tasks, count), trial, episodes, tried, keeping, machine)


def foresee(
    plan: Plan, trial: Plan, episodes: int, tried: int, keeping: Keeping, machine: Machine
) -> Expected:
    """What `plan` would take, judged by `trial`: the same with TRIAL_TASKS tasks of `tried` of the `episodes`.

    Episodes become shorter as a task is learned, so what the last of the tried ones took stands for the rest; where they would
    still have become much shorter, the time is overestimated.
    """
    from qinit_cli.pipeline.room import check_artefact, check_memory
    from qinit_cli.watch import Watch

    check_artefact(plan.footprint)
    check_memory(trial.footprint, trial.count, 1)
    path, count = place(plan, keeping, machine), len(share_of(plan.count, *machine.share))
    missing = max(0, count - _saved(path, plan, keeping, share=count < plan.count))
    ids = np.arange(trial.count)
    learn = trial.prepared.learn
    learn(ids, Watch())  # compiles, reads caches warm
    _, rows = learn(ids, Watch())
    per_task = rows["steps"].sum() / trial.count
    seconds = rows["seconds"].mean()
    growth = _growth(rows, episodes, tried)
    return Expected(
        path=str(path),
        tasks=count,
        missing=missing,
        steps=round(per_task * growth * missing),
        seconds=float(seconds * growth * missing / _threads(machine)),
        bytes=round(_compression(trial, rows) * plan.schema.task_bytes * count),
    )


def _threads(machine: Machine) -> int:
    if machine.dask is None:
        return machine.threads
    from qinit_cli.pipeline import cluster

    return cluster.threads(machine.dask)


def _saved(path: Path, plan: Plan, keeping: Keeping, *, share: bool) -> int:
    """How many of the tasks are saved already, in an artefact of the same settings or an unfinished one.

    A share takes over from no artefact but its own.
    """
    from qinit_store.catalog import Store
    from qinit_store.folder import tasks_saved, work_folder

    relatives = (
        []
        if keeping.store is None
        else Store(keeping.store).relatives(plan.schema.kind, plan.settings.spec())
    )
    finished = [one.tasks for one in relatives if not share or one.path == path]
    return max(*finished, tasks_saved(work_folder(path)), 0)


def _growth(rows: dict[str, Any], episodes: int, tried: int) -> float:
    """Steps of all the episodes over steps of those that were tried."""
    curve = rows.get("curve_steps", rows["steps"])
    if curve.ndim == 1:
        return 1.0  # exact tables have no episodes
    settled = curve[:, -max(1, curve.shape[1] // SETTLED_SHARE) :].mean()
    return float(1.0 + (episodes - tried) * settled / (tried * curve.mean()))


def _compression(trial: Plan, rows: dict[str, Any]) -> float:
    """Bytes on disk over bytes in memory."""
    from qinit_store.digest import task_digests
    from qinit_store.encoding import Header, checked, image
    from qinit_store.schema import Schema

    columns_per_task = trial.schema.task_columns
    used = {name for column in columns_per_task for name in column.dims}
    axes = tuple(axis for axis in trial.schema.axes if axis.name in used)
    schema = Schema(trial.schema.kind, axes, columns_per_task)
    ids = np.arange(trial.count)
    columns = checked(schema, schema.task_columns, rows, trial.count)
    digests = task_digests(schema.task_columns, ids, columns)
    header = Header(f"qinit/{schema.kind}", trial.settings.spec(), {}, ())
    size = len(image(header, schema, ids, digests, {**columns, "task_digest": digests}))
    return size / (schema.task_bytes * trial.count)
