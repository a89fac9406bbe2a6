"""Long tables of other programs: a row for each task, state and action, as CSV or Parquet, read in two passes.

The first pass finds tasks, coordinates and actions; the second fills blocks of tasks. The rows of a task stand together.
"""

from __future__ import annotations

import csv
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np

from qinit_cli.artefacts.formats import pyarrow
from qinit_cli.errors import NotAllowed, UsageError

ROWS = (".csv", ".tsv", ".parquet")
AT_ONCE = 8_192  # rows of a file; more, as lists of texts, cost twice as much in garbage collection
TASK, ACTION = "task", "action"

Columns = dict[str, Any]  # name: a list of n texts, or (n,) numbers


@dataclass
class Scan:
    """What a first pass over a file found."""

    tasks: int = 0
    coordinates: dict[str, set[float]] = field(default_factory=dict)  # of each state axis
    actions: dict[str, None] = field(default_factory=dict)  # in order of their first rows


@dataclass(frozen=True)
class RowFile:
    """A file of rows."""

    path: Path
    columns: Mapping[str, str]  # q, visits and td_var to the names of those that are there
    axes: tuple[str, ...]
    has_tasks: bool

    @classmethod
    def of(cls, path: Path, wanted: Mapping[str, str], axes: Sequence[str] | None) -> RowFile:
        """The file with the roles of its columns; UsageError where one is missing."""
        names = list(next(iter(chunks(path, 1))))
        columns = {role: name for role, name in wanted.items() if name in names}
        if lacking := [name for name in (wanted["q"], ACTION) if name not in names]:
            raise UsageError(
                f"{path} has no column {lacking[0]!r}; it has {', '.join(names)}"
                f"{'; give --key NAME' if lacking[0] != ACTION else ''}"
            )
        others = [name for name in names if name not in (TASK, ACTION, *columns.values())]
        if axes is not None and (missing := [name for name in axes if name not in others]):
            raise UsageError(
                f"{path} has no column {missing[0]!r}, which --axes names; it has {', '.join(names)}"
            )
        states = tuple(others if axes is None else axes)
        if not states:
            raise UsageError(f"{path} has no column of states beside {', '.join(names)}")
        return cls(path, columns, states, TASK in names)

    def scan(self) -> Scan:
        """Tasks, coordinates and actions; NotAllowed where the rows of a task do not stand together."""
        found = Scan(coordinates={name: set() for name in self.axes})
        for place, chunk in self._numbered():
            for name in self.axes:
                there = numbers(self.path, name, list(map(str, _distinct(chunk[name]))))
                if np.isnan(there).any():
                    raise NotAllowed(f"column {name} of {self.path} has a row without a state")
                found.coordinates[name].update(there.tolist())
            found.actions.update(dict.fromkeys(map(str, sorted(_distinct(chunk[ACTION])))))
            found.tasks = int(place[-1]) + 1
        return found

    def blocks(
        self, coordinates: Mapping[str, Sequence[float]], actions: Mapping[str, int], rows: int
    ) -> Iterator[dict[str, Any]]:
        """The tables of so many tasks at a time, (n, *states, A) by role; a pair without a row is NaN, its visits 0."""
        shape = (*(len(coordinates[name]) for name in self.axes), 1 + max(actions.values()))
        places = {name: np.array(coordinates[name], np.float64) for name in self.axes}
        first, held = 0, self._empty(0, shape)
        for place, chunk in self._numbered():
            last = int(place[-1]) + 1
            held = self._grown(held, last - first, shape)
            state = [self._places(chunk, name, places[name]) for name in self.axes]
            action = self._actions(chunk, actions)
            cell = np.ravel_multi_index((place - first, *state, action), (last - first, *shape))
            taken = np.zeros(held["q"].size, bool)
            taken[cell] = True
            if taken.sum() < len(cell) or not np.isnan(held["q"].reshape(-1)[cell]).all():
                raise NotAllowed(f"{self.path} has two rows for one task, state and action")
            for role, name in self.columns.items():
                held[role].reshape(-1)[cell] = numbers(self.path, name, chunk[name])
            while last - 1 - first >= rows:  # the last task may go on
                yield {role: values[:rows] for role, values in held.items()}
                held = {role: values[rows:] for role, values in held.items()}
                first += rows
        if len(held["q"]):
            yield held

    def _empty(self, count: int, shape: tuple[int, ...]) -> dict[str, Any]:
        return {role: np.full((count, *shape), 0.0 if role == "visits" else np.nan) for role in self.columns}

    def _grown(self, held: dict[str, Any], count: int, shape: tuple[int, ...]) -> dict[str, Any]:
        more = self._empty(count - len(held["q"]), shape)
        return {role: np.concatenate([values, more[role]]) for role, values in held.items()}

    def _numbered(self) -> Iterator[tuple[Any, Columns]]:
        """The rows in chunks, each with the place of its task, (n,)."""
        seen: set[str] = set()
        last, count = None, 0
        for chunk in chunks(self.path, AT_ONCE):
            if not self.has_tasks:
                yield np.zeros(len(chunk[ACTION]), np.int64), chunk
                continue
            tasks = np.asarray(chunk[TASK])
            new = np.concatenate([[str(tasks[0]) != last], tasks[1:] != tasks[:-1]])
            for name in map(str, tasks[new].tolist()):
                if name in seen:
                    raise NotAllowed(
                        f"the rows of task {name} do not stand together in {self.path}; sort the file by task"
                    )
                seen.add(name)
            yield count - 1 + np.cumsum(new), chunk
            last, count = str(tasks[-1]), count + int(new.sum())

    def _places(self, chunk: Columns, name: str, coordinates: Any) -> Any:
        values = numbers(self.path, name, chunk[name])
        places = np.searchsorted(coordinates, values).clip(max=len(coordinates) - 1)
        if (other := coordinates[places] != values).any():
            raise NotAllowed(
                f"column {name} of {self.path} has the value {values[other][0]:g}, which is no place of that axis"
            )
        return places

    def _actions(self, chunk: Columns, actions: Mapping[str, int]) -> Any:
        names = chunk[ACTION] if isinstance(chunk[ACTION], list) else map(str, chunk[ACTION].tolist())
        try:
            return np.fromiter((actions[name] for name in names), np.int64, len(chunk[ACTION]))
        except KeyError as error:
            there = ", ".join(dict.fromkeys(actions))
            raise NotAllowed(
                f"{self.path} has the action {error.args[0]}, which is none of {there}"
            ) from error


def _distinct(column: Any) -> set[Any]:
    return set(column) if isinstance(column, list) else set(np.unique(column).tolist())


def numbers(path: Path, name: str, column: Any) -> Any:
    """The column of that name as numbers, (n,), NaN where a value is missing; NotAllowed where it is no number."""
    try:
        return (
            np.fromiter((float(text or "nan") for text in column), np.float64, len(column))
            if isinstance(column, list)
            else column.astype(np.float64)
        )
    except (TypeError, ValueError) as error:
        raise NotAllowed(
            f"column {name} of {path} has a value that is no number ({error}); write numbers, or leave the cell empty"
        ) from error


def chunks(path: Path, rows: int) -> Iterator[Columns]:
    """The columns of a file by name, so many rows at a time; at least one chunk, or NotAllowed."""
    pieces = _parquet(path, rows) if path.suffix.lower() == ".parquet" else _text(path, rows)
    count = 0
    try:
        for piece in pieces:
            count += 1
            yield piece
    except (UnicodeDecodeError, csv.Error) as error:
        raise NotAllowed(f"{path} is no table in UTF-8: {error}") from error
    if not count:
        raise NotAllowed(f"{path} has no rows")


def _parquet(path: Path, rows: int) -> Iterator[Columns]:
    arrow, parquet = pyarrow()
    try:
        file = parquet.ParquetFile(path)
        for batch in file.iter_batches(rows):
            yield {
                name: _plain(column, arrow)
                for name, column in zip(batch.schema.names, batch.columns, strict=True)
            }
    except arrow.ArrowInvalid as error:
        raise NotAllowed(f"{path} is no Parquet file: {error}") from error


def _plain(column: Any, arrow: Any) -> Any:
    """Numbers as an array, NaN where one is absent; anything else as a list of texts."""
    if arrow.types.is_floating(column.type) or arrow.types.is_integer(column.type):
        return column.to_numpy(zero_copy_only=False)
    return list(map(str, column.to_pylist()))


def _text(path: Path, rows: int) -> Iterator[Columns]:
    with path.open(newline="", encoding="utf-8-sig") as file:
        reader = csv.reader(file, delimiter="\t" if path.suffix.lower() == ".tsv" else ",")
        names = [name.strip() for name in next(reader, [])]
        if twice := [name for name in names if names.count(name) > 1]:
            raise NotAllowed(f"{path} has two columns {twice[0]}")
        while piece := list(islice(reader, rows)):
            if odd := [row for row in piece if len(row) != len(names)]:
                raise NotAllowed(
                    f"{path} has a row of {len(odd[0])} values where its header has {len(names)}, near line {reader.line_num}"
                )
            yield dict(zip(names, map(list, zip(*piece, strict=True)), strict=True))
