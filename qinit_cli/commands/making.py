"""What the three stages have in common: where an artefact goes, what it says of its origin, and learning tasks into it."""

from __future__ import annotations

import json
import shlex
import sys
import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

from qinit_cli import __version__, signals
from qinit_cli.commands.groups import Display, Output, Work
from qinit_cli.commands.messages import Progress, compiling, detail, note, print_path
from qinit_cli.errors import Interrupted, TasksFailed, UsageError
from qinit_cli.output_file import check_one_line
from qinit_cli.registry import PLUG_IN
from qinit_store.wording import counted, noun, shell_line

if TYPE_CHECKING:
    from qinit_cli.arrays import Integers
    from qinit_cli.pipeline.workers import Crew, Learn
    from qinit_cli.watch import Watch
    from qinit_store.schema import Schema
    from qinit_store.work import Work as StoreWork

    Rows = dict[str, Any]

Bar = Callable[[Display, str, int, int, "Watch"], Progress]  # what is made, tasks done, tasks in all, steps

LONGEST_STEM = 80  # of the 100 characters that a name may have; the hash behind it tells names apart
SAVE_SECONDS = 2.0  # of learning that a power cut may cost
SAVE_BYTES = (
    16 * 2**20
)  # that wait in memory to be saved; with the copies that saving makes it takes four times that


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
class Plan:
    """An artefact of tasks that is to be made."""

    stem: str  # of its default name
    spec: Mapping[str, Any]
    schema: Schema
    learn: Learn  # the rows of some tasks
    kernel: str  # name of the compiled code that it needs: one choice of kernel and features
    what: str  # on the line of progress
    read: Path | None = None  # the artefact it is made from
    inputs: Sequence[Mapping[str, str]] = ()
    command: Sequence[str] = ()  # the words behind `qinit` that make it; else those that were typed
    learning_bytes: int = 0  # in memory, of a task while it is learned, beside its row
    statics: Mapping[str, Any] = field(default_factory=dict)  # datasets without a task axis
    begin: Callable[[StoreWork], None] | None = (
        None  # told of the work before a task is learned: what was saved may matter
    )

    @property
    def count(self) -> int:
        """How many tasks there are."""
        return int(self.spec["tasks"])


@dataclass(frozen=True)
class Made:
    """An artefact that stands under its name."""

    path: Path
    digest: str  # content hash
    tally: Tally
    complete_before: bool


def make(plan: Plan, output: Output, work: Work, display: Display, progress: Bar = Progress) -> Made:
    """The artefact, with the tasks learned that it lacks. Interrupted after a signal: what was finished is saved.

    NotAllowed or SystemFailed where it would not fit, see `room`.
    """
    import numpy as np

    from qinit_cli.commands.room import Footprint, check_artefact, check_room
    from qinit_store.reading import describe
    from qinit_store.work import open_work

    check_artefact(Footprint.of(plan))
    path, asked = place(plan, output, work), share_of(plan.count, *work.share)
    origin = provenance(plan.read, plan.command, plan.spec)
    with open_work(
        path, plan.schema, plan.spec, tasks=asked, force=output.force, wait=output.wait, provenance=origin
    ) as artefact:
        complete = artefact.complete
        if complete:
            tally = Tally(len(asked), skipped=len(asked))
        else:
            if len(asked) == plan.count:  # a share holds its own tasks and no others
                _take_over(artefact, asked, plan, output, display)
            missing = np.setdiff1d(asked, artefact.saved)
            check_room(Footprint.of(plan), len(missing), path, None if work.dask else work.threads)
            tally = _learn_missing(artefact, asked, missing, plan, work, display, progress)
            artefact.finish(artefact.saved, statics=plan.statics, provenance=origin, inputs=list(plan.inputs))
    return Made(path, describe(path).content_sha256, tally, complete)


def place(plan: Plan, output: Output, work: Work) -> Path:
    """Where the artefact goes; a share of it has a name of its own."""
    share, shares = work.share
    stem = plan.stem if shares == 1 else f"{plan.stem}-share-{share}-of-{shares}"
    return target_path(output, plan.schema.kind, stem, plan.spec)


def share_of(count: int, share: int, shares: int) -> Integers:
    """The ids of the share-th of so many shares of `count` tasks, as even as can be, each a run of ids."""
    import numpy as np

    return np.array_split(np.arange(count), shares)[share - 1]


def target_path(output: Output, kind: str, stem: str, spec: Mapping[str, Any]) -> Path:
    """Where the artefact goes: as asked with -o, else a name in the store made of what it is."""
    if output.output is None:
        from qinit_store.catalog import Store

        check_one_line(Path(output.store))
        return Store(Path(output.store)).path_for(kind, stem[:LONGEST_STEM].rstrip("-._"), spec)
    path = Path(output.output)
    check_one_line(path)
    if path.suffix != ".h5":
        raise UsageError(f"-o {output.output}: an artefact's name ends in .h5")
    return path


def provenance(
    read: Path | None = None, command: Sequence[str] = (), spec: Mapping[str, Any] = MappingProxyType({})
) -> dict[str, str]:
    """The command that makes this artefact, as typed with `-` replaced by what was read; time, versions and platform.

    Also which plug-ins had a part in what was read, or have one in what the `spec` names.
    """
    from qinit_cli.artefacts.specs import plug_ins

    words = command or sys.argv[1:]
    typed = [str(read) if argument == "-" and read is not None else argument for argument in words]
    return {
        "command": shlex.join(["qinit", *typed]),
        "time": time.strftime("%Y-%m-%dT%H:%M:%SZ", time.gmtime()),
        **_surroundings(),
        **({} if read is None else plug_ins_behind(read)),
        **plug_ins(spec),
    }


@cache
def _surroundings() -> dict[str, str]:
    import platform
    from importlib.metadata import version

    return {
        "qinit": __version__,
        **{package: version(package) for package in ("numpy", "scipy", "h5py", "numba")},
        "python": platform.python_version(),
        "platform": platform.platform(),
    }


def plug_ins_behind(path: Path) -> dict[str, str]:
    """The plug-ins that an artefact was made with, as its provenance tells them."""
    from qinit_store.reading import describe

    origin = describe(path).provenance
    return {key: str(value) for key, value in origin.items() if key.startswith(PLUG_IN)}


def _take_over(artefact: StoreWork, asked: Integers, plan: Plan, output: Output, display: Display) -> None:
    """Takes tasks of the same settings from artefacts of the store: growing learns only what is new."""
    from qinit_cli.artefacts.opening import open_artefact
    from qinit_store.catalog import Store
    from qinit_store.errors import Damaged, Refused

    for relative in Store(Path(output.store)).relatives(plan.schema.kind, plan.spec):
        before = len(artefact.saved)
        if set(asked) <= set(artefact.saved):
            return
        try:
            with open_artefact(relative.path, plan.schema.kind) as there:
                artefact.adopt(there)
        except Damaged as damage:
            note(display, f"nothing is taken over: {damage}")
        except Refused as lack:
            note(display, f"nothing is taken over from an earlier version: {lack}")
        if taken := len(artefact.saved) - before:
            note(
                display,
                f"{counted(taken, 'task')} {noun(taken, 'is', 'are')} taken over from {relative.path}",
            )


def _learn_missing(
    artefact: StoreWork,
    asked: Integers,
    missing: Integers,
    plan: Plan,
    work: Work,
    display: Display,
    bar: Bar,
) -> Tally:
    from qinit_cli.kernels.compiled import cache_folder
    from qinit_cli.watch import Watch

    tally = Tally(tasks=len(asked), skipped=len(asked) - len(missing))
    _say_what_is_there(artefact, tally, display)
    if work.dask is None and len(missing):  # workers elsewhere have caches of their own
        detail(display, f"compiled kernels: {cache_folder()}")
    if plan.begin is not None:
        plan.begin(artefact)
    watch = Watch()
    waiting = _Waiting(artefact, tally)
    with (
        compiling(display, plan.kernel),
        _crew(plan, work, watch) as crew,
        signals.asking_first(watch.stop) as received,
        bar(display, plan.what, tally.skipped, len(asked), watch) as progress,
    ):
        tick = _Ticking(progress, watch, display)
        for learned in crew(missing, tick):
            waiting.add(learned.ids, learned.rows)
            progress.advance(len(learned.ids))
            for task, error in learned.failures:
                tally.failed += 1
                note(display, _failure(task, error, plan))
                if work.fail_fast:
                    watch.stop()
        waiting.save()
    saved = f"{artefact.kept} of {counted(len(asked), 'task')} {noun(len(asked), 'is', 'are')} saved"
    if received:
        raise Interrupted(f"stopped: {saved}; the same command goes on with the rest", 128 + received[0])
    if tally.failed and (work.fail_fast or not len(artefact.saved)):
        raise TasksFailed(f"stopped after a task failed: {saved}; the same command goes on with the rest")
    return tally


def _crew(plan: Plan, work: Work, watch: Watch) -> AbstractContextManager[Crew]:
    """Who learns: the cluster that was named, else threads of this process."""
    if work.dask is not None:
        from qinit_cli.environments.modules import travelling
        from qinit_cli.pipeline import cluster

        return cluster.crew(work.dask, travelling(plan.learn), watch, plan.schema)
    from qinit_cli.pipeline.workers import threads_here

    return threads_here(work.threads, plan.learn, watch)


def _failure(task: int, error: Exception, plan: Plan) -> str:
    """What failed, and the command that makes it fail again."""
    words = shlex.split(provenance(plan.read, plan.command)["command"])
    if "--shard" in words:
        del words[words.index("--shard") : words.index("--shard") + 2]
    alone = shell_line(*words, "--shard", f"{task + 1}/{plan.count}", "--fail-fast")
    return f"task {task} failed, {type(error).__name__}: {error}; alone it is {alone}"


def warn(made: Made, before: str, warnings: Iterable[str], display: Display) -> None:
    """Prints the warnings on stderr; --json holds them too, behind one that was printed `before`, if any."""
    told = list(warnings)
    for warning in told:
        note(display, f"warning: {warning}")
    made.tally.extra["warnings"] = [*([before] if before else []), *told]


def say_result(
    made: Made,
    schema: str,
    sentence: str,
    output: Output,
    display: Display,
    *,
    further: Iterable[str] = (),
) -> None:
    """The summary and `further` lines on stderr, then the path alone on a line, or one JSON object, on stdout."""
    for line in (sentence, *further):
        note(display, line)
    tally = made.tally
    told = {
        "schema": schema,
        "path": str(made.path),
        "digest": made.digest,
        "tasks": tally.tasks,
        "skipped": tally.skipped,
        "failed": tally.failed,
        "steps": tally.steps,
        "seconds": round(tally.seconds, 6),
        **tally.extra,
    }
    if output.json:
        print(json.dumps(told, allow_nan=False), flush=True)
    else:
        print_path(made.path)
    if tally.failed:
        raise TasksFailed(
            f"{tally.failed} of {counted(tally.tasks, 'task')} failed; the same command tries them again"
        )


def _say_what_is_there(artefact: StoreWork, tally: Tally, display: Display) -> None:
    if tally.skipped:
        note(
            display,
            f"{tally.skipped} of {counted(tally.tasks, 'task')} {noun(tally.tasks, 'is', 'are')} saved already",
        )
    if artefact.set_aside:
        note(
            display,
            f"{counted(artefact.set_aside, 'saved task')} {noun(artefact.set_aside, 'was', 'were')} damaged and "
            f"set aside, and {noun(artefact.set_aside, 'is', 'are')} learned again",
        )


@dataclass
class _Ticking:
    """Shows progress, and once that learning was stopped while a kernel is compiled, which nothing interrupts."""

    progress: Progress
    watch: Watch
    display: Display
    told: bool = False

    def __call__(self) -> None:
        from qinit_cli.kernels.compiled import compiling as under_way

        self.progress.tick()
        if self.watch.stopped and not self.told and under_way():
            self.told = True
            note(self.display, "stopping once the kernel is compiled; a second signal does not wait for that")


class _Waiting:
    """Finished tasks that wait to be saved together: a part file each would cost more than small tasks take to learn."""

    def __init__(self, artefact: StoreWork, tally: Tally) -> None:
        self._artefact, self._tally = artefact, tally
        self._held: list[tuple[Integers, Rows]] = []
        self._since = time.monotonic()

    def add(self, ids: Integers, rows: Rows) -> None:
        """Takes finished tasks, and saves once enough have come or enough time has passed."""
        if not len(ids):
            return
        self._held.append((ids, rows))
        size = sum(values.nbytes for _, held in self._held for values in held.values())
        if size >= SAVE_BYTES or time.monotonic() - self._since >= SAVE_SECONDS:
            self.save()

    def save(self) -> None:
        """Saves what is held."""
        import numpy as np

        if self._held:
            ids = np.concatenate([held for held, _ in self._held])
            names = self._held[0][1]
            rows = {name: np.concatenate([rows[name] for _, rows in self._held]) for name in names}
            self._artefact.save(rows, ids)
            self._tally.steps += int(rows["steps"].sum())
            self._tally.seconds += float(rows["seconds"].sum())
        self._held = []
        self._since = time.monotonic()
