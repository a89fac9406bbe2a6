"""Functions of states as pictures have them: over one axis or two, the others at one place each.

A table is cut. A function of continuous states is drawn over a grid of its box: weights of tiles are summed there, values at
probes are brought to weights first, see projection.Projection.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Any, ClassVar, TypeVar

import numpy as np

from qinit_cli.environments.tiled import TiledFamily
from qinit_cli.errors import NotAllowed, UsageError
from qinit_cli.nearest import nearest
from qinit_cli.projection import Projection
from qinit_store.schema import Axis

if TYPE_CHECKING:
    from qinit_cli.arrays import Flags, Floats
    from qinit_cli.environments import Family

Found = TypeVar("Found")

CELLS = 60  # of a grid along each dimension
MOST_DRAWN = 2  # axes of a picture


@dataclass(frozen=True)
class Slice(ABC):
    """One or two axes that a picture has, and where the others are fixed."""

    axes: tuple[Axis, ...]
    at: Mapping[str, str]  # by name, as it is read

    continuous: ClassVar[bool] = False  # whether neighbours along an axis are near each other

    @property
    def told(self) -> str:
        """What is to be said of the picture, such as ", at velocity 0"; "" where it is the whole table."""
        return ", at " + ", ".join(f"{name} {value}" for name, value in self.at.items()) if self.at else ""

    @abstractmethod
    def values(self, table: Any) -> Any:
        """A function of the states (S, A) on the slice, (*axes, A)."""

    @abstractmethod
    def known(self, flags: Flags) -> Flags:
        """Where the slice is made of entries (S, A) whose flag is set, (*axes, A)."""

    def known_values(self, table: Floats) -> Floats:
        """A function of the states (S, A) that is NaN where it is unknown, on the slice, (*axes, A)."""
        return np.where(self.known(np.isfinite(table)), self.values(table), np.nan)

    def of_states(self, table: Any) -> Any:
        """One number a state, (S,) or over the state axes, on the slice, (*axes)."""
        return self.values(table.reshape(-1, 1))[..., 0]


@dataclass(frozen=True)
class TableSlice(Slice):
    """The entries of a table of some shape at these indices."""

    shape: tuple[int, ...]
    places: tuple[Any, ...]  # an index, or all, of each axis

    def values(self, table: Any) -> Any:
        return table.reshape(*self.shape, -1)[self.places]

    def known(self, flags: Flags) -> Flags:
        found: Flags = self.values(flags)
        return found


@dataclass(frozen=True)
class GridSlice(Slice):
    """The centres of a grid over the box of continuous states."""

    continuous = True

    fitted: Projection  # at the probes
    drawn: Projection  # at the centres

    @property
    def told(self) -> str:
        return f"{super().told}, projected from probes onto tiles"

    def values(self, table: Floats) -> Floats:
        """Brought to weights; probes where it is NaN do not count."""
        known = np.isfinite(table)
        if known.all():
            return self.of_weights(self.fitted.weights(table))
        coding, probes = self.fitted.coding, self.fitted.probes
        columns = [
            Projection(coding, probes[there]).weights(column[there, None])
            for column, there in zip(table.T, known.T, strict=True)
        ]
        return self.of_weights(np.concatenate(columns, axis=-1))

    def of_weights(self, weights: Floats) -> Floats:
        """The sums of weights (..., T, A), (..., *axes, A)."""
        values = self.drawn.values(weights)
        return values.reshape(*values.shape[:-2], *self._lengths, values.shape[-1])

    def known(self, flags: Flags) -> Flags:
        """Where each active tile is active at a probe whose flag is set as well."""
        touched = [np.unique(self.fitted.active[there]) for there in flags.T]
        known = [np.isin(self.drawn.active, tiles).all(axis=1) for tiles in touched]
        return np.stack(known, axis=-1).reshape(*self._lengths, -1)

    @property
    def _lengths(self) -> tuple[int, ...]:
        return tuple(axis.values.size for axis in self.axes)


def slice_of(family: Family, asked: Sequence[str] = ()) -> Slice:
    """The slice of a family's states with axes fixed as `asked`, NAME=VALUE each.

    Of continuous states the first two dimensions that are not fixed are drawn, and the others are where targets start. UsageError
    for what cannot be fixed so, NotAllowed where a table has more than two axes left.
    """
    if not isinstance(family, TiledFamily):
        return slice_of_axes(family.name, family.axes(), asked)
    state = state_of(family, asked)
    free = [name for name, coordinate in state.items() if coordinate is None]
    drawn = free[:MOST_DRAWN]
    starts = dict(zip(state, family.family.target_state(), strict=True))
    axes = tuple(_centres(family.family, *one) for one in family.family.box() if one[0] in drawn)
    state |= {name: starts[name] for name in free[MOST_DRAWN:]}
    state |= dict(zip(drawn, np.meshgrid(*(axis.values for axis in axes), indexing="ij"), strict=True))
    states = np.stack(np.broadcast_arrays(*state.values()), axis=-1).reshape(-1, len(state))
    at = {name: f"{coordinate:g}" for name, coordinate in state.items() if name not in drawn}
    return GridSlice(axes, at, family.projection, Projection(family.coding, states))


def state_of(family: TiledFamily, asked: Sequence[str]) -> dict[str, Any]:
    """The coordinate of each dimension of a continuous state that is fixed, None of the others; UsageError as `slice_of`."""
    given, box = _fixed(asked), family.family.box()
    _check_names(family.name, "dimension", [name for name, _, _ in box], given)
    return {
        one[0]: _placed(one[0], given[one[0]], partial(inside, one)) if one[0] in given else None
        for one in box
    }


def slice_of_axes(called: str, axes: Sequence[Axis], asked: Sequence[str]) -> Slice:
    """The slice of a table over these axes, of a family that is `called` so; see `slice_of`."""
    given = _fixed(asked)
    _check_names(called, "axis", [axis.name for axis in axes], given)
    left = tuple(axis for axis in axes if axis.name not in given)
    if len(left) > MOST_DRAWN:
        names = ", ".join(axis.name for axis in left)
        raise NotAllowed(
            f"a picture has one or two state axes, {called} has {names}; fix the others with --slice NAME=VALUE"
        )
    places: list[Any] = [slice(None)] * len(axes)
    at = {}
    for number, axis in enumerate(axes):
        if axis.name in given:
            places[number] = _index(axis, given[axis.name])
            at[axis.name] = _read(axis.values[places[number]])
    return TableSlice(left, at, tuple(axis.values.size for axis in axes), tuple(places))


def entry(axis: Axis, coordinate: float) -> int:
    """The cell, or the nearest bin, of a coordinate on an axis; ValueError, in one clause, where it does not reach so far."""
    nearest_to = int(np.abs(axis.values - coordinate).argmin())
    step = (axis.values[-1] - axis.values[0]) / max(1, len(axis.values) - 1)
    whole = axis.values.dtype.kind in "iu"
    if not abs(axis.values[nearest_to] - coordinate) <= (0 if whole else step / 2 * (1 + 1e-9)):
        raise ValueError(
            f"{axis.name} is {'a whole number ' if whole else ''}from {axis.values[0]:g} to {axis.values[-1]:g}"
        )
    return nearest_to


def inside(dimension: tuple[str, float, float], coordinate: float) -> float:
    """The coordinate; ValueError, in one clause, where it is outside the box."""
    name, low, high = dimension
    if not low <= coordinate <= high:
        raise ValueError(f"{name} is from {low:g} to {high:g}")
    return coordinate


def _centres(family: Any, name: str, low: float, high: float) -> Axis:
    """The centres of the grid along a dimension, with its unit where a table of the family has it as an axis."""
    axis = next((axis for axis in family.axes() if axis.name == name), None)
    centres = low + (np.arange(CELLS) + 0.5) * (high - low) / CELLS
    return Axis(name, centres, "1" if axis is None else axis.unit, name)


def _fixed(asked: Sequence[str]) -> dict[str, str]:
    """Values by name, as they were typed."""
    given: dict[str, str] = {}
    for text in asked:
        name, equals, value = (part.strip() for part in text.partition("="))
        if not (name and equals and value):
            raise UsageError(f"--slice {text}: write NAME=VALUE, such as velocity=0")
        if name in given:
            raise UsageError(f"--slice {text}: {name} is {given[name]} already")
        given[name] = value
    return given


def _check_names(called: str, noun: str, names: Sequence[str], given: Mapping[str, str]) -> None:
    for name, value in given.items():
        if name not in names:
            raise UsageError(f"--slice {name}={value}: {called} has no {noun} {name}; {nearest(name, names)}")
    if given and set(names) <= given.keys():
        raise UsageError(
            f"--slice fixes {', '.join(names)}, which leaves nothing to draw; leave one or two out"
        )


def _index(axis: Axis, text: str) -> int:
    """The index of a typed value on an axis."""
    if axis.values.dtype.kind == "S":
        labels = [value.decode() for value in axis.values]
        if text not in labels:
            raise UsageError(f"--slice {axis.name}={text}: {nearest(text, labels)}")
        return labels.index(text)
    return _placed(axis.name, text, partial(entry, axis))


def _placed(name: str, text: str, place: Callable[[float], Found]) -> Found:
    """What `place` makes of a typed number; UsageError where it is none, or has no place."""
    try:
        number = float(text)
    except ValueError as error:
        raise UsageError(f"--slice {name}={text}: {text} is no number") from error
    try:
        return place(number)
    except ValueError as error:
        raise UsageError(f"--slice {name}={text}: {error}") from error


def _read(value: Any) -> str:
    """A value as it is read."""
    return value.decode() if isinstance(value, bytes) else f"{value:g}"
