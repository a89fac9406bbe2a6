"""Artefacts as long tables: one row per observation, in pieces of bounded size, each verified before it is handed on."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from qinit_cli.errors import NotAllowed

if TYPE_CHECKING:
    from qinit_store.reading import Artefact
    from qinit_store.schema import Array, Column, Schema

ROWS = 16_384  # of a long table in one piece

# The tables of each kind, the default first, and the dataset that each is led by: it holds every dataset over the same axes.
TABLES = {
    "sources": {"tables": "q", "tasks": "solved", "curves": "curve_steps"},
    "fit": {"state-actions": "mu", "states": "value_mean", "library": "library_q"},
    "run": {
        "episodes": "steps",
        "targets": "seconds",
        "start": "start",
        "potential": "potential",
        "evaluations": "eval_return",
        "final": "q",
    },
    "tuning": {"averages": "average"},
}
OUR_TASK_COLUMNS = {
    "solved",
    "steps",
    "seconds",
    "v_star",
    "v_eps",
    "added",
    "log_std",
    "moves",
    "frozen",
}  # the others are what the task was drawn as
DIGEST = "task_digest"


@dataclass(frozen=True)
class Field:
    """One column of a long table."""

    name: str
    dtype: str  # as numpy writes it; "str" for text
    unit: str
    long_name: str


def tables(artefact: Artefact) -> list[str]:
    """The names of the long tables that the artefact has."""
    there = {column.name for column in artefact.schema.columns}
    return [name for name, lead in TABLES[artefact.kind].items() if lead in there]


def fields(artefact: Artefact, table: str) -> list[Field]:
    """The columns of a long table: which artefact, its axes and what its tasks were drawn as, then the values."""
    dims, values = layout(artefact.schema, table)
    known = {
        column.name: Field(column.name, column.little_endian.str, column.unit, column.long_name)
        for column in artefact.schema.columns
    }
    axes = {
        name: Field(
            name, "str" if axis.values.dtype.kind == "S" else axis.values.dtype.str, axis.unit, axis.long_name
        )
        for name, axis in artefact.axes.items()
    }
    named = [Field(name, "str", "", f"the {name}") for name in _labels(artefact)]
    coordinates = [
        field
        for dim in dims
        for field in [axes[dim], *(known[column.name] for column in drawn(artefact.schema, dim))]
    ]
    return [
        *named,
        *coordinates,
        *(known[column.name] for column in values),
        *_derived_fields(artefact, table),
    ]


def rows(artefact: Artefact, table: str) -> Iterator[dict[str, Array]]:
    """The long table in pieces of at most ROWS rows: a one-dimensional array for each of its fields."""
    dims, values = layout(artefact.schema, table)
    names = [field.name for field in fields(artefact, table)]
    joined = [column for dim in dims for column in drawn(artefact.schema, dim)]
    scales = {dim: texts(artefact.axes[dim].values) for dim in dims}
    for first, block in _blocks(artefact, table, [*values, *joined]):
        lengths = [len(block["task"]) if dim == "task" else len(scales[dim]) for dim in dims]
        total = int(np.prod(lengths, dtype=np.int64))
        for start in range(0, total, ROWS):
            at = np.unravel_index(np.arange(start, min(start + ROWS, total)), lengths)
            place = dict(zip(dims, at, strict=True))
            piece = {dim: scales[dim][place[dim] + (first if dim == "task" else 0)] for dim in dims}
            piece |= {
                column.name: block[column.name][tuple(place[dim] for dim in column.dims)]
                for column in [*values, *joined]
            }
            for name, whole in _derived(artefact, table, block).items():
                piece[name] = whole[at]
            piece |= {name: np.full(at[0].size, text) for name, text in _labels(artefact).items()}
            yield {name: piece[name] for name in names}


def layout(schema: Schema, table: str) -> tuple[tuple[str, ...], list[Column]]:
    """The axes of a long table and the datasets over exactly these, what tasks were drawn as apart."""
    lead = TABLES[schema.kind].get(table)
    found = [column for column in schema.columns if column.name == lead]
    if not found:
        there = {column.name for column in schema.columns}
        names = ", ".join(name for name, dataset in TABLES[schema.kind].items() if dataset in there)
        raise NotAllowed(f"there is no table {table} in these {_plural(schema.kind)}; there is {names}")
    dims = found[0].dims
    joined = [column for dim in dims for column in drawn(schema, dim)]
    return dims, [column for column in schema.columns if column.dims == dims and column not in joined]


def _plural(kind: str) -> str:
    return kind if kind.endswith("s") else f"{kind}s"


def drawn(schema: Schema, dim: str) -> list[Column]:
    """What belongs to each entry of an axis: the parameters of a task or candidate, the source of a library table."""
    if dim not in ("task", "library", "candidate"):
        return []
    return [
        column for column in schema.columns if column.dims == (dim,) and column.name not in OUR_TASK_COLUMNS
    ]


def _labels(artefact: Artefact) -> dict[str, str]:
    """What tells the rows of several artefacts apart."""
    name = {"artefact": artefact.path.stem}
    return name | {"method": artefact.spec["method"]["name"]} if artefact.kind == "run" else name


def texts(values: Array) -> Array:
    """The same, where it is text as text."""
    return values.astype(str) if values.dtype.kind == "S" else values


def _blocks(
    artefact: Artefact, table: str, columns: Iterable[Column]
) -> Iterator[tuple[int, dict[str, Array]]]:
    """Whole datasets where none has a task axis, else blocks of tasks, each with the number of its first row."""
    statics = {column.name: artefact.read(column.name) for column in columns if not column.per_task}
    names = [column.name for column in columns if column.per_task]
    if not names:
        yield 0, statics
        return
    names += [name for name in _needed(artefact, table) if name not in names]
    first = 0
    for block in artefact.blocks(names, artefact.schema.block_size):
        yield first, block | statics
        first += len(block["task"])


def _needed(artefact: Artefact, table: str) -> tuple[str, ...]:
    """The datasets that derived columns and digests are made of."""
    if artefact.kind == "run" and table in ("episodes", "targets"):
        return ("steps", "reached", DIGEST)
    return (DIGEST,)


def _derived_fields(artefact: Artefact, table: str) -> list[Field]:
    """Columns that are no datasets: what episodes earn, and the digest of a task as text."""
    earned = Field("return", "<f8", "1", "discounted return of the episode")
    totals = [
        Field("average_return", "<f8", "1", "mean discounted return over all episodes"),
        Field("first_10", "<f8", "1", "the same over the first 10 episodes"),
        Field("last_tenth", "<f8", "1", "the same over the last tenth of the episodes"),
        Field("success", "<f8", "1", "share of episodes that reach the goal"),
        Field("restricted_steps", "<f8", "step", "mean of the episodes' steps, at most the horizon"),
    ]
    digest = Field(DIGEST, "str", "", "SHA-256 of the task's hashed columns")
    match artefact.kind, table:
        case "run", "episodes":
            return [earned]
        case "run", "targets":
            return [*totals, digest]
        case "sources", "tasks":
            return [digest]
        case _:
            return []


def _derived(artefact: Artefact, table: str, block: dict[str, Array]) -> dict[str, Array]:
    """The derived columns of a block of tasks, over the axes of the table."""
    from qinit_cli.analysis import returns

    wanted = [field.name for field in _derived_fields(artefact, table)]
    derived: dict[str, Array] = {}
    if DIGEST in wanted:
        derived[DIGEST] = np.array([row.tobytes().hex() for row in block[DIGEST]])
    if artefact.kind == "run" and wanted:
        learning = artefact.spec["learning"]
        reached = block["reached"].astype(bool)
        earned = returns.discounted_returns(block["steps"], reached, float(learning["gamma"]))
        derived["return"] = earned
        derived["average_return"] = returns.average(earned)
        derived["first_10"] = returns.jumpstart(earned)
        derived["last_tenth"] = returns.asymptotic(earned)
        derived["success"] = reached.mean(axis=1)
        derived["restricted_steps"] = returns.restricted_steps(block["steps"], int(learning["horizon"])).mean(
            axis=1
        )
    return {name: derived[name] for name in wanted}
