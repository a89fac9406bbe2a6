"""A job: an artefact of tasks that is to be made, and learning what it lacks of them."""

from __future__ import annotations

import shlex
import time
from collections.abc import Callable, Mapping, Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from qinit_cli import signals
from qinit_cli.errors import Interrupted, TasksFailed
from qinit_cli.pipeline.keeping import Keeping, target_path, working
from qinit_cli.pipeline.machine import Machine
from qinit_cli.pipeline.origin import provenance
from qinit_cli.pipeline.reporter import SILENT, Progress, Reporter
from qinit_cli.pipeline.taking_over import take_over
from qinit_store.wording import counted, noun, shell_line

if TYPE_CHECKING:
    from qinit_cli.arrays import Integers
    from qinit_cli.artefacts.settings import RunSettings, SourcesSettings, TuningSettings
    from qinit_cli.environments.family import Family
    from qinit_cli.pipeline.room import Footprint
    from qinit_cli.pipeline.workers import Crew, Learn
    from qinit_cli.watch import Watch
    from qinit_store.held import Held, HeldWork
    from qinit_store.schema import Schema
    from qinit_store.work import Work

    Rows = dict[str, Any]

SAVE_SECONDS = 2.0  # of learning that a power cut may cost
SAVE_BYTES = (
    16 * 2**20
)  # that wait in memory to be saved; with the copies that saving makes it takes four times that
SAVE_SHARE = 0.05  # of this process's time that saving may take where it makes several artefacts at once


@dataclass
class Tally:
    """What a command did, for its summary and for --json."""

    tasks: int = 0
    skipped: int = 0  # saved before
    failed: int = 0
    steps: int = 0
    seconds: float = 0.0  # inside the kernels
    extra: dict[str, Any] = field(default_factory=dict)


@dataclass(frozen=True)
class Prepared:
    """What tasks are learned from, and what is published beside their rows."""

    learn: Learn  # the rows of some tasks
    kernel: str  # name of the compiled code that it needs: one choice of kernel and features
    inputs: Sequence[Mapping[str, str]] = ()
    statics: Mapping[str, Any] = field(default_factory=dict)  # datasets without a task axis


@dataclass(frozen=True)
class Plan:
    """An artefact of tasks that is to be made."""

    stem: str  # of its default name
    settings: SourcesSettings | RunSettings | TuningSettings
    family: Family  # of what is learned
    schema: Schema
    prepare: Callable[[], Prepared]  # what may take long: pilots, projections, the targets' own tables
    what: str  # on the line of progress
    read: Path | Held | None = None  # the artefact it is made from
    learning_bytes: int = 0  # in memory, of a task while it is learned, beside its row
    begin: Callable[[Work | HeldWork], None] | None = (
        None  # given the work before a task is learned: what was saved may matter
    )

    @property
    def count(self) -> int:
        """How many tasks there are."""
        return self.settings.tasks

    @cached_property
    def prepared(self) -> Prepared:
        """What learning takes, made once, when it is first asked for: a complete artefact needs none of it."""
        return self.prepare()

    @property
    def footprint(self) -> Footprint:
        """The bytes that it takes."""
        from qinit_cli.pipeline.room import Footprint

        return Footprint(self.count, self.schema.task_bytes, self.learning_bytes)


@dataclass(frozen=True)
class Made:
    """An artefact that stands under its name, or is held in memory."""

    path: Path  # in memory, its name alone
    digest: str  # content hash
    tally: Tally
    complete_before: bool
    held: Held | None = None

    @property
    def source(self) -> Path | Held:
        """What `open_artefact` opens."""
        return self.path if self.held is None else self.held


def make(plan: Plan, keeping: Keeping, machine: Machine, reporter: Reporter = SILENT) -> Made:
    """The artefact, with the tasks learned that it lacks. Interrupted after a signal: what was finished is saved.

    NotAllowed or SystemFailed where it would not fit, see `room`.
    """
    from qinit_cli.pipeline.room import check_artefact, check_room
    from qinit_cli.pipeline.storing import store
    from qinit_store.held import HeldWork

    check_artefact(plan.footprint)
    path, asked = place(plan, keeping, machine), share_of(plan.count, *machine.share)
    origin = provenance(keeping.command, plan.read, plan.settings)
    with working(path, plan.schema, plan.settings, keeping, origin, tasks=asked) as artefact:
        complete = artefact.complete
        if complete:
            tally = Tally(len(asked), skipped=len(asked))
        else:
            # a share holds its own tasks and no others
            if len(asked) == plan.count and not isinstance(artefact, HeldWork):
                take_over(artefact, asked, plan.settings, keeping, reporter)
            missing = np.setdiff1d(asked, artefact.saved)
            check_room(
                plan.footprint,
                len(missing),
                None if keeping.in_memory else path,
                None if machine.dask else machine.threads,
            )
            tally = _learn_missing(artefact, asked, missing, plan, machine, reporter, keeping.command)
            ready = plan.prepared
            inputs = list(ready.inputs)
            if isinstance(artefact, HeldWork):
                artefact.finish(artefact.saved, statics=ready.statics, provenance=origin, inputs=inputs)
            else:
                store(artefact, plan.what, reporter, machine.threads, ready.statics, origin, inputs)
    return made(path, artefact, tally, complete)


def made(path: Path, artefact: Work | HeldWork, tally: Tally, complete_before: bool) -> Made:
    """What was made, once its work is finished."""
    from qinit_store.held import HeldWork
    from qinit_store.reading import describe

    if not isinstance(artefact, HeldWork):
        return Made(path, describe(path).content_sha256, tally, complete_before)
    held = artefact.made
    if held is None:
        raise ValueError(f"{path} is not finished")
    return Made(path, held.content_sha256, tally, complete_before, held)


def place(plan: Plan, keeping: Keeping, machine: Machine) -> Path:
    """Where the artefact goes; a share of it has a name of its own."""
    share, shares = machine.share
    stem = plan.stem if shares == 1 else f"{plan.stem}-share-{share}-of-{shares}"
    return target_path(keeping, stem, plan.settings)


def share_of(count: int, share: int, shares: int) -> Integers:
    """The ids of the share-th of so many shares of `count` tasks, as even as can be, each a run of ids."""
    return np.array_split(np.arange(count), shares)[share - 1]


def _learn_missing(
    artefact: Work | HeldWork,
    asked: Integers,
    missing: Integers,
    plan: Plan,
    machine: Machine,
    reporter: Reporter,
    command: Sequence[str],
) -> Tally:
    from qinit_cli.kernels.compiled import cache_folder
    from qinit_cli.watch import Watch
    from qinit_store.held import HeldWork

    ready = plan.prepared
    tally = Tally(tasks=len(asked), skipped=len(asked) - len(missing))
    _report_what_is_there(artefact, tally, reporter)
    if machine.dask is None and len(missing):  # workers elsewhere have caches of their own
        reporter.detail(f"compiled kernels: {cache_folder()}")
    if plan.begin is not None:
        plan.begin(artefact)
    watch = Watch()
    waiting = _Waiting(artefact, tally)
    first = ""  # failure
    with (
        reporter.compiling(ready.kernel),
        _crew(plan, machine, watch) as crew,
        signals.asking_first(watch.stop) as received,
        reporter.progress(plan.what, tally.skipped, len(asked), watch) as progress,
        waiting,
    ):
        for learned in crew(missing, _Ticking(progress, watch, reporter)):
            waiting.add(learned.ids, learned.rows)
            progress.advance(len(learned.ids))
            for task, words in learned.failures:
                tally.failed += 1
                first = first or f"task {task} failed ({words})"
                reporter.note(_failure(task, words, plan, command))
                if machine.fail_fast:
                    watch.stop()
        waiting.save()
    are = noun(len(asked), "is", "are")
    saved = f"{artefact.kept} of {counted(len(asked), 'task')} {are} saved; the same command goes on with the rest"
    if isinstance(artefact, HeldWork):
        saved = "nothing is kept of tasks in memory"
    if received:
        raise Interrupted(f"stopped: {saved}", 128 + received[0])
    if tally.failed and (machine.fail_fast or not len(artefact.saved)):
        raise TasksFailed(f"stopped after {first}: {saved}")
    return tally


def _crew(plan: Plan, machine: Machine, watch: Watch) -> AbstractContextManager[Crew]:
    """Who learns: the cluster that was named, else processes where steps are Python's, else threads of this process."""
    from qinit_cli.environments.family import is_in_python
    from qinit_cli.environments.modules import travelling

    learn = plan.prepared.learn
    if machine.dask is not None:
        from qinit_cli.pipeline import cluster

        return cluster.crew(machine.dask, travelling(learn, plan.settings.family.options), watch, plan.schema)
    if machine.processes and machine.threads > 1 and is_in_python(plan.family):
        from qinit_cli.pipeline.processes import processes_here

        travels = travelling(learn, plan.settings.family.options)
        return processes_here(machine.threads, learn, travels, plan.family, watch)
    from qinit_cli.pipeline.workers import threads_here

    return threads_here(machine.threads, learn, watch)


def _failure(task: int, said: str, plan: Plan, command: Sequence[str]) -> str:
    """What failed, and the command that makes it fail again."""
    words = shlex.split(provenance(command, plan.read)["command"])
    if "--shard" in words:
        del words[words.index("--shard") : words.index("--shard") + 2]
    alone = shell_line(*words, "--shard", f"{task + 1}/{plan.count}", "--fail-fast")
    return f"task {task} failed, {said}; alone it is {alone}"


def _report_what_is_there(artefact: Work | HeldWork, tally: Tally, reporter: Reporter) -> None:
    if tally.skipped:
        are = noun(tally.tasks, "is", "are")
        reporter.note(f"{tally.skipped} of {counted(tally.tasks, 'task')} {are} saved already")
    if artefact.set_aside:
        reporter.note(
            f"{counted(artefact.set_aside, 'saved task')} {noun(artefact.set_aside, 'was', 'were')} damaged and "
            f"set aside, and {noun(artefact.set_aside, 'is', 'are')} learned again"
        )


@dataclass
class _Ticking:
    """Shows progress, and once that learning was stopped while a kernel is compiled, which nothing interrupts."""

    progress: Progress
    watch: Watch
    reporter: Reporter
    reported: bool = False

    def __call__(self) -> None:
        from qinit_cli.kernels.compiled import compiling as under_way

        self.progress.tick()
        if self.watch.stopped and not self.reported and under_way():
            self.reported = True
            self.reporter.note("stopping once the kernel is compiled; a second signal does not wait for that")


class _Waiting:
    """Finished tasks that wait to be saved together: a part file each would cost more than small tasks take to learn.

    Those of several artefacts wait longer: together they take one processor, whose time is not all for saving.
    """

    open: ClassVar[set[int]] = set()  # those of this process, by identity

    def __init__(self, artefact: Work | HeldWork, tally: Tally) -> None:
        self._artefact, self._tally = artefact, tally
        self._held: list[tuple[Integers, Rows]] = []
        self._size = 0  # bytes held
        self._since = time.monotonic()
        self._took = 0.0  # processor seconds of the last save

    def __enter__(self) -> None:
        self.open.add(id(self))

    def __exit__(self, *error: object) -> None:
        self.open.discard(id(self))

    def add(self, ids: Integers, rows: Rows) -> None:
        """Takes finished tasks, and saves once enough have come or enough time has passed."""
        if not len(ids):
            return
        self._held.append((ids, rows))
        self._size += sum(values.nbytes for values in rows.values())
        others = len(self.open) - 1
        seconds = SAVE_SECONDS + others * self._took / SAVE_SHARE
        if self._size >= SAVE_BYTES or time.monotonic() - self._since >= seconds:
            self.save()

    def save(self) -> None:
        """Saves what is held."""
        began = time.thread_time()
        if self._held:
            self._held.sort(key=lambda held: int(held[0][0]))  # else the store sorts copies of all rows
            ids = np.concatenate([held for held, _ in self._held])
            names = self._held[0][1]
            rows = {name: np.concatenate([rows[name] for _, rows in self._held]) for name in names}
            self._artefact.save(rows, ids)
            self._tally.steps += int(rows["steps"].sum())
            self._tally.seconds += float(rows["seconds"].sum())
        self._held, self._size = [], 0
        self._since, self._took = time.monotonic(), time.thread_time() - began
