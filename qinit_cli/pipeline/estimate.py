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
    from qinit_cli.arrays import Floats
    from qinit_cli.pipeline.job import Plan
    from qinit_cli.tasks import SourceTasks, TargetTasks

_warm: set[str] = set()  # kernels that a trial of this process has called

Tasks = TypeVar("Tasks", "SourceTasks", "TargetTasks")

TRIAL_TASKS = 4  # learned side by side, as the kernels like it
TRIAL_SHARE = 25  # one episode in so many is tried ...
FEWEST_TRIED, MOST_TRIED = 20, 20_000  # ... within these bounds
LEAST_SETTLED = 0.5  # of what the last half of the trial took: steps that follow are taken to be no fewer


@dataclass(frozen=True)
class Expected:
    """What making an artefact would take."""

    path: str
    tasks: int
    missing: int  # tasks that are still to be learned
    steps: int
    seconds: float  # on the clock, with the jobs asked for
    bytes: int


@dataclass(frozen=True)
class OfTask:
    """What one task takes."""

    steps: float
    seconds: float  # of one core
    settled: float  # steps of an episode, of the last that were tried
    compression: float  # bytes on disk over bytes in memory


def expected(
    plan_of: Callable[[Tasks, int], Plan], tasks: Tasks, count: int, keeping: Keeping, machine: Machine
) -> Expected:
    """What `plan_of(tasks, count)` would take, judged by a few of the tasks and a few of their episodes."""
    fewer, tried = shortened(tasks)
    trial = plan_of(fewer, min(count, TRIAL_TASKS))
    return foresee(plan_of(tasks, count), trial, tasks.learning.episodes, tried, keeping, machine)


def shortened(tasks: Tasks) -> tuple[Tasks, int]:
    """The tasks with the episodes of a trial, and how many these are."""
    episodes = tasks.learning.episodes
    tried = min(episodes, MOST_TRIED, max(FEWEST_TRIED, episodes // TRIAL_SHARE))
    return replace(tasks, learning=replace(tasks.learning, episodes=tried)), tried


def of_task(trial: Plan, episodes: int, tried: int) -> OfTask:
    """What a task of all `episodes` takes, judged by `trial`: TRIAL_TASKS tasks of `tried` of them.

    Episodes become shorter as a task is learned, about as 1 over their number: the limit of that stands for the rest, see
    `_limit`. Mountain Car's sources at five noises: 0.7 to 1.8 of their steps, where what the last tried ones took gave 1.2 to
    2.7.
    """
    from qinit_cli.pipeline.room import check_memory
    from qinit_cli.watch import Watch

    check_memory(trial.footprint, trial.count, 1)
    ids = np.arange(trial.count)
    ready = trial.prepared
    if ready.kernel not in _warm:
        ready.learn(ids, Watch())  # compiles, reads caches warm
        _warm.add(ready.kernel)
    _, rows = ready.learn(ids, Watch())
    growth = _growth(rows, episodes, tried)
    return OfTask(
        steps=float(rows["steps"].sum() / trial.count * growth),
        seconds=float(rows["seconds"].mean() * growth),
        settled=_settled(rows, tried),
        compression=_compression(trial, rows),
    )


def foresee(
    plan: Plan, trial: Plan, episodes: int, tried: int, keeping: Keeping, machine: Machine
) -> Expected:
    """What `plan` would take, judged by `trial`, see `of_task`."""
    from qinit_cli.pipeline.room import check_artefact

    check_artefact(plan.footprint)
    one = of_task(trial, episodes, tried)
    path, count = place(plan, keeping, machine), len(share_of(plan.count, *machine.share))
    missing = max(0, count - _saved(path, plan, keeping, share=count < plan.count))
    return Expected(
        path=str(path),
        tasks=count,
        missing=missing,
        steps=round(one.steps * missing),
        seconds=one.seconds * missing / threads(machine),
        bytes=round(one.compression * plan.schema.task_bytes * count),
    )


def threads(machine: Machine) -> int:
    """Worker threads, here or on the cluster."""
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
    return float(1.0 + (episodes - tried) * _limit(curve.mean(axis=0)) / (tried * curve.mean()))


def _settled(rows: dict[str, Any], tried: int) -> float:
    """Steps of an episode behind those that were tried; NaN where there are none."""
    curve = rows.get("curve_steps", rows["steps"])
    if curve.ndim == 1:
        return float("nan")
    of_episode = float(rows["steps"].sum() / len(rows["steps"]) / tried)  # whatever a bin of the curve holds
    return of_episode * _limit(curve.mean(axis=0)) / float(curve.mean())


def _limit(curve: Floats) -> float:
    """What a curve that falls as 1 / t comes to, (B,): of t and 2 t the means differ by as much as that of 2 t from the limit."""
    half = curve[len(curve) // 2 :].mean()
    before = curve[len(curve) // 4 : max(len(curve) // 2, 1)].mean()
    return float(np.clip(2.0 * half - before, LEAST_SETTLED * half, half))


def _compression(trial: Plan, rows: dict[str, Any]) -> float:
    """Bytes on disk over bytes in memory of a task, whatever the rest of the file takes."""
    if trial.count == 1:
        return _image_bytes(trial, rows, 1) / trial.schema.task_bytes
    more = _image_bytes(trial, rows, trial.count) - _image_bytes(trial, rows, 1)
    return more / (trial.schema.task_bytes * (trial.count - 1))


def _image_bytes(trial: Plan, rows: dict[str, Any], count: int) -> int:
    """The size of a file of the first `count` tasks."""
    from qinit_store.digest import task_digests
    from qinit_store.encoding import Header, checked, image
    from qinit_store.schema import Schema

    columns_per_task = trial.schema.task_columns
    used = {name for column in columns_per_task for name in column.dims}
    axes = tuple(axis for axis in trial.schema.axes if axis.name in used)
    schema = Schema(trial.schema.kind, axes, columns_per_task)
    ids = np.arange(count)
    first = {name: values[:count] for name, values in rows.items()}
    columns = checked(schema, schema.task_columns, first, count)
    digests = task_digests(schema.task_columns, ids, columns)
    header = Header(f"qinit/{schema.kind}", trial.settings.spec(), {}, ())
    return len(image(header, schema, ids, digests, {**columns, "task_digest": digests}))
