"""Tables of action values that other programs learned, made sources: `qinit import`."""

from __future__ import annotations

import hashlib
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from qinit_cli.artefacts.opening import action_axis
from qinit_cli.artefacts.settings import ALGORITHM, WITHOUT_STEPS, SourcesSettings, StoredFamily
from qinit_cli.artefacts.sources import OF_IMPORTED, imported_schema
from qinit_cli.environments.imported import ImportedTables, axis_text
from qinit_cli.environments.own_tasks import axis_lengths
from qinit_cli.environments.taken_names import OF_STATES
from qinit_cli.errors import NotAllowed, UsageError
from qinit_cli.importing.arrays import (
    ARRAYS,
    HDF5,
    HELD_BYTES,
    StoredArray,
    check_numbers,
    refuse_pickle,
    stored_arrays,
)
from qinit_cli.importing.asked import ImportedFiles
from qinit_cli.importing.files import file_digest
from qinit_cli.importing.rows import ROWS, RowFile
from qinit_cli.learning import IMPORTED, Learning
from qinit_cli.pipeline.job import Made, Tally, made
from qinit_cli.pipeline.keeping import Keeping, target_path, working
from qinit_cli.pipeline.origin import provenance
from qinit_cli.pipeline.reporter import SILENT, Reporter
from qinit_cli.rewards import ReturnBounds
from qinit_cli.watch import Watch
from qinit_store.guard import MOST_TASKS
from qinit_store.wording import counted

if TYPE_CHECKING:
    from qinit_store.schema import Schema

USUAL_AXES = {1: ("state",), 2: ("row", "col")}  # names of state axes, by their number
Given = str | Path | Any  # a file, or an array in memory


@dataclass(frozen=True)
class ArrayTables:
    """Tables in arrays, with or without a task axis."""

    name: str
    digest: str
    arrays: Mapping[str, StoredArray]
    alone: bool  # one task: the arrays have no task axis

    @property
    def tasks(self) -> int:
        """How many."""
        return 1 if self.alone else self.arrays["q"].shape[0]

    @property
    def roles(self) -> tuple[str, ...]:
        """Of q, visits and td_var, those that are there."""
        return tuple(self.arrays)

    def blocks(self, rows: int) -> Iterator[dict[str, Any]]:
        """So many tasks at a time, (n, *states, A) by role."""
        if self.alone:
            wholes = {role: array.blocks(array.shape[0]) for role, array in self.arrays.items()}
            yield {role: next(whole)[None] for role, whole in wholes.items()}
            return
        pieces = [array.blocks(rows) for array in self.arrays.values()]
        yield from (dict(zip(self.arrays, together, strict=True)) for together in zip(*pieces, strict=True))


@dataclass(frozen=True)
class RowTables:
    """Tables in the rows of a file."""

    name: str
    digest: str
    file: RowFile
    tasks: int
    coordinates: Mapping[str, Sequence[float]]
    actions: Mapping[str, int]

    @property
    def roles(self) -> tuple[str, ...]:
        """Of q, visits and td_var, those that are there."""
        return tuple(self.file.columns)

    def blocks(self, rows: int) -> Iterator[dict[str, Any]]:
        """So many tasks at a time, (n, *states, A) by role."""
        return self.file.blocks(self.coordinates, self.actions, rows)


Tables = ArrayTables | RowTables


@dataclass(frozen=True)
class Import:
    """Sources that are to be made of tables."""

    tables: Sequence[Tables]
    family: ImportedTables
    settings: SourcesSettings

    @property
    def schema(self) -> Schema:
        """The layout of the artefact."""
        axes, action = self.family.axes(), action_axis(self.family)
        return imported_schema(axes, action, self.settings.bounds, self.tables[0].roles)

    def target(self, keeping: Keeping) -> Path:
        """Where the artefact goes."""
        return target_path(keeping, f"{self.family.label}-{self.settings.tasks}", self.settings)

    def rows(self) -> Iterator[tuple[int, dict[str, Any], int]]:
        """Blocks of tasks: the first one's id, the columns of an artefact, and how many pairs are unknown."""
        entries = math.prod(self.family.shape) * len(self.family.actions)
        first = 0
        for tables in self.tables:
            for block in tables.blocks(max(1, HELD_BYTES // (8 * entries))):
                yield first, *_checked(block, tables.name, first, self.settings.bounds)
                first += len(block["q"])


def make_import(
    given: Sequence[Given], asked: ImportedFiles, keeping: Keeping, reporter: Reporter = SILENT
) -> Made:
    """The sources made of files, or of arrays in memory; memory is that of a block of tasks.

    UsageError where the files do not have what was asked for; NotAllowed for tables that cannot be.
    """
    wanted = import_of(given, asked)
    settings, target = wanted.settings, wanted.target(keeping)
    origin = provenance(keeping.command)
    tally, unknown = Tally(tasks=settings.tasks), 0
    with working(target, wanted.schema, settings, keeping, origin) as artefact:
        complete = artefact.complete
        if complete:
            tally.skipped = settings.tasks
        else:
            saved = set(artefact.saved.tolist())
            with reporter.progress("import", 0, settings.tasks, Watch()) as progress:
                for first, rows, lacking in wanted.rows():
                    ids = np.arange(first, first + len(rows["q"]))
                    new = np.array([number not in saved for number in ids.tolist()])
                    if new.any():
                        artefact.save({name: values[new] for name, values in rows.items()}, ids[new])
                    unknown += lacking
                    progress.advance(len(ids))
            inputs = [
                {"role": "file", "name": tables.name, "content_sha256": tables.digest}
                for tables in wanted.tables
            ]
            artefact.finish(artefact.saved, provenance=origin, inputs=inputs)
            tally.extra["unknown"] = unknown
    return made(target, artefact, tally, complete)


def import_of(given: Sequence[Given], asked: ImportedFiles) -> Import:
    """What these files or arrays are, their layout found and their digests taken."""
    arrays = [_arrays(one, asked) for one in given if not _is_rows(one)]
    tables: list[Tables]
    if arrays and len(arrays) < len(given):
        raise UsageError("arrays and rows are given together; import them one after the other")
    if arrays:
        states, moves, tables = _of_arrays(arrays, asked)
    else:
        states, moves, tables = _of_rows([Path(one) for one in given], asked)
    for role in OF_IMPORTED:
        if 0 < sum(role in one.roles for one in tables) < len(tables):
            raise UsageError(f"some of the files have {role} and others have not; import them apart")
    count = sum(one.tasks for one in tables)
    if count > MOST_TASKS:
        raise UsageError(f"there are {count} tasks; an artefact holds {MOST_TASKS} at most")
    family = _family(asked, states, moves)
    learning = Learning(**{**WITHOUT_STEPS, "gamma": asked.discount})
    settings = SourcesSettings(
        ALGORITHM,
        StoredFamily.of(family),
        IMPORTED,
        learning,
        seed=0,
        tasks=count,
        files=tuple(one.digest for one in tables),
        min_visits=asked.min_visits if "visits" in tables[0].roles else None,
    )
    return Import(tables, family, settings)


def _family(asked: ImportedFiles, states: Sequence[str], moves: Sequence[str]) -> ImportedTables:
    try:
        family = ImportedTables(asked.title, list(states), list(moves), asked.returns)
    except ValueError as error:
        raise UsageError(str(error)) from error
    if taken := [axis.name for axis in family.axes() if axis.name in OF_STATES]:
        raise UsageError(
            f"the state axis {taken[0]} has the name of an array that artefacts have; name it otherwise"
        )
    return family


def _is_rows(given: Given) -> bool:
    return isinstance(given, str | Path) and Path(given).suffix.lower() in ROWS


def _arrays(given: Given, asked: ImportedFiles) -> tuple[str, str, dict[str, StoredArray]]:
    """Name, digest and arrays by role of a file, or of what is in memory: an array, or arrays by role."""
    if not isinstance(given, str | Path):
        held = {role: _held(role, values) for role, values in _by_role(given).items()}
        check_numbers(held)
        return "memory", _digest_of(held), held
    path, inner = _split(str(given))
    refuse_pickle(path)
    if path.suffix.lower() not in ARRAYS:
        raise UsageError(
            f"{path} ends in {path.suffix or 'nothing'}; files end in {', '.join((*ARRAYS, *ROWS))}"
        )
    digest = file_digest(path)
    found = stored_arrays(path, inner, asked.roles)
    check_numbers(found)
    return str(given), digest, found


def _by_role(given: Any) -> dict[str, Any]:
    found = dict(given) if isinstance(given, Mapping) else {"q": given}
    if "q" not in found or (unknown := set(found) - set(OF_IMPORTED)):
        raise UsageError(
            f"arrays are given by the names q, visits and td_var; {', '.join(map(str, found)) or 'none'} are there"
            if "q" not in found
            else f"there is no {min(unknown)} in sources; arrays are given as q, visits and td_var"
        )
    return found


def _held(role: str, values: Any) -> StoredArray:
    array = np.asarray(values)
    return StoredArray(
        role,
        array.shape,
        array.dtype,
        lambda rows: (array[first : first + rows] for first in range(0, len(array), rows)),
    )


def _split(text: str) -> tuple[Path, str]:
    """The file and the path within it, in FILE.h5:/PATH."""
    path, colon, inner = text.rpartition(":")
    if colon and not Path(text).exists() and Path(path).suffix.lower() in HDF5:
        return Path(path), inner
    return Path(text), ""


def _digest_of(arrays: Mapping[str, StoredArray]) -> str:
    digest = hashlib.sha256()
    for role, array in arrays.items():
        digest.update(f"{role} {array.shape} {array.dtype.str}".encode())
        for block in array.blocks(max(1, array.shape[0])):
            digest.update(np.ascontiguousarray(block).tobytes())
    return digest.hexdigest()


def _of_arrays(
    found: Sequence[tuple[str, str, dict[str, StoredArray]]], asked: ImportedFiles
) -> tuple[list[str], list[str], list[Tables]]:
    """State axes, actions and tables, all files being of one layout."""
    layout: tuple[int, ...] | None = None
    names = None
    if asked.axes is not None:
        names, layout = _axes_asked(asked.axes)
    tables: list[Tables] = []
    actions = None
    for name, digest, arrays in found:
        shape = arrays["q"].shape
        if layout is None:  # a task axis first, but for a table that has no room for one
            layout = shape[:-1] if len(shape) == 2 else shape[1:-1]
        alone = shape[:-1] == layout
        if not (alone or shape[1:-1] == layout) or (actions is not None and shape[-1] != actions):
            there = (*layout, actions or "A")
            raise UsageError(
                f"{arrays['q'].place} has the shape {shape}; (N, {', '.join(map(str, there))}) is expected, or without N "
                f"one task{'' if asked.axes else '; give --axes NAME=LENGTH,...'}"
            )
        actions = shape[-1]
        for role, array in arrays.items():
            if array.shape != shape:
                raise UsageError(f"{array.place} ({role}) has the shape {array.shape}, and q has {shape}")
        tables.append(ArrayTables(name, digest, arrays, alone))
    sizes = layout or ()
    usual = USUAL_AXES.get(len(sizes), tuple(f"x{place}" for place in range(len(sizes))))
    states = [f"{name}={size}" for name, size in zip(names or usual, sizes, strict=True)]
    return states, _moves(asked, actions or 0), tables


def _moves(asked: ImportedFiles, count: int) -> list[str]:
    names = asked.action_names
    if names is None:
        return list(map(str, range(count)))
    if len(names) != count:
        raise UsageError(f"--actions names {counted(len(names), 'action')}, and the tables have {count}")
    return names


def _axes_asked(text: str) -> tuple[list[str], tuple[int, ...]]:
    try:
        lengths = axis_lengths(text)
    except ValueError as error:
        raise UsageError(str(error)) from error
    return list(lengths), tuple(lengths.values())


def _of_rows(paths: Sequence[Path], asked: ImportedFiles) -> tuple[list[str], list[str], list[Tables]]:
    """State axes, actions and tables, all files being of one layout: the coordinates and actions that any of them has."""
    digests = [file_digest(path) for path in paths]
    named = None if asked.axes is None else _axes_asked(asked.axes)
    files = [RowFile.of(path, asked.roles, None if named is None else named[0]) for path in paths]
    if other := [file for file in files if file.axes != files[0].axes]:
        raise UsageError(
            f"{other[0].path} has the states {', '.join(other[0].axes)} and {files[0].path} {', '.join(files[0].axes)}; "
            "give --axes NAME=LENGTH,..."
        )
    scans = [file.scan() for file in files]
    if named is None:
        coordinates = {
            name: sorted(set().union(*(scan.coordinates[name] for scan in scans))) for name in files[0].axes
        }
    else:
        coordinates = {name: list(map(float, range(size))) for name, size in zip(*named, strict=True)}
    there = list(dict.fromkeys(name for scan in scans for name in scan.actions))
    moves, actions = _actions_of(asked.action_names, there)
    tables: list[Tables] = [
        RowTables(str(file.path), digest, file, scan.tasks, coordinates, actions)
        for file, digest, scan in zip(files, digests, scans, strict=True)
    ]
    states = [axis_text(name, values) for name, values in coordinates.items()]
    return states, moves, tables


def _actions_of(given: list[str] | None, there: list[str]) -> tuple[list[str], dict[str, int]]:
    """The actions' names, and the place of each by what a file calls it: its name, or its number counted from 0."""
    numbered = all(name.isdecimal() for name in there)
    names = given or (list(map(str, range(max(map(int, there)) + 1))) if numbered else there)
    places = {name: place for place, name in enumerate(names)}
    return names, places | ({str(place): place for place in range(len(names))} if numbered else {})


def _checked(
    block: dict[str, Any], name: str, first: int, bounds: ReturnBounds
) -> tuple[dict[str, Any], int]:
    """The columns of an artefact: NaN becomes the least return, which is unknown to a fit, and is counted."""
    rows = {role: np.asarray(values, np.float64) for role, values in block.items()}
    q = rows["q"]
    lacking = np.isnan(q)
    if unknown := int(lacking.sum()):
        q = rows["q"] = np.where(lacking, bounds.low, q)
    beyond = ~((q >= bounds.low) & (q <= bounds.high))
    if beyond.any():
        place = np.argwhere(beyond)[0]
        raise NotAllowed(
            f"task {first + place[0]} of {name} has the value {q[tuple(place)]:g}, and returns are from {bounds.low:g} to "
            f"{bounds.high:g}; give --returns LOW:HIGH"
        )
    if "visits" in rows:
        visits = np.where(lacking & np.isnan(rows["visits"]), 0, rows["visits"])
        whole = np.isfinite(visits) & (visits >= 0) & (visits == np.floor(visits)) & (visits < 2**63)
        if not whole.all():
            raise NotAllowed(
                f"visits of {name} has the value {visits[~whole][0]:g}, which is no number of updates"
            )
        rows["visits"] = visits.astype(np.int64)
    if "td_var" in rows:
        # as of pairs that learning here never visits
        variance = rows["td_var"] = np.where(lacking, 0.0, rows["td_var"])
        if not (variance >= 0).all():
            raise NotAllowed(
                f"td_var of {name} has the value {variance[~(variance >= 0)][0]:g}; variances are at least 0"
            )
    return rows, unknown
