"""Making an artefact: saved part by part as it is learned, then there under its name in one step."""

from __future__ import annotations

import stat
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager, suppress
from functools import partial
from pathlib import Path
from typing import Any, Self

import h5py
import numpy as np

from qinit_store import encoding, folder, kinds, publish
from qinit_store.digest import task_digests
from qinit_store.disk import Disk
from qinit_store.errors import Busy, Damaged, NotFound, Refused, SystemFailed, TooNew
from qinit_store.interrupts import HeldBack, held_back
from qinit_store.lock import Lock, held
from qinit_store.presence import AGAIN, exists, is_folder, status
from qinit_store.reading import Artefact, Told, describe, open_artefact, open_part, silent
from qinit_store.saved import SavedTasks
from qinit_store.schema import TASK, TASK_DIGEST, Array, Schema
from qinit_store.spec import Spec, canonical_json, difference, without_tasks

DISK = Disk()
NO_TASKS: Array = np.empty(0, dtype=np.int64)
ROOM_BEYOND_PARTS = 1024 * 1024  # indices, attributes and rounding in the final file


@contextmanager
def open_work(
    target: Path,
    schema: Schema,
    spec: Spec,
    *,
    tasks: Any = None,
    force: bool = False,
    wait: bool = False,
    provenance: Mapping[str, Any] | None = None,
    disk: Disk = DISK,
) -> Iterator[Work]:
    """The work on `target`, locked against other processes until the block is left.

    `spec["tasks"]`, where there is one, is a number n that stands for the ids 0 to n-1; `tasks` are those
    of them that make it complete, all where None. `provenance` (its "command" above all) is kept beside the
    parts, so that an unfinished artefact can say how to go on.

    Refused where there are other settings under that name or more tasks than asked for, unless `force`; Busy
    where another process writes it, unless `wait`; Damaged where what stands there cannot be trusted, unless
    `force`.
    """
    work = Work(target, schema, spec, tasks, dict(provenance or {}), force=force, disk=disk)
    if work.look():
        work.sweep()
        yield work
        return
    _make_parents(target.parent, disk)
    with held(work.folder, disk, wait=wait) as lock:
        if not work.look():
            work.take_up(lock)
        try:
            yield work
        finally:
            work.leave(lock)


class Work:
    """An artefact in the making. Made by `open_work`."""

    def __init__(
        self,
        target: Path,
        schema: Schema,
        spec: Spec,
        tasks: Any,
        provenance: dict[str, Any],
        *,
        force: bool,
        disk: Disk,
    ) -> None:
        canonical_json(spec)
        lack = kinds.lack(schema, part=False)
        if lack:
            raise ValueError(f"{schema.kind}: the schema lacks {lack}")
        self.target = target
        self.folder = folder.work_folder(target)
        self.complete = False
        self.set_aside = 0
        self._schema = schema
        self._record = folder.Record(schema.kind, dict(spec), provenance)
        self._wanted = np.arange(self.asked) if tasks is None else _checked_ids(tasks)
        self._force = force
        self._disk = disk
        self._saved = SavedTasks()
        self._standing_ids: Array = NO_TASKS  # of the tasks in the artefact that is there already
        self._stood = ""  # its content hash
        self._lock: Lock | None = None
        self._replaces = force
        self._published = False
        self._failure: SystemFailed | None = None

    @property
    def saved(self) -> Array:
        """The ids of the tasks that need not be learned again, ascending."""
        return self._saved.ids

    @property
    def kept(self) -> int:
        """How many of these are still on the disk: other programs may remove part files; SystemFailed."""
        return self._saved.count(set(folder.part_paths(self.folder)))

    @property
    def asked(self) -> int:
        """The number of tasks the spec asks for; 0 where it has none."""
        return _asked(self._record.spec)

    def look(self) -> bool:
        """Whether the target stands there complete. Refused or Damaged where it stands in the way."""
        _refuse_odd(self.target)
        if self._force or status(self.target) is None:
            return False
        with self._standing() as artefact:
            self._compare(artefact)
            self._standing_ids = artefact.tasks
            same = _asked(artefact.spec) == self.asked
            self.complete = same and bool(np.isin(self._wanted, self._standing_ids).all())
            if self.complete:
                self._saved = SavedTasks()
                self._saved.add(self.target, artefact.tasks, artefact.digests)
                self._disk.touch(self.target)
        return self.complete

    def take_up(self, lock: Lock) -> None:
        """Load what earlier runs saved; the folder is locked."""
        self._lock = lock
        folder.remove_temporaries(self.folder, self._disk)
        if self._force:
            self._discard_other_work()
        self._refuse_other_work()
        self._load_parts()
        # Flushes the directory too: a part may have been renamed by a process that died before it did that.
        folder.write_record(self.folder, self._record, self._disk)
        if not self._force and status(self.target) is not None:
            with self._standing() as artefact:
                # one of an earlier version may lack columns: its tasks are learned again
                if self._given <= {column.name for column in artefact.schema.task_columns}:
                    self.adopt(artefact)
            self._replaces = True

    def save(self, rows: Mapping[str, Any], tasks: Any) -> None:
        """Bring the tasks with ids `tasks` durably into one part file; nothing is counted before it is.

        `rows` holds every column with a task axis but the digests. SystemFailed leaves everything saved
        before.
        """
        ids = _checked_ids(tasks)
        known = np.sort(ids[self._saved.known(ids)])
        if known.size:
            raise ValueError(f"tasks {known[:5].tolist()} are saved already")
        columns = encoding.checked(self._schema, self._schema.task_columns, rows, ids.size)
        if (np.diff(ids) < 0).any():
            order = np.argsort(ids)
            ids, columns = ids[order], {name: values[order] for name, values in columns.items()}
        self._save(columns, ids)

    def row(self, number: int) -> dict[str, Array]:
        """The verified columns of the saved task with the id `number`, without their task axis."""
        with _OpenParts(self._schema.kind) as parts:
            rows, check = self._gathered(np.array([number]), parts)
        check()
        return {name: values[0] for name, values in rows.items()}

    def adopt(self, artefact: Artefact, places: Mapping[int, int] | None = None) -> None:
        """Take over the tasks of an artefact with the same spec apart from "tasks".

        Refused otherwise, and where it lacks a column: an earlier version wrote it. `places` takes tasks over from another spec:
        it has their ids here by their ids there, and the caller answers for their being the same tasks.
        """
        if places is None:
            self._compare(artefact, enough=False)
        given = self._given
        if lacking := given - {column.name for column in artefact.schema.task_columns}:
            raise Refused(
                f"{artefact.path} has no {', '.join(sorted(lacking))}, which later versions store; make it again with --force"
            )
        artefact.expect(self._part_schema.axes, self._schema.task_columns)
        for block in artefact.blocks(given, artefact.schema.block_size):
            own = block[TASK]
            if places is not None:
                own = np.array([places.get(number, -1) for number in own.tolist()])
            new = (own >= 0) & (own < self.asked) & ~self._saved.known(own)
            if new.any():
                self.save({name: block[name][new] for name in given}, own[new])

    def finish(
        self,
        tasks: Any = None,
        statics: Mapping[str, Any] | None = None,
        provenance: Mapping[str, Any] | None = None,
        inputs: Sequence[Mapping[str, str]] = (),
        *,
        threads: int = 1,
        written: Told = silent,
        checked: Told = silent,
    ) -> Path:
        """Publish the tasks with ids `tasks`, all of them saved, and the `statics`; the artefact's path.

        The work folder goes. On at most `threads` threads; memory is bounded by some blocks of tasks. `written` and then
        `checked` receive how many tasks of how many the new file holds, and how many of them were read back.
        """
        ids = np.sort(_checked_ids(NO_TASKS if tasks is None else tasks))
        self._refuse_beyond(ids)
        missing = ids[~self._saved.known(ids)]
        if missing.size:
            raise ValueError(f"tasks {missing[:5].tolist()} are not saved")
        values = encoding.checked(self._schema, self._schema.static_columns, statics or {}, 0)
        header = self._header(f"qinit/{self._schema.kind}", self._record.spec, provenance or {}, inputs)
        whole = self.folder / folder.WHOLE
        with self._keeping():
            content = self._build(whole, header, ids, values, threads, written)
            self._check(whole, content, threads, checked)
            self._refuse_replaced()
            publish.reveal(self._disk, whole, self.target, replace=self._replaces)
            self.complete = self._published = True
            folder.remove_folder(self.folder, self._disk)
        return self.target

    def leave(self, lock: Lock) -> None:
        """Take the work folder away where it holds nothing that would be missed; where the system fails it stays."""
        if self._published or (self.set_aside and not self.complete):
            return
        with suppress(SystemFailed):
            if not lock.holds or any(self._holds_more(path) for path in folder.part_paths(self.folder)):
                return
            folder.remove_folder(self.folder, self._disk)

    def sweep(self) -> None:
        """Take away the folder that a process left which died between publishing and cleaning up."""
        try:
            if not is_folder(self.folder):
                return
            with held(self.folder, self._disk, wait=False) as lock:
                self.leave(lock)
        except (Busy, Refused, SystemFailed):
            return  # the artefact is there and whole, which is all that was asked

    def _save(self, columns: dict[str, Array], ids: Array) -> None:
        digests = task_digests(self._schema.task_columns, ids, columns)
        rows = {**columns, TASK_DIGEST: digests}
        header = self._header(f"qinit/part/{self._schema.kind}", self._part_spec, {}, ())
        image = encoding.image(header, self._part_schema, ids, digests, rows, passing=True)
        path = self.folder / folder.part_name(int(ids[0]), ids.size, digests[0].tobytes().hex())
        with self._keeping():
            publish.place(self._disk, path, image)
        self._saved.add(path, ids, digests)

    @property
    def _part_spec(self) -> dict[str, Any]:
        return without_tasks(self._record.spec)

    @property
    def _given(self) -> set[str]:
        """The columns with a task axis that are not made from the others."""
        return {column.name for column in self._schema.task_columns if column.given}

    @property
    def _part_schema(self) -> Schema:
        """The schema of the part files: what has a task axis, and its axes."""
        used = {name for column in self._schema.task_columns for name in column.dims}
        axes = tuple(axis for axis in self._schema.axes if axis.name in used)
        return Schema(self._schema.kind, axes, self._schema.task_columns)

    def _header(
        self, format: str, spec: Spec, provenance: Mapping[str, Any], inputs: Iterable[Mapping[str, str]]
    ) -> encoding.Header:
        return encoding.Header(format, spec, provenance, tuple(inputs))

    def _standing(self) -> Artefact:
        try:
            artefact = open_artefact(self.target, self._schema.kind)
        except Damaged as damage:
            raise type(damage)(f"{damage}, or learn it again with --force") from damage
        self._stood = artefact.content_sha256
        return artefact

    def _refuse_replaced(self) -> None:
        """Refused where what is to grow is no longer what was read: its tasks are in no file of ours."""
        if not self._replaces or self._force:
            return
        try:
            there = describe(self.target).content_sha256
        except NotFound:
            return
        except Damaged:
            there = ""
        if there != self._stood:
            raise Refused(
                f"{self.target} was replaced by another program while this was being written; the {len(self._saved)}"
                f" tasks are kept in {self.folder}; give another name with -o, or --force"
            )

    def _compare(self, artefact: Artefact, *, enough: bool = True) -> None:
        """Refused where `artefact` has other settings than this work or, with `enough`, more tasks."""
        other = difference(self._part_spec, without_tasks(artefact.spec))
        if not other and enough and self.asked < _asked(artefact.spec):
            other = f"tasks: asked for {self.asked}, there is {_asked(artefact.spec)}"
        if other:
            raise Refused(
                f"{artefact.path} has other settings ({other}); give another name with -o, or --force"
            )

    def _discard_other_work(self) -> None:
        kept = self._kept()
        other = kept is None or kept.kind != self._schema.kind or bool(self._other_settings(kept.spec))
        if other or any((self._ids(path) >= self.asked).any() for path in folder.part_paths(self.folder)):
            folder.remove_parts(self.folder, self._disk)

    def _holds_more(self, path: Path) -> bool:
        """Whether a part file has tasks the artefact lacks, or belongs to other settings."""
        kept = folder.read_record(self.folder)
        other = kept is not None and bool(self._other_settings(kept.spec))
        return other or not np.isin(self._ids(path), self._standing_ids).all()

    def _ids(self, path: Path) -> Array:
        """The ids in a part file; none where it cannot be trusted."""
        try:
            with open_part(path, self._schema.kind) as part:
                return part.tasks
        except (Damaged, NotFound, Refused):
            return NO_TASKS

    def _refuse_other_work(self) -> None:
        kept = self._kept()
        if kept is None:
            return
        other = self._other_settings(kept.spec)
        if kept.kind != self._schema.kind:
            other = f"kind: asked for {self._schema.kind}, there is {kept.kind}"
        if other:
            raise Refused(
                f"{self.target} was begun with other settings ({other}); finish it with {kept.command},"
                " give another name with -o, or discard it with --force"
            )

    def _kept(self) -> folder.Record | None:
        """What the work folder was begun for, from its record or else from a part; None where it is empty."""
        kept = folder.read_record(self.folder)
        for path in folder.part_paths(self.folder) if kept is None else ():
            try:
                with open_part(path, self._schema.kind) as part:
                    return folder.Record(part.kind, part.spec)
            except (Damaged, NotFound, Refused):
                continue
        return kept

    def _other_settings(self, spec: Spec) -> str:
        return difference(self._part_spec, without_tasks(spec))

    def _load_parts(self) -> None:
        for path in folder.part_paths(self.folder):
            try:
                self._load(path)
            except TooNew:
                if not self._force:
                    raise  # what a later version saved is not ours to learn again
                folder.set_bad_aside(path, self._disk)
            except (Damaged, Refused):
                self.set_aside += _count_by_name(path)
                folder.set_bad_aside(path, self._disk)
        self._refuse_beyond(np.arange(self.asked))

    def _load(self, path: Path) -> None:
        found = status(path)
        if found is not None and not stat.S_ISREG(found.st_mode):
            raise Damaged(f"{path} is no regular file")
        with open_part(path, self._schema.kind) as part:
            self._compare(part, enough=False)
            if _essence(part.schema) != _essence(self._part_schema):
                raise Damaged(f"{path} has other columns than this version writes")
            if self._saved.known(part.tasks).any():
                raise Damaged(f"{path} repeats tasks of another part")
            part.expect((), self._schema.task_columns)
            part.check_tasks()
            self._saved.add(path, part.tasks, part.digests)

    def _refuse_beyond(self, asked: Array) -> None:
        """Refused where a saved task is not asked for: it would be thrown away silently."""
        ids = self._saved.ids
        beyond = ids[~np.isin(ids, asked)]
        if not beyond.size:
            return
        kept = folder.read_record(self.folder) or self._record
        raise Refused(
            f"{self.target} was begun for {kept.spec.get('tasks', 'more')} tasks and holds task {beyond[-1]},"
            f" asked for are {asked.size}; finish it with {kept.command}, give another name with -o,"
            " or discard it with --force"
        )

    def _build(
        self,
        whole: Path,
        header: encoding.Header,
        ids: Array,
        statics: Mapping[str, Array],
        threads: int,
        told: Told,
    ) -> str:
        """Write the final file; its content hash."""
        digests = self._saved.digests(ids)
        with held_back() as signals:
            growing = publish.Growing(self._disk, whole, self._room(ids, statics))
            try:
                with ExitStack() as stack:
                    parts = stack.enter_context(_OpenParts(self._schema.kind))
                    file = stack.enter_context(h5py.File(growing, "w", libver=encoding.LIBVER))
                    blocks = self._blocks(ids, parts, growing, signals, told)
                    content = encoding.write(
                        file, header, self._schema, ids, digests, statics, blocks, threads=threads
                    )
                growing.finish()
            except BaseException:
                growing.abandon()
                growing.check()  # what HDF5 made of it is of no interest
                raise
        return content

    def _room(self, ids: Array, statics: Mapping[str, Array]) -> int:
        parts = sum(_size(path) for path in self._saved.paths(ids))
        return ROOM_BEYOND_PARTS + parts + sum(values.nbytes for values in statics.values())

    def _blocks(
        self, ids: Array, parts: _OpenParts, growing: publish.Growing, signals: HeldBack, told: Told
    ) -> Iterator[tuple[dict[str, Array], encoding.Check]]:
        """The rows of the parts in the order of `ids`, about 8 MiB at a time, and what verifies them."""
        size = self._schema.block_size
        for first in range(0, ids.size, size):
            growing.check()
            signals.deliver()
            yield self._gathered(ids[first : first + size], parts)
            told(min(first + size, ids.size), ids.size)
        growing.check()

    def _gathered(self, ids: Array, parts: _OpenParts) -> tuple[dict[str, Array], encoding.Check]:
        block = {
            column.name: np.empty((ids.size, *self._schema.row_shape(column)), dtype=column.little_endian)
            for column in self._schema.task_columns
        }
        checks: list[encoding.Check] = []
        for path, positions, found in self._saved.by_path(ids):
            # Parts and blocks are in the order of ids, so what lies between belongs to the block too.
            rows, check = parts[path].rows_to_check(int(found[0]), int(found[-1]) + 1)
            checks.append(check)
            for name, values in block.items():
                values[positions] = rows[name]
        return block, partial(_all_hold, checks)

    def _check(self, whole: Path, content: str, threads: int, told: Told) -> None:
        """Read the final file back; every digest must hold."""
        try:
            with open_artefact(whole, self._schema.kind) as artefact:
                artefact.check_tasks(threads, told)
                sound = artefact.content_sha256 == content
        except Damaged:
            sound = False
        if not sound:
            raise SystemFailed(f"{whole} does not read back as it was written; is the disk sound?")

    @contextmanager
    def _keeping(self) -> Iterator[None]:
        """Report what is kept when the system fails; a failed flush is never tried again by this work.

        The folder may be moved or removed by others at any time; into one that is not locked nothing is written.
        """
        if self._failure is not None:
            raise self._failure
        try:
            if self._lock is not None and not self._lock.holds:
                raise SystemFailed(self._gone())
            yield
        except (SystemFailed, NotFound, FileNotFoundError, FileExistsError) as failure:
            self._failure = SystemFailed(self._kept_after(failure))
            raise self._failure from failure

    def _kept_after(self, failure: Exception) -> str:
        """The failure, what of the saved tasks is still there, and how to go on."""
        try:
            if self._lock is not None and not self._lock.holds:
                return self._gone()
            kept = folder.tasks_saved(self.folder)
        except SystemFailed:
            kept = len(self._saved)  # nobody took them away
        reason = str(failure).removesuffix(AGAIN)
        if isinstance(failure, OSError):
            reason = f"cannot write {failure.filename}: {failure.strerror}"
        if isinstance(failure, NotFound):
            reason = f"{reason.partition(';')[0]}: it was moved or removed by another program"
        return f"{reason}{f'; {kept} tasks are kept in {self.folder}' if kept else ''}{AGAIN}"

    def _gone(self) -> str:
        """What happened where the folder is no longer the one that was locked."""
        saved = len(self._saved)
        if is_folder(self.folder):
            return (
                f"the lock of {self.folder} was removed or the folder replaced while this was being written, so nothing"
                f" more is written there; {folder.tasks_saved(self.folder)} of {saved} saved tasks are in it, the same"
                " command goes on with these"
            )
        if not saved:
            return (
                f"the work folder {self.folder} was moved or removed while this was being written; nothing was saved in"
                " it, the same command begins anew"
            )
        return (
            f"the work folder {self.folder} was moved or removed while this was being written, with {saved} saved tasks"
            " in it; move it back and the same command goes on with them, without it they are learned again"
        )


class _OpenParts:
    """Part files that are open, the few that were asked for last: a block after a block is mostly in the same."""

    MOST = 4

    def __init__(self, kind: str) -> None:
        self._kind = kind
        self._open: dict[Path, Artefact] = {}  # the one asked for last at the end

    def __getitem__(self, path: Path) -> Artefact:
        if path not in self._open:
            if len(self._open) == self.MOST:
                self._open.pop(next(iter(self._open))).close()
            self._open[path] = open_part(path, self._kind)
        self._open[path] = self._open.pop(path)
        return self._open[path]

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *error: object) -> None:
        for part in self._open.values():
            part.close()


def _all_hold(checks: Iterable[encoding.Check]) -> None:
    for check in checks:
        check()


def _make_parents(path: Path, disk: Disk) -> None:
    missing = [one for one in (path, *path.parents) if not exists(one)]
    for one in reversed(missing):
        try:
            disk.make_directory(one)
        except FileExistsError:
            continue
        disk.sync_directory(one.parent)


def _refuse_odd(target: Path) -> None:
    found = status(target)
    if found is not None and not stat.S_ISREG(found.st_mode):
        raise Refused(f"{target} is no regular file, so it is not replaced; give another name with -o")


def _size(path: Path) -> int:
    found = status(path)
    if found is None:
        raise NotFound(f"there is no {path}")
    return found.st_size


def _asked(spec: Spec) -> int:
    return int(spec.get("tasks", 0))


def _checked_ids(tasks: Any) -> Array:
    ids = np.asarray(tasks)
    if ids.ndim != 1 or ids.dtype.kind not in "iu" or np.unique(ids).size != ids.size or (ids < 0).any():
        raise ValueError(f"task ids must be one row of distinct whole numbers from 0, not {tasks!r}")
    return ids.astype(np.int64)


def _essence(schema: Schema) -> tuple[object, ...]:
    """What two schemas must share for their numbers to go into one artefact."""
    axes = {axis.name: (axis.values.dtype.str, axis.values.tobytes()) for axis in schema.axes}
    columns = {one.name: (one.dims, one.little_endian.str, one.hashed) for one in schema.columns}
    return axes, columns


def _count_by_name(path: Path) -> int:
    match = folder.PART.fullmatch(path.name)
    return int(match[2]) if match else 0
