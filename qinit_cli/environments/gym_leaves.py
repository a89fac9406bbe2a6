"""The numbers that a space is made of: Discrete, MultiDiscrete, MultiBinary and Box, and Tuple and Dict of such.

A Tuple's stand in order, a Dict's in the order of its keys, an array's as numpy lays it out.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from qinit_cli.environments.foreign import Improper

if TYPE_CHECKING:
    from gymnasium import Space

NUMERIC = "biuf"  # kinds of arrays: float() would take text, and the real part of complex numbers


@dataclass(frozen=True)
class Leaf:
    """One number of an observation or an action."""

    name: str  # where it stands
    low: float
    high: float
    whole: bool  # one of the numbers from low to high; else anything between them

    @property
    def count(self) -> int:
        """How many there are of whole ones."""
        return int(self.high) - int(self.low) + 1


class Unsuited(ValueError):
    """A space that is not made of numbers."""


def leaves(space: Space[Any], name: str = "") -> list[Leaf]:
    """Its numbers; Unsuited, which names the kind and where it stands, for a space of another kind."""
    from gymnasium import spaces

    match space:
        case spaces.Discrete():
            start = int(space.start)
            return [Leaf(name or "0", float(start), float(start + int(space.n) - 1), True)]
        case spaces.MultiDiscrete():
            lows = space.start.ravel().tolist()
            counts = space.nvec.ravel().tolist()
            return [
                Leaf(_within(name, place), float(low), float(low + count - 1), True)
                for place, (low, count) in enumerate(zip(lows, counts, strict=True))
            ]
        case spaces.MultiBinary():
            return [Leaf(_within(name, place), 0.0, 1.0, True) for place in range(math.prod(space.shape))]
        case spaces.Box():
            sides = zip(space.low.ravel().tolist(), space.high.ravel().tolist(), strict=True)
            return [
                Leaf(_within(name, place), float(low), float(high), False)
                for place, (low, high) in enumerate(sides)
            ]
        case spaces.Tuple() | spaces.Dict():
            return [
                leaf
                for key, inner in _parts(space)
                for leaf in leaves(inner, f"{name}.{key}" if name else str(key))
            ]
    raise Unsuited(f"a {type(space).__name__}{f' ({name})' if name else ''}")


def is_numbered(space: Space[Any]) -> bool:
    """Whether all of its numbers are whole ones."""
    try:
        return all(leaf.whole for leaf in leaves(space))
    except Unsuited:
        return False


def reader(space: Space[Any]) -> Callable[[Any], list[Any]]:
    """A function that gives the numbers of an element of the space, in order; Improper where it is none."""
    from gymnasium import spaces

    match space:
        case spaces.Discrete():
            return lambda observed: [observed]
        case spaces.Tuple() | spaces.Dict():
            parts = [(key, reader(inner)) for key, inner in _parts(space)]

            def read(observed: Any) -> list[Any]:
                try:
                    if len(observed) != len(parts):
                        raise Improper(f"the environment observed {observed!r:.80}, not {len(parts)} parts")
                    return [number for key, inner in parts for number in inner(observed[key])]
                except (TypeError, KeyError, IndexError) as error:
                    raise Improper(
                        f"the environment observed {observed!r:.80}, which is no {type(space).__name__} of "
                        f"{', '.join(str(key) for key, _ in parts)}"
                    ) from error

            return read
    length = math.prod(space.shape or ())
    if len(space.shape or ()) == 1:
        return _row_reader(length)
    return lambda observed: row(_flat(observed), length)


def _row_reader(length: int) -> Callable[[Any], list[Any]]:
    """`row` of so many numbers, quick where it is an array of them: every step of an environment reads one."""
    import numpy as np

    array, shape = np.ndarray, (length,)

    def read(observed: Any) -> list[Any]:
        if type(observed) is array and observed.shape == shape and observed.dtype.kind in NUMERIC:
            numbers: list[Any] = observed.tolist()
            return numbers
        return row(observed, length)

    return read


def row(observed: Any, length: int) -> list[float | int]:
    """So many numbers as Python's own; Improper where they are not, or are none."""
    import numpy as np

    try:
        array = observed if type(observed) is np.ndarray else np.asarray(observed)
        numbers = array.astype(np.float64) if array.dtype.kind == "O" else array
    except (TypeError, ValueError):  # of several lengths, or what float() does not take
        numbers = array = np.empty(0)
    if numbers.dtype.kind not in NUMERIC or array.shape != (length,):
        raise Improper(f"the environment observed {observed!r:.80}, which is no row of {length} numbers")
    found: list[float | int] = numbers.tolist()
    return found


def builder(space: Space[Any]) -> Callable[[Iterator[int]], Any]:
    """A function that makes an element of a numbered space of its numbers, each counted from 0."""
    import numpy as np
    from gymnasium import spaces

    match space:
        case spaces.Discrete():
            start = int(space.start)
            return lambda digits: start + next(digits)
        case spaces.MultiDiscrete():
            least, shape, dtype = space.start, space.shape, space.dtype
            count = math.prod(shape)
            return lambda digits: (
                np.array([next(digits) for _ in range(count)], dtype).reshape(shape) + least
            ).astype(dtype)
        case spaces.MultiBinary():
            return lambda digits: np.array(
                [next(digits) for _ in range(math.prod(space.shape))], space.dtype
            ).reshape(space.shape)
        case spaces.Tuple() | spaces.Dict():
            parts = [(key, builder(inner)) for key, inner in _parts(space)]
            if isinstance(space, spaces.Tuple):
                return lambda digits: tuple(inner(digits) for _, inner in parts)
            return lambda digits: {key: inner(digits) for key, inner in parts}
    raise Unsuited(f"a {type(space).__name__}")


def digits(number: int, counts: Sequence[int]) -> list[int]:
    """The numbers, counted from 0, of which numpy.ravel_multi_index makes this one."""
    found = []
    for count in reversed(counts):
        number, digit = divmod(number, count)
        found.append(digit)
    return found[::-1]


def _parts(space: Any) -> list[tuple[Any, Space[Any]]]:
    """The spaces within a Tuple or a Dict, with the keys by which their elements are found."""
    inner = space.spaces
    return list(inner.items()) if isinstance(inner, dict) else list(enumerate(inner))


def _within(name: str, place: int) -> str:
    return f"{name}[{place}]" if name else str(place)


def _flat(observed: Any) -> Any:
    import numpy as np

    array = np.asarray(observed)
    return observed if array.dtype.kind == "O" else array.ravel()  # what is none, row() refuses
