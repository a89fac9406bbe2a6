"""What each kind of artefact holds: axes, columns, their dtypes and dimensions."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[Any]

TASK = "task"
TASK_DIGEST = "task_digest"
CANDIDATE = "candidate"
DIGEST_BYTES = 32
# of a column that may have any value: an unknown one, or one without bounds
ANYTHING: Mapping[str, Any] = {"low": -math.inf, "high": math.inf, "nan": True}
BLOCK_BYTES = 8 * 1024 * 1024
LONGEST = 1e10  # seconds of a task: three hundred years
ROUNDING = 1e-6  # by which sums of chances and repeated steps may leave [0, 1]
NO_MOMENTS: Array = np.empty(0, np.int64)
NAME = re.compile(r"[a-z][a-z0-9_]{0,63}")


@dataclass(frozen=True, eq=False)
class Axis:
    """A named dimension and its scale."""

    name: str
    values: Array  # (length,) integers, floats or fixed-length bytes
    unit: str = ""
    long_name: str = ""

    def __post_init__(self) -> None:
        _check_name(self.name)
        if self.values.ndim != 1 or self.values.dtype.kind not in "iufS":
            raise ValueError(f"axis {self.name}: the scale must be one row of numbers or fixed-length bytes")


@dataclass(frozen=True)
class Column:
    """A dataset: its dimensions by name, its dtype, whether the digests cover it, and which values it may have."""

    name: str
    dims: tuple[str, ...]
    dtype: str
    unit: str = "1"
    long_name: str = ""
    hashed: bool = True
    low: float | None = None  # the least value; None: any finite one
    high: float | None = None  # the largest; infinity where that may stand there
    nan: bool = False  # whether NaN may stand for an unknown value

    def __post_init__(self) -> None:
        _check_name(self.name)
        if TASK in self.dims[1:] or len(set(self.dims)) != len(self.dims) or not self.dims:
            raise ValueError(
                f"column {self.name}: {self.dims} must be distinct axes, {TASK} the first if at all"
            )

    @property
    def per_task(self) -> bool:
        return self.dims[0] == TASK

    @property
    def given(self) -> bool:
        """Whether the caller supplies it; the digests are ours to make."""
        return self.name != TASK_DIGEST

    @property
    def little_endian(self) -> np.dtype[Any]:
        return np.dtype(self.dtype).newbyteorder("<")

    @property
    def range(self) -> str:
        """The values it may have, in words."""
        low, high = (None if one is None or math.isinf(one) else f"{one:g}" for one in (self.low, self.high))
        if low is not None and high is not None:
            return f"from {low} to {high}" if low != high else low
        bound = f"at least {low}" if low is not None else f"at most {high}" if high is not None else ""
        return bound or "a finite number"

    def fits(self, values: Array) -> Array:
        """Which of the values it may have, in the shape of `values`."""
        if values.dtype.kind not in "iuf":
            return np.ones(values.shape, bool)
        least, most = self._bounds
        exact = values.astype(np.float64) if values.dtype.kind == "f" else values
        fitting: Array = (exact >= least) & (exact <= most)
        return fitting | np.isnan(values) if self.nan else fitting

    def fit_all(self, values: Array) -> bool:
        """Whether it may have all of the values; in the usual case without an array of their size."""
        if values.dtype.kind not in "iuf" or not values.size or self.anything:
            return True
        least, most = self._bounds
        if least <= values.min().item() and values.max().item() <= most:
            return True
        return self.nan and bool(self.fits(values).all())

    @property
    def anything(self) -> bool:
        """Whether it may have any value."""
        return self.nan and (self.low, self.high) == (-math.inf, math.inf)

    @property
    def _bounds(self) -> tuple[float, float]:
        largest = float(np.finfo(np.float64).max)
        return -largest if self.low is None else self.low, largest if self.high is None else self.high


@dataclass(frozen=True, eq=False)
class Schema:
    """The axes, all but `task`, and the columns of one kind of artefact."""

    kind: str
    axes: tuple[Axis, ...]
    columns: tuple[Column, ...]

    def __post_init__(self) -> None:
        names = [TASK, *(axis.name for axis in self.axes), *(column.name for column in self.columns)]
        if len(set(names)) != len(names):
            raise ValueError(f"{self.kind}: a name stands for two things among {sorted(names)}")
        for column in self.columns:
            unknown = set(column.dims) - {TASK, *self.sizes}
            if unknown:
                raise ValueError(f"column {column.name}: no axis {', '.join(sorted(unknown))}")

    @property
    def sizes(self) -> dict[str, int]:
        """The length of every axis but `task`."""
        return {axis.name: axis.values.size for axis in self.axes}

    @property
    def task_columns(self) -> tuple[Column, ...]:
        return tuple(column for column in self.columns if column.per_task)

    @property
    def static_columns(self) -> tuple[Column, ...]:
        return tuple(column for column in self.columns if not column.per_task)

    def row_shape(self, column: Column) -> tuple[int, ...]:
        """The shape of `column` without its task axis."""
        return tuple(self.sizes[name] for name in column.dims if name != TASK)

    def misfits(self, rows: Mapping[str, Array]) -> Array:
        """Which tasks hold a value that its column cannot have, (tasks,); `rows` have a leading task axis."""
        count = len(next(iter(rows.values()))) if rows else 0
        wrong = np.zeros(count, bool)
        for column in self.task_columns:
            if column.name in rows and not column.fit_all(rows[column.name]):
                wrong |= ~column.fits(rows[column.name]).reshape(count, -1).all(axis=1)
        return wrong

    def fault(self, values: Mapping[str, Array]) -> str:
        """The first value that its column cannot have, in words; "" where all fit. A column may be absent."""
        for column in self.columns:
            if column.name in values and not column.fit_all(values[column.name]):
                wrong = values[column.name][~column.fits(values[column.name])]
                return f"{column.name} is {wrong[0]}; it must be {column.range}"
        return ""

    @property
    def task_bytes(self) -> int:
        """The bytes of one task over all its columns, at least 1."""
        sizes = (
            int(np.prod(self.row_shape(column), dtype=np.int64)) * column.little_endian.itemsize
            for column in self.task_columns
        )
        return max(1, sum(sizes))

    @property
    def block_size(self) -> int:
        """The number of tasks read or written at a time: about 8 MiB of them."""
        return max(1, BLOCK_BYTES // self.task_bytes)


def sources_schema(
    state_axes: tuple[Axis, ...], action: Axis, parameters: tuple[Column, ...], bins: int
) -> Schema:
    """What source tasks leave behind; `bins` 0 for the exact learner, which has no learning curve."""
    state_action = (*(axis.name for axis in state_axes), action.name)
    tables = (
        Column("q", (TASK, *state_action), "f8", long_name="action values", low=0, high=1 + ROUNDING),
        Column(
            "td_var",
            (TASK, *state_action),
            "f8",
            long_name="mean squared TD error of the task's own table",
            low=0,
            high=1 + ROUNDING,
        ),
        Column(
            "eopl",
            (TASK, *state_action),
            "i4",
            "step",
            "expected optimal path length, -1: never arrives",
            low=-1,
        ),
        Column("visits", (TASK, *state_action), "i8", long_name="updates of the pair", low=0),
    )
    curve = (
        Column("curve_steps", (TASK, "bin"), "f4", "step", "mean steps over equal bins of episodes", low=0),
        Column(
            "curve_reached",
            (TASK, "bin"),
            "f4",
            long_name="share of episodes that reach the goal",
            low=0,
            high=1 + ROUNDING,
        ),
    )
    totals = (
        Column(
            "solved", (TASK,), "u1", long_name="greedy policy reaches the goal from the target start", high=1
        ),
        Column("steps", (TASK,), "i8", "step", "environment steps simulated", low=0),
        *_keeping(),
    )
    axes = (*state_axes, action, *([_index("bin", bins)] if bins else []), _digest_axis())
    return Schema("sources", axes, (*tables, *(curve if bins else ()), *parameters, *totals))


def fit_schema(
    state_axes: tuple[Axis, ...],
    action: Axis,
    library: int,
    more_axes: tuple[Axis, ...] = (),
    more: tuple[Column, ...] = (),
) -> Schema:
    """What a fit holds of its sources, with the tables of the first `library` of them, and what was asked on top."""
    state = tuple(axis.name for axis in state_axes)
    state_action = (*state, action.name)
    moments = (
        Column("mu", state_action, "f8", long_name="mean of ln Q", nan=True),
        Column("sigma", state_action, "f8", long_name="standard deviation of ln Q", low=0, nan=True),
        Column(
            "lognormal_median",
            state_action,
            "f8",
            long_name="median of the fitted log-normal",
            low=-math.inf,  # the unbiased estimator may be below 0
            high=math.inf,
            nan=True,
        ),
        Column(
            "lognormal_mean",
            state_action,
            "f8",
            long_name="mean of the fitted log-normal",
            low=-math.inf,
            high=math.inf,
            nan=True,
        ),
        Column("mean", state_action, "f8", long_name="mean of Q", low=0, high=1 + ROUNDING, nan=True),
        Column(
            "std", state_action, "f8", long_name="standard deviation of Q", low=0, high=1 + ROUNDING, nan=True
        ),
        Column("min", state_action, "f8", long_name="least Q", low=0, high=1 + ROUNDING, nan=True),
        Column("max", state_action, "f8", long_name="largest Q", low=0, high=1 + ROUNDING, nan=True),
        Column(
            "eopl_mean",
            state_action,
            "f8",
            "step",
            "mean of the expected optimal path lengths",
            low=0,
            nan=True,
        ),
        Column("eopl_std", state_action, "f8", "step", "their standard deviation", low=0, nan=True),
    )
    counts = (
        Column("n", state_action, "i4", long_name="sources with Q > 0", low=0),
        Column("n_masked", state_action, "i4", long_name="sources left out: Q not positive", low=0),
        Column("eopl_n", state_action, "i4", long_name="sources whose path arrives", low=0),
        Column("flags", state_action, "u1", long_name="how the pair was treated"),
    )
    tables = (
        Column(
            "value_mean",
            state,
            "f8",
            long_name="mean over sources of the largest action value",
            low=0,
            high=1 + ROUNDING,
        ),
        Column(
            "library_q",
            ("library", *state_action),
            "f8",
            long_name="action values of a source",
            low=0,
            high=1 + ROUNDING,
        ),
        Column(
            "library_td_var",
            ("library", *state_action),
            "f8",
            long_name="its mean squared TD error",
            low=0,
            high=1 + ROUNDING,
        ),
        Column("library_task", ("library",), "i8", long_name="task id of the source", low=0),
    )
    axes = (*state_axes, action, _index("library", library), *more_axes)
    return Schema("fit", axes, (*moments, *counts, *tables, *more))


def run_schema(
    state_axes: tuple[Axis, ...],
    action: Axis,
    parameters: tuple[Column, ...],
    episodes: int,
    *,
    start_per_task: bool,
    potential_per_task: bool,
    exact_values: bool,
    evaluations: int,
    keep_q: bool,
    updating: bool = False,
    hypotheses: int = 0,
    moments: Array = NO_MOMENTS,
) -> Schema:
    """What target tasks leave behind; start and potential have a task axis where they depend on it.

    `updating`: each task adds to what those after it start from. Where `hypotheses` tables were weighed, their weights after so
    many episodes as `moments` says stand there too.
    """
    state = tuple(axis.name for axis in state_axes)
    state_action = (*state, action.name)
    columns = [
        Column("steps", (TASK, "episode"), "i4", "step", "steps of the episode", low=1),
        Column("reached", (TASK, "episode"), "u1", long_name="the episode reached the goal", high=1),
        Column(
            "start",
            _led(start_per_task, state_action),
            "f8",
            long_name="initial action values",
            low=0,
            high=1,
        ),
        Column("potential", _led(potential_per_task, state), "f8", long_name="shaping potential"),
        *parameters,
        *_keeping(),
    ]
    if exact_values:
        columns += [
            Column("v_star", (TASK,), "f8", long_name="optimal value of the start", low=0, high=1 + ROUNDING),
            Column(
                "v_eps",
                (TASK,),
                "f8",
                long_name="value of the start under epsilon-greedy on the optimum",
                low=0,
                high=1 + ROUNDING,
            ),
        ]
    if evaluations:
        columns += [
            Column(
                "eval_return",
                (TASK, "evaluation"),
                "f8",
                long_name="discounted return of the greedy policy",
                low=0,
                high=1,
            ),
            Column(
                "eval_reached",
                (TASK, "evaluation"),
                "f8",
                long_name="share of evaluations that arrive",
                low=0,
                high=1,
            ),
            Column("eval_steps", (TASK, "evaluation"), "i4", "step", "steps of the greedy policy", low=1),
        ]
    if keep_q:
        columns.append(Column("q", (TASK, *state_action), "f8", long_name="final action values"))
    if updating:
        columns += [
            Column("visits", (TASK, *state_action), "i8", long_name="updates of the pair", low=0),
            Column("added", (TASK,), "i8", long_name="pairs whose value was added to what is known", low=0),
            Column(
                "log_std",
                (TASK,),
                "f8",
                long_name="median over pairs of the standard deviation of ln Q after the task",
                low=0,
                nan=True,
            ),
        ]
    indices = [_index("episode", episodes), *([_index("evaluation", evaluations)] if evaluations else [])]
    if hypotheses:
        columns += _weighing()
        after = Axis("moment", moments, "1", "episodes that had ended")
        indices += [after, _index("hypothesis", hypotheses)]
    return Schema("run", (*state_axes, action, *indices, _digest_axis()), tuple(columns))


def tuning_schema(parameters: tuple[str, ...], candidates: int) -> Schema:
    """What choosing a method's parameters leaves behind: how each source fared as a target under each candidate."""
    columns = (
        Column(
            "average",
            (TASK, CANDIDATE),
            "f8",
            long_name="mean return over the episodes; NaN where it was not tried",
            low=0,
            high=1,
            nan=True,
        ),
        Column("steps", (TASK,), "i8", "step", "environment steps simulated", low=0),
        *_keeping(),
        *(Column(name, (CANDIDATE,), "f8", long_name="parameter of the candidate") for name in parameters),
    )
    return Schema("tuning", (_index(CANDIDATE, candidates), _digest_axis()), columns)


def missing(schema: Schema, *, part: bool) -> str:
    """The first column its kind must have that `schema` lacks or has otherwise; "" where it has all.

    A `part` file needs only the columns with a task axis. There may be others: parameters, and what later versions
    add.
    """
    there = {column.name: column for column in schema.columns}
    if schema.kind == "tuning":
        lacking = [one for one in tuning_schema((), 1).columns if not _held(one, there)]
        return f"{lacking[0].name} over {', '.join(lacking[0].dims)}" if lacking else ""
    table = there.get({"sources": "q", "fit": "mu", "run": "start"}[schema.kind])
    dims = () if table is None else tuple(name for name in table.dims if name != TASK)
    if part and schema.kind == "run":
        return "" if {"steps", "reached", TASK_DIGEST} <= there.keys() else "steps, reached or task_digest"
    if len(dims) < 2:
        return "its tables over states and actions"
    for wanted in _least(schema.kind, dims):
        found = there.get(wanted.name)
        free = schema.kind == "run" and wanted.name in ("start", "potential")
        if found is None or not serves(found, wanted, free):
            return f"{wanted.name} ({wanted.dtype}) over {', '.join(wanted.dims)}"
    return ""


def serves(found: Column, wanted: Column, free: bool = False) -> bool:
    """Whether a column is laid out as another; a `free` one may also have a task axis before its dimensions."""
    dims = found.dims[1:] if free and found.per_task else found.dims
    return (dims, found.little_endian, found.hashed) == (wanted.dims, wanted.little_endian, wanted.hashed)


def _least(kind: str, dims: tuple[str, ...]) -> tuple[Column, ...]:
    """The columns of `kind` whatever its options, for tables over `dims`."""
    *state_axes, action = (Axis(name, np.arange(1)) for name in dims)
    states = tuple(state_axes)
    if kind == "sources":
        return sources_schema(states, action, (), 0).columns
    if kind == "fit":
        return fit_schema(states, action, 1).columns
    return run_schema(
        states,
        action,
        (),
        1,
        start_per_task=False,
        potential_per_task=False,
        exact_values=False,
        evaluations=0,
        keep_q=False,
    ).columns


def _held(wanted: Column, there: dict[str, Column]) -> bool:
    return wanted.name in there and serves(there[wanted.name], wanted)


def _keeping() -> tuple[Column, ...]:
    return (
        Column(
            "seconds",
            (TASK,),
            "f8",
            "s",
            "time inside the kernel, a fair share of its batch",
            hashed=False,
            low=0,
            high=LONGEST,
        ),
        Column(
            TASK_DIGEST, (TASK, "byte"), "u1", long_name="SHA-256 of the task's hashed columns", hashed=False
        ),
    )


def _weighing() -> tuple[Column, ...]:
    return (
        Column(
            "weight",
            (TASK, "moment", "hypothesis"),
            "f4",
            long_name="weight of a library table",
            low=0,
            high=1 + ROUNDING,
        ),
        Column("moves", (TASK,), "i4", long_name="times that the start table followed the weights", low=0),
        Column(
            "frozen", (TASK,), "i4", long_name="episodes after which the weights froze, -1: never", low=-1
        ),
    )


def _led(per_task: bool, dims: tuple[str, ...]) -> tuple[str, ...]:
    return (TASK, *dims) if per_task else dims


def _index(name: str, length: int) -> Axis:
    return Axis(name, np.arange(length, dtype=np.int64), "1", f"index of the {name}")


def _digest_axis() -> Axis:
    return Axis("byte", np.arange(DIGEST_BYTES, dtype=np.int64), "1", "index into a digest")


def _check_name(name: str) -> None:
    if not NAME.fullmatch(name):
        raise ValueError(f"{name!r} is no name for an axis or column: small letters, digits and _")
