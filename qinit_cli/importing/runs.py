"""Learning curves of other programs' agents, made runs: `qinit import --runs`."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from qinit_cli.artefacts.run import CURVES, imported_run_schema
from qinit_cli.artefacts.settings import (
    ALGORITHM,
    WITHOUT_STEPS,
    RunSettings,
    SourceSet,
    StoredFamily,
    StoredMethod,
)
from qinit_cli.environments.imported import ImportedTables
from qinit_cli.errors import NotAllowed, UsageError
from qinit_cli.importing.asked import ImportedFiles
from qinit_cli.importing.files import file_digest
from qinit_cli.importing.rows import AT_ONCE, ROWS, TASK, Columns, chunks, numbers
from qinit_cli.learning import Learning
from qinit_cli.pipeline.job import Made, Tally, made
from qinit_cli.pipeline.keeping import Keeping, target_path, working
from qinit_cli.pipeline.origin import provenance
from qinit_cli.rewards import ReturnBounds
from qinit_store.wording import as_name, counted

EPISODE, METHOD = "episode", "method"
UNNAMED = "agent"  # the method of a file without that column


@dataclass(frozen=True)
class Curves:
    """The curves of one method over T tasks and E episodes."""

    method: str
    columns: dict[str, Any]  # steps, reached and return, (T, E) each, those that are there


def import_runs(path: Path, asked: ImportedFiles, keeping: Keeping) -> Iterator[tuple[str, Made]]:
    """Each method in the file with its run; UsageError or NotAllowed where its rows are no curves."""
    if path.suffix.lower() not in ROWS:
        raise UsageError(f"{path} ends in {path.suffix or 'nothing'}; curves are read from {', '.join(ROWS)}")
    digest, curves = file_digest(path), curves_of(path, asked)
    if keeping.output is not None and len(curves) > 1:
        raise UsageError(
            f"{path} has {counted(len(curves), 'method')} ({', '.join(one.method for one in curves)}), a run each; "
            "leave out -o and they go into the store"
        )
    horizon = asked.horizon or max(
        [int(one.columns["steps"].max()) for one in curves if "steps" in one.columns], default=1
    )
    for one in curves:
        yield one.method, _made(one, _settings(one, asked, horizon, digest), path, digest, keeping)


def curves_of(path: Path, asked: ImportedFiles) -> list[Curves]:
    """The curves of each method, in order of their first rows."""
    rows = _whole(path)
    there = [name for name in CURVES if name in rows]
    if lacking := [name for name in (TASK, EPISODE) if name not in rows]:
        raise UsageError(f"{path} has no column {lacking[0]!r}; it has {', '.join(rows)}")
    if "return" not in there:
        if not {"steps", "reached"} <= set(there):
            raise UsageError(
                f"{path} has neither a column return nor steps and reached; it has {', '.join(rows)}"
            )
        if asked.returns is not None:
            raise UsageError(
                f"--returns is of a column return, and {path} has steps and goals, which earn 0 to 1; leave it out"
            )
        if asked.gamma is None:
            raise UsageError(
                f"{path} has steps and goals but no returns; give --gamma, which makes returns of them"
            )
    methods = rows.get(METHOD, np.full(len(rows[TASK]), UNNAMED)).astype(str)
    if "reached" in there:
        rows["reached"] = _truths(rows["reached"])
    values = {name: numbers(path, name, rows[name]) for name in there}
    places = {name: numbers(path, name, rows[name]) for name in (TASK, EPISODE)}
    found = []
    for method in dict.fromkeys(methods.tolist()):
        own = methods == method
        table = {name: column[own] for name, column in values.items()}
        found.append(Curves(method, _laid_out(path, method, {n: c[own] for n, c in places.items()}, table)))
    _check_returns(path, found, asked)
    shapes = {next(iter(one.columns.values())).shape[1] for one in found}
    if len(shapes) > 1:
        raise NotAllowed(
            f"methods of {path} have {' and '.join(map(str, sorted(shapes)))} episodes; each needs as many"
        )
    return found


def _check_returns(path: Path, found: list[Curves], asked: ImportedFiles) -> None:
    """NotAllowed where a return is outside the bounds that were given."""
    if asked.returns is None:
        return
    bounds = ReturnBounds.read(asked.returns)
    for one in found:
        earned = one.columns["return"]
        beyond = earned[(earned < bounds.low) | (earned > bounds.high)]
        if beyond.size:
            raise NotAllowed(
                f"{one.method} of {path} has the return {beyond[0]:g}, and returns are from {bounds.low:g} to {bounds.high:g}; "
                "give wider --returns"
            )


def _truths(column: Any) -> Any:
    """True and False, as pandas writes them, as 1 and 0; what is neither as it is."""
    truths = {"True": "1", "true": "1", "False": "0", "false": "0"}
    return np.array([truths.get(str(value), str(value)) for value in column.tolist()])


def _whole(path: Path) -> Columns:
    pieces = list(chunks(path, AT_ONCE))
    return {name: np.concatenate([np.asarray(piece[name]) for piece in pieces]) for name in pieces[0]}


def _laid_out(path: Path, method: str, places: Columns, values: Columns) -> dict[str, Any]:
    """The columns over tasks and episodes; NotAllowed where a row is missing or stands there twice."""
    at = {name: np.unique(column, return_inverse=True) for name, column in places.items()}
    shape = tuple(len(labels) for labels, _ in at.values())
    cell = np.ravel_multi_index(tuple(back for _, back in at.values()), shape)
    count = np.bincount(cell, minlength=int(np.prod(shape)))
    if (count != 1).any():
        task, episode = (
            labels[place]
            for (labels, _), place in zip(
                at.values(), np.unravel_index(int((count != 1).argmax()), shape), strict=True
            )
        )
        lacks = "no row" if count.min() == 0 else "two rows"
        raise NotAllowed(
            f"{path} has {lacks} for task {task:g}, episode {episode:g} of {method}; every task needs every episode once"
        )
    found = {}
    for name, column in values.items():
        laid = np.empty(shape)
        laid.reshape(-1)[cell] = column
        found[name] = _of_type(path, name, laid)
    return found


def _of_type(path: Path, name: str, values: Any) -> Any:
    if name == "return":
        fits, wanted, dtype = np.isfinite(values), "a finite number", "f8"
    elif name == "reached":
        fits, wanted, dtype = np.isin(values, (0, 1)), "0 or 1", "u1"
    else:
        fits, wanted, dtype = (
            (values >= 1) & (values == np.floor(values)) & (values < 2**31),
            "a number of steps",
            "i4",
        )
    if not fits.all():
        raise NotAllowed(f"{name} has the value {values[~fits][0]:g} in {path}; it must be {wanted}")
    return values.astype(dtype)


def _settings(one: Curves, asked: ImportedFiles, horizon: int, digest: str) -> RunSettings:
    tasks, episodes = next(iter(one.columns.values())).shape
    family = StoredFamily.of(ImportedTables(asked.title, returns=asked.returns))
    learning = Learning(**WITHOUT_STEPS | {"gamma": asked.discount, "episodes": episodes, "horizon": horizon})
    return RunSettings(
        ALGORITHM,
        StoredMethod(one.method, one.method, {}, None),
        family,
        learning,
        seed=0,
        tasks=tasks,
        content=digest,
        source_set=SourceSet.unknown(family, learning),
    )


def _made(one: Curves, settings: RunSettings, path: Path, digest: str, keeping: Keeping) -> Made:
    origin = provenance(keeping.command)
    method = as_name(one.method).strip("-.")
    target = target_path(keeping, f"{settings.family.label}-{method}-{settings.tasks}", settings)
    schema = imported_run_schema(settings.learning.episodes, one.columns)
    with working(target, schema, settings, keeping, origin) as artefact:
        complete = artefact.complete
        if not complete:
            ids = np.setdiff1d(np.arange(settings.tasks), artefact.saved)
            artefact.save({name: values[ids] for name, values in one.columns.items()}, ids)
            inputs = [{"role": "file", "name": path.name, "content_sha256": digest}]
            artefact.finish(artefact.saved, provenance=origin, inputs=inputs)
        tally = Tally(tasks=settings.tasks, skipped=settings.tasks if complete else 0)
    return made(target, artefact, tally, complete)
