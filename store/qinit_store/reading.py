"""Reading artefacts: what is yielded has been verified against the digests stored with it."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from types import TracebackType
from typing import Any, Self

import h5py
import numpy as np

from qinit_store import guard, kinds
from qinit_store.digest import content_sha256, task_digests
from qinit_store.encoding import MIN_READER, SCHEMA_VERSION
from qinit_store.errors import Damaged, NotOurs, Refused, StoreError, TooNew
from qinit_store.in_order import in_order
from qinit_store.interrupts import held_back
from qinit_store.schema import (
    ANYTHING,
    DIGEST_BYTES,
    TASK,
    TASK_DIGEST,
    Array,
    Axis,
    Column,
    Schema,
    serves,
)
from qinit_store.source import Source
from qinit_store.spec import canonical_json, read_json, settings, spec_sha256, texts
from qinit_store.wording import first_few, shell_line

FORMAT, PART = "qinit/", "part/"  # how the format of an artefact begins, and a part's goes on
ROOT_ATTRIBUTES = (
    "qinit_format",
    "qinit_schema",
    "qinit_min_reader",
    "tasks",
    "spec_json",
    "spec_sha256",
    "content_sha256",
    "provenance_json",
    "inputs_json",
)

Told = Callable[[int, int], None]  # receives how many tasks of how many are done


def silent(done: int, tasks: int) -> None:
    """Tells nobody."""


@dataclass(frozen=True)
class Description:
    """The root attributes of an artefact, not verified against its content; or of an unfinished one."""

    path: Path
    kind: str
    spec: dict[str, Any]
    spec_sha256: str
    content_sha256: str
    provenance: dict[str, Any]
    inputs: tuple[dict[str, str], ...]
    tasks: int
    schema_version: int
    size: int  # bytes
    state: str = "done"  # or "unfinished", "being written", "unreadable", and those of errors.Damaged
    problem: str = ""  # why it is not done


class Artefact:
    """An open artefact whose content hash holds; task rows are verified as they are read."""

    def __init__(
        self, source: Source, file: h5py.File, description: Description, format: str, *, trust: bool
    ) -> None:
        self._source = source
        self._file = file
        self._description = description
        self.path = description.path
        self.kind = description.kind
        self.spec = description.spec
        self.spec_sha256 = description.spec_sha256
        self.content_sha256 = description.content_sha256
        self.provenance = description.provenance
        self.inputs = description.inputs
        self.schema_version = description.schema_version
        self.format = format
        self._ahead: dict[str, Array] = {}
        contents = source.asked(lambda: _contents(file, description.kind))
        self.schema, self.tasks = contents.schema, contents.tasks
        self._digests, self._statics = contents.digests, contents.statics
        self.strange = contents.strange
        part = format.startswith("qinit/part/")
        lack = source.asked(lambda: kinds.lack(self.schema, part=part))
        if lack:
            raise source.damage("; ".join([f"it lacks {lack}", *self.strange]))
        self.trouble = source.asked(self._content_trouble)
        if self.trouble and trust:
            raise source.damage("; ".join([self.trouble, *self.strange]))
        if self.strange and trust:
            raise NotOurs(self.strangeness)

    @property
    def strangeness(self) -> str:
        """A sentence on what the file holds that qinit did not write; "" where there is nothing."""
        if not self.strange:
            return ""
        some = first_few(self.strange, 3, "; ")
        return (
            f"{self.path} was changed by another program after qinit wrote it: {some};"
            f" `{shell_line('qinit', 'salvage', self.path)}` writes an artefact without that"
        )

    def damage(self, reason: str) -> StoreError:
        """Damaged for this reason: what was read cannot be what was written."""
        return self._source.damage(reason)

    def expect(self, axes: Iterable[Axis], columns: Iterable[Column]) -> None:
        """From now on every value must be one that its column of `columns` may have; a column may be absent.

        Damaged where one of these `axes`, a column's layout or a value that all tasks share does not fit; tasks are checked as
        they are read.
        """
        there = {axis.name: axis.values for axis in self.schema.axes}
        for axis in axes:
            if axis.name not in there or not _same_scale(axis.values, there[axis.name]):
                raise self.damage(f"its axis {axis.name} is not that of its settings")
        known = {column.name: column for column in columns}
        for column in self.schema.columns:
            if column.name in known and not serves(column, known[column.name]):
                raise self.damage(f"{column.name} is laid out otherwise than its settings have it")
        self.schema = replace(
            self.schema,
            columns=tuple(_within(one, known.get(one.name, one)) for one in self.schema.columns),
        )
        if fault := self.schema.fault(self._statics):
            raise self.damage(fault)

    @property
    def axes(self) -> dict[str, Axis]:
        """Every axis by name, `task` among them where there are tasks."""
        axes = {axis.name: axis for axis in self.schema.axes}
        return (
            axes if not self.schema.task_columns else {TASK: Axis(TASK, self.tasks, "1", "task id"), **axes}
        )

    @property
    def task_count(self) -> int:
        return self.tasks.size

    @property
    def digests(self) -> Array:
        """(tasks, 32) u1: the stored digest of every task."""
        return self._digests.copy()

    def read(self, name: str) -> Array:
        """The whole dataset `name`, verified."""
        if name in self._statics:
            return self._statics[name].copy()
        if name == TASK:
            return self.tasks.copy()
        return self.columns((name,))[name]

    def columns(self, names: Iterable[str]) -> dict[str, Array]:
        """The whole task columns `names`, verified, in one pass."""
        columns = [self._column(name) for name in names]
        whole = {
            column.name: np.empty(
                (self.task_count, *self.schema.row_shape(column)), dtype=column.little_endian
            )
            for column in columns
        }
        first = 0
        for block in self.blocks(whole, self.schema.block_size):
            for name, values in whole.items():
                values[first : first + len(block[TASK])] = block[name]
            first += len(block[TASK])
        return whole

    def read_ahead(self, names: Iterable[str]) -> dict[str, Array]:
        """The whole columns `names`, not verified until every row has been read.

        For a first look at small columns whose rows are read in full later, or given to `check_tasks`: these very
        numbers are kept, and verified then.
        """
        wanted = [self._column(name).name for name in names]
        self._ahead |= self._source.asked(lambda: {name: self._file[name][...] for name in wanted})
        if fault := self.schema.fault(self._ahead):  # these numbers are used before their digests are checked
            raise self.damage(fault)
        return {name: self._ahead[name].copy() for name in wanted}

    def blocks(self, names: Iterable[str], size: int) -> Iterator[dict[str, Array]]:
        """The columns `names`, and `task`, of `size` tasks at a time, in the order of ids, verified."""
        columns = [self._column(name) for name in names]
        for first in range(0, self.task_count, size):
            rows = self.rows(first, min(first + size, self.task_count))
            yield {TASK: rows[TASK]} | {column.name: rows[column.name] for column in columns}

    def rows(self, first: int, stop: int) -> dict[str, Array]:
        """Every task column, and `task`, of the rows from `first` up to `stop`, verified."""
        rows, check = self.rows_to_check(first, stop)
        check()
        return rows

    def rows_to_check(self, first: int, stop: int) -> tuple[dict[str, Array], Callable[[], None]]:
        """The same, not verified, and what verifies them, on any thread; no number of theirs counts before it has returned."""
        rows = self._unverified(first, stop)
        return rows, partial(self._check, first, rows)

    def _check(self, first: int, rows: dict[str, Array]) -> None:
        if (wrong := self._undigested(first, rows)).any():
            raise self.damage(f"the digest of task {first_few(rows[TASK][wrong].tolist(), 5)} does not hold")
        if (wrong := self.schema.misfits(rows)).any():
            raise self.damage(f"in task {first_few(rows[TASK][wrong].tolist(), 5)} {self.schema.fault(rows)}")

    def check_tasks(self, threads: int = 1, told: Told = silent) -> None:
        """Read every task; Damaged where a digest does not hold, or a value cannot be.

        Read on this thread, checked on `threads`; `told` receives how many tasks of how many have been read.
        """
        for _ in in_order(self._checks(told), threads, threads):
            pass

    def _checks(self, told: Told) -> Iterator[Callable[[], None]]:
        for first in range(0, self.task_count, self.schema.block_size):
            stop = min(first + self.schema.block_size, self.task_count)
            yield self.rows_to_check(first, stop)[1]
            told(stop, self.task_count)

    def close(self) -> None:
        _close(self._source, self._file)

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def _unverified(self, first: int, stop: int) -> dict[str, Array]:
        names = [column.name for column in self.schema.task_columns]
        left = [name for name in names if name not in self._ahead]
        read = self._source.asked(lambda: {name: self._file[name][first:stop] for name in left})
        rows = {name: read[name] if name in read else self._ahead[name][first:stop].copy() for name in names}
        return {TASK: self.tasks[first:stop].copy(), **rows}

    def damaged_tasks(self, told: Told = silent) -> Array:
        """The ids of the tasks that cannot be read, whose digest does not hold, or that hold a value that cannot be.

        `told` receives how many tasks of how many have been read, after each block.
        """
        found = [self.tasks[:0]]
        for first in range(0, self.task_count, self.schema.block_size):
            found.append(self._damaged(first))
            told(min(first + self.schema.block_size, self.task_count), self.task_count)
        return np.concatenate(found)

    def _damaged(self, first: int) -> Array:
        stop = min(first + self.schema.block_size, self.task_count)
        try:
            return self._wrong(first, self._unverified(first, stop))
        except Damaged:
            return np.array(
                [self.tasks[row] for row in range(first, stop) if not self._holds(row)], dtype=np.int64
            )

    def _holds(self, row: int) -> bool:
        try:
            return not self._wrong(row, self._unverified(row, row + 1)).size
        except Damaged:
            return False

    def _wrong(self, first: int, rows: dict[str, Array]) -> Array:
        wrong: Array = rows[TASK][self._undigested(first, rows) | self.schema.misfits(rows)]
        return wrong

    def _undigested(self, first: int, rows: dict[str, Array]) -> Array:
        stored = self._digests[first : first + rows[TASK].size]
        found = task_digests(self.schema.task_columns, rows[TASK], rows)
        wrong: Array = (found != stored).any(axis=1)
        return wrong

    def _column(self, name: str) -> Column:
        for column in self.schema.task_columns:
            if column.name == name:
                return column
        there = ", ".join(sorted(column.name for column in self.schema.columns))
        raise Refused(f"{self.path} has no {name} for each task; it has {there}")

    def _content_trouble(self) -> str:
        """What does not hold of the content as a whole, tasks apart; "" where all does."""
        if spec_sha256(self.spec) != self.spec_sha256:
            return "its settings are not those it was written with"
        if self.task_count != self._description.tasks:
            return f"it holds {self.task_count} tasks, not {self._description.tasks}"
        spec_json = canonical_json(self.spec)
        found = content_sha256(self.kind, spec_json, self.tasks, self._digests, self._statics)
        return "" if found == self.content_sha256 else "its content hash does not hold"


def open_artefact(path: Path, kind: str | None = None) -> Artefact:
    """The artefact at `path`, its content hash verified.

    NotFound, Refused where it is of another kind than `kind`, Damaged where it is not as it was written.
    """
    return _open(path, kind)


def open_doubtful(path: Path) -> Artefact:
    """An artefact whose content hash need not hold: `trouble` says what does not. For verify and salvage."""
    return _open(path, None, trust=False)


def open_part(path: Path, kind: str) -> Artefact:
    """A part file of a work folder, verified like an artefact."""
    return _open(path, f"{PART}{kind}")


def describe(path: Path) -> Description:
    """The root attributes of the artefact at `path`; nothing else is read."""
    source, file = _opened(path)
    try:
        return source.asked(lambda: _described(source, file))[0]
    finally:
        _close(source, file)


def _open(path: Path, wanted: str | None, *, trust: bool = True) -> Artefact:
    """The artefact, or with "part/KIND" the part; None: an artefact of whatever kind."""
    source, file = _opened(path)
    try:
        description, format = source.asked(lambda: _described(source, file))
        found = format.removeprefix(FORMAT)
        if found.startswith(PART) if wanted is None else found != wanted:
            raise Refused(f"{path} is of the kind {found}; {_needed(wanted)}")
        return Artefact(source, file, description, format, trust=trust)
    except BaseException:
        _close(source, file)
        raise


def _needed(wanted: str | None) -> str:
    """Which kinds would do, and the commands that make them."""
    names = [wanted] if wanted else list(kinds.REGISTERED)
    makers = [kinds.REGISTERED[name].maker for name in names if name in kinds.REGISTERED]
    made = f", as made by {' or '.join(f'`qinit {maker}`' for maker in makers)}" if makers else ""
    return f"{' or '.join(names) or 'a finished artefact'} is needed{made}"


def _opened(path: Path) -> tuple[Source, h5py.File]:
    source = Source(path)
    try:
        guard.check_beginning(source)
        return source, source.asked(lambda: h5py.File(source, "r"))
    except BaseException:
        source.close()
        raise


def _close(source: Source, file: h5py.File) -> None:
    with held_back():  # HDF5 calls the source while it closes
        file.close()
    source.close()


def _described(source: Source, file: h5py.File) -> tuple[Description, str]:
    """The root attributes, and the format among them."""
    path, said = source.path, guard.attributes(file.id, ROOT_ATTRIBUTES)
    if "qinit_format" not in said:
        raise NotOurs(f"{path} is an HDF5 file, but no artefact of qinit's: it has no qinit_format")
    format = _text(said, "qinit_format")
    kind = format.removeprefix(FORMAT).removeprefix(PART)
    if not (format.startswith(FORMAT) and kinds.known(kind)):
        raise NotOurs(f"{path} is no artefact that this qinit knows: its format is {format!r}")
    needed = _count(said, "qinit_min_reader")
    if needed > SCHEMA_VERSION:
        raise TooNew(
            f"{path} was written by a newer qinit: it needs a reader of schema"
            f" {needed}, this one reads {MIN_READER} to {SCHEMA_VERSION};"
            " `pip install --upgrade qinit`"
        )
    description = Description(
        path=path,
        kind=kind,
        spec=settings(read_json(_text(said, "spec_json"))),
        spec_sha256=_text(said, "spec_sha256"),
        content_sha256=_text(said, "content_sha256"),
        provenance=texts(read_json(_text(said, "provenance_json"))),
        inputs=_inputs(read_json(_text(said, "inputs_json"))),
        tasks=_count(said, "tasks"),
        schema_version=_count(said, "qinit_schema"),
        size=source.size,
    )
    return description, format


@dataclass(frozen=True)
class _Contents:
    schema: Schema
    tasks: Array  # ids
    digests: Array  # (tasks, 32) u1
    statics: dict[str, Array]  # every dataset without a task axis
    strange: list[str]  # in words what qinit did not write


def _contents(file: h5py.File, kind: str) -> _Contents:
    """What the file holds, but for the tasks' columns."""
    datasets, strange = guard.checked_datasets(file)
    dims = {name: tuple(_text(one.attributes, "dims").split(" ")) for name, one in datasets.items()}
    guard.check_shares(datasets, {name for name in dims if dims[name][0] == TASK})
    axes = tuple(_axis(name, datasets[name]) for name in dims if dims[name] == (name,) and name != TASK)
    names = [name for name in dims if name not in {TASK, *(axis.name for axis in axes)}]
    schema = Schema(kind, axes, tuple(_read_column(name, datasets[name], dims[name]) for name in names))
    ids: Array = _ids(datasets[TASK].dataset) if schema.task_columns else np.empty(0, dtype=np.int64)
    for column in schema.columns:
        led = (ids.size,) if column.per_task else ()
        if datasets[column.name].dataset.shape != (*led, *schema.row_shape(column)):
            raise ValueError(f"{column.name} does not fit its axes")
    statics = {axis.name: axis.values for axis in axes}
    statics |= {column.name: datasets[column.name].dataset[...] for column in schema.static_columns}
    none = np.empty((0, DIGEST_BYTES), dtype=np.uint8)
    digests = datasets[TASK_DIGEST].dataset[...] if schema.task_columns else none
    return _Contents(schema, ids, digests, statics, strange)


def _ids(dataset: h5py.Dataset) -> Array:
    if dataset.dtype != np.dtype("<i8") or dataset.ndim != 1:
        raise ValueError("the task ids are no row of whole numbers")
    ids: Array = dataset[...]
    if (ids < 0).any() or (np.diff(ids) <= 0).any():
        raise ValueError("the task ids do not ascend")
    return ids


def _axis(name: str, found: guard.Checked) -> Axis:
    axis = Axis(name, found.dataset[...], *_labels(found))
    if axis.values.dtype.kind == "S" and not all(label.isascii() for label in axis.values.tolist()):
        raise ValueError(f"a label of its axis {name} is not in ASCII")
    return axis


def _read_column(name: str, found: guard.Checked, dims: tuple[str, ...]) -> Column:
    hashed = "hashed" not in found.attributes
    return Column(name, dims, found.dataset.dtype.str, *_labels(found), hashed=hashed, **ANYTHING)


def _labels(found: guard.Checked) -> tuple[str, str]:
    """Unit and long name, "" where there is none."""
    unit, long_name = (
        _text(found.attributes, name) if name in found.attributes else "" for name in ("units", "long_name")
    )
    return unit, long_name


def _within(found: Column, known: Column) -> Column:
    return replace(found, low=known.low, high=known.high, nan=known.nan)


def _same_scale(wanted: Array, there: Array) -> bool:
    """Whether two scales are one: centres of bins may differ in their last bits from machine to machine."""
    if wanted.shape != there.shape or (wanted.dtype.kind == "f") != (there.dtype.kind == "f"):
        return False
    return (
        np.allclose(wanted, there, rtol=1e-9) if wanted.dtype.kind == "f" else np.array_equal(wanted, there)
    )


def _inputs(value: Any) -> tuple[dict[str, str], ...]:
    """The artefacts that this one was made of; ValueError where one lacks its role, name or hash."""
    if not isinstance(value, list):
        raise ValueError("its inputs are no list")
    inputs = tuple(texts(one) for one in value)
    if not all(one.keys() >= {"role", "name", "content_sha256"} for one in inputs):
        raise ValueError("an input lacks its role, name or content hash")
    return inputs


def _count(attributes: Mapping[str, Any], name: str) -> int:
    value = attributes.get(name)
    if not isinstance(value, np.integer) or value < 0:
        raise ValueError(f"its {name} is no whole number")
    return int(value)


def _text(attributes: Mapping[str, Any], name: str) -> str:
    if name not in attributes:
        raise ValueError(f"it has no {name}")
    value = attributes[name]
    if not isinstance(value, bytes):
        raise ValueError(f"{name} is no fixed-length text")
    return value.decode()
