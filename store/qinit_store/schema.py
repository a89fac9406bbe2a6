"""What an artefact holds: axes, columns, their dtypes and dimensions."""

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
DIGEST_BYTES = 32
# of a column that may have any value: an unknown one, or one without bounds
ANYTHING: Mapping[str, Any] = {"low": -math.inf, "high": math.inf, "nan": True}
BLOCK_BYTES = 8 * 1024 * 1024
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
    """The axes, all but `task`, and the columns of an artefact."""

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


def serves(found: Column, wanted: Column, free: bool = False) -> bool:
    """Whether a column is laid out as another; a `free` one may also have a task axis before its dimensions."""
    dims = found.dims[1:] if free and found.per_task else found.dims
    return (dims, found.little_endian, found.hashed) == (wanted.dims, wanted.little_endian, wanted.hashed)


def digest_column() -> Column:
    """The digest of each task, which every schema of tasks has; the store fills it in."""
    return Column(
        TASK_DIGEST, (TASK, "byte"), "u1", long_name="SHA-256 of the task's hashed columns", hashed=False
    )


def digest_axis() -> Axis:
    """The axis of a digest's bytes, which every schema of tasks has."""
    return Axis("byte", np.arange(DIGEST_BYTES, dtype=np.int64), "1", "index into a digest")


def _check_name(name: str) -> None:
    if not NAME.fullmatch(name):
        raise ValueError(f"{name!r} is no name for an axis or column: small letters, digits and _")
