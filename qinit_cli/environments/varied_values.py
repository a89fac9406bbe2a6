"""What is varied from task to task is drawn from: a normal, a range, some values, maps, or the rows of a file.

The words on the command line, NAME=KIND:WHAT, are what is stored; a file's are stored with its digest, so that what is read
later is what was read first.
"""

from __future__ import annotations

import math
import re
from abc import ABC, abstractmethod
from dataclasses import dataclass
from functools import lru_cache
from pathlib import PurePath
from typing import TYPE_CHECKING, Any, ClassVar, Self

from qinit_cli.environments.family import Role
from qinit_cli.environments.file_rows import LARGEST, Rows, is_number, literal, read_rows
from qinit_cli.environments.foreign import aside
from qinit_cli.environments.task_ranges import named, others
from qinit_cli.errors import NotAllowed, UsageError
from qinit_store.wording import counted

if TYPE_CHECKING:
    import numpy as np

MAP_SEEDS = 2**31
MAP_TRIES = 1000
LONGEST_LABEL = 40  # letters: it becomes part of a file's name
LEAST_MASS = 0.01  # of a normal that must lie within its bounds: below it, redrawing would take its time


class VariedValues(ABC):
    """What one argument or attribute takes from task to task; numbers, unless a subclass has others."""

    form: ClassVar[str]  # how it is written behind its kind

    @classmethod
    @abstractmethod
    def read(cls, text: str, name: str) -> Self:
        """What the text behind the kind has, for the argument of this name; ValueError, in a sentence or none, for others."""

    @property
    @abstractmethod
    def label(self) -> str:
        """What it is in an artefact's name."""

    @property
    def dtype(self) -> str:
        """Of what is drawn."""
        return "<f8"

    @property
    def note(self) -> str:
        """What is drawn, if it is not the value itself; else empty."""
        return ""

    @property
    def bounds(self) -> tuple[float | None, float | None]:
        """The least and the largest number that is drawn; None where there is none."""
        return None, None

    def available(self, role: Role) -> int | None:  # neutral: few are listed
        """How many there are; None: any number is drawn."""
        return None

    @abstractmethod
    def draw(self, rng: np.random.Generator, index: int, role: Role) -> float | int:
        """A number for the task at that index of sources or targets."""

    def value(self, drawn: float | int) -> Any:
        """What the environment is given for it."""
        return float(drawn)


@dataclass(frozen=True)
class NormalValues(VariedValues):
    """A normal."""

    mean: float
    deviation: float

    form: ClassVar[str] = "MEAN,STD"

    @classmethod
    def read(cls, text: str, name: str) -> Self:
        mean, deviation = numbers(text, 2)
        if deviation < 0:
            raise ValueError("the standard deviation is negative")
        return cls(mean, deviation)

    @property
    def label(self) -> str:
        return f"N{self.mean:g}-{self.deviation:g}"

    def draw(self, rng: np.random.Generator, index: int, role: Role) -> float:
        return float(rng.normal(self.mean, self.deviation))


@dataclass(frozen=True)
class UniformValues(VariedValues):
    """Any number of a range."""

    low: float
    high: float

    form: ClassVar[str] = "LOW,HIGH"

    @classmethod
    def read(cls, text: str, name: str) -> Self:
        return cls(*ordered(*numbers(text, 2)))

    @property
    def label(self) -> str:
        return f"U{self.low:g}-{self.high:g}"

    @property
    def bounds(self) -> tuple[float, float]:
        return self.low, self.high

    def draw(self, rng: np.random.Generator, index: int, role: Role) -> float:
        return float(rng.uniform(self.low, self.high))


@dataclass(frozen=True)
class LogUniformValues(UniformValues):
    """A number whose logarithm is uniform."""

    @classmethod
    def read(cls, text: str, name: str) -> Self:
        low, high = ordered(*numbers(text, 2))
        if low <= 0:
            raise ValueError("LOW must be above 0")
        return cls(low, high)

    @property
    def label(self) -> str:
        return f"L{self.low:g}-{self.high:g}"

    def draw(self, rng: np.random.Generator, index: int, role: Role) -> float:
        drawn = math.exp(rng.uniform(math.log(self.low), math.log(self.high)))
        return min(max(drawn, self.low), self.high)  # which rounding may leave


@dataclass(frozen=True)
class TruncatedNormalValues(NormalValues):
    """A normal, drawn again until it is within its bounds."""

    low: float
    high: float

    form: ClassVar[str] = "MEAN,STD,LOW,HIGH"

    @classmethod
    def read(cls, text: str, name: str) -> Self:
        mean, deviation, *bounds = numbers(text, 4)
        low, high = ordered(*bounds)
        if deviation <= 0:
            raise ValueError("the standard deviation must be above 0")
        below, above = (math.erf((edge - mean) / deviation / math.sqrt(2)) / 2 for edge in (low, high))
        if above - below < LEAST_MASS:
            raise ValueError("less than one draw in 100 lies within LOW and HIGH; write uniform:LOW,HIGH")
        return cls(mean, deviation, low, high)

    @property
    def label(self) -> str:
        return f"T{self.mean:g}-{self.deviation:g}-{self.low:g}-{self.high:g}"

    @property
    def bounds(self) -> tuple[float, float]:
        return self.low, self.high

    def draw(self, rng: np.random.Generator, index: int, role: Role) -> float:
        while not self.low <= (drawn := super().draw(rng, index, role)) <= self.high:
            pass
        return drawn


@dataclass(frozen=True)
class WholeValues(VariedValues):
    """A whole number of a range, both its ends included."""

    low: int
    high: int

    form: ClassVar[str] = "LOW,HIGH"

    @classmethod
    def read(cls, text: str, name: str) -> Self:
        low, high = ordered(*numbers(text, 2))
        if not (low.is_integer() and high.is_integer() and max(abs(low), abs(high)) < LARGEST):
            raise ValueError("LOW and HIGH are whole numbers, both included")
        return cls(int(low), int(high))

    @property
    def label(self) -> str:
        return f"I{self.low}-{self.high}"

    @property
    def dtype(self) -> str:
        return "<i8"

    @property
    def bounds(self) -> tuple[float, float]:
        return self.low, self.high

    def draw(self, rng: np.random.Generator, index: int, role: Role) -> int:
        return int(rng.integers(self.low, self.high, endpoint=True))

    def value(self, drawn: float | int) -> int:
        return int(drawn)


@dataclass(frozen=True)
class ListedValues(VariedValues):
    """Values of which one is drawn; where they are not all numbers, by their places."""

    written: tuple[str, ...]  # as they were typed: a list is no key of a cache

    form: ClassVar[str] = "A|B|..."

    @classmethod
    def read(cls, text: str, name: str) -> Self:
        values = cls(tuple(text.split("|")))
        if len(values.written) < 2 or "" in values.written:
            raise ValueError
        if len(set(map(repr, values._there))) < len(values.written):
            raise ValueError("a value is given twice")
        return values

    @property
    def label(self) -> str:
        told = "-".join(self.written)
        return f"C{told}" if len(told) <= LONGEST_LABEL else f"C{len(self.written)}-values"

    @property
    def dtype(self) -> str:
        return "<f8" if any(isinstance(value, float) for value in self._numbers) else "<i8"

    @property
    def note(self) -> str:
        return "" if self._numbers else f"by its place in {'|'.join(self.written)}"

    @property
    def bounds(self) -> tuple[float | None, float | None]:
        return (min(self._numbers), max(self._numbers)) if self._numbers else (0, len(self.written) - 1)

    def draw(self, rng: np.random.Generator, index: int, role: Role) -> float | int:
        place = int(rng.integers(len(self.written)))
        return self._numbers[place] if self._numbers else place

    def value(self, drawn: float | int) -> Any:
        if not self._numbers:
            return self._there[int(drawn)]
        return float(drawn) if self.dtype == "<f8" else int(drawn)

    @property
    def _there(self) -> tuple[Any, ...]:
        return tuple(map(literal, self.written))

    @property
    def _numbers(self) -> tuple[float | int, ...]:
        """The values, if all of them are numbers that a column holds; else none."""
        there = self._there
        return there if all(map(is_number, there)) else ()


@dataclass(frozen=True)
class FrozenLakeMaps(VariedValues):
    """Maps of a FrozenLake, each told by its seed."""

    size: int
    frozen: float
    name: str

    form: ClassVar[str] = "SIZE,FROZEN"

    @classmethod
    def read(cls, text: str, name: str) -> Self:
        size, frozen = numbers(text, 2)
        if size < 2 or not size.is_integer() or not 0 < frozen <= 1:
            raise ValueError("SIZE is a whole number from 2, FROZEN a share above 0")
        return cls(int(size), frozen, name)

    @property
    def label(self) -> str:
        return f"M{self.size}-{self.frozen:g}"

    @property
    def dtype(self) -> str:
        return "<i8"

    @property
    def note(self) -> str:
        return "by its seed"

    @property
    def bounds(self) -> tuple[int, int]:
        return 0, MAP_SEEDS - 1

    def draw(self, rng: np.random.Generator, index: int, role: Role) -> int:
        return int(rng.integers(MAP_SEEDS))

    def value(self, drawn: float | int) -> Any:
        with aside():  # gymnasium's plug-ins are imported with it
            from gymnasium.envs.toy_text.frozen_lake import generate_random_map

        if not _map_is_found(self.size, self.frozen):
            raise UsageError(
                f"--vary {self.name}=map:{self.size},{self.frozen:g}: of {MAP_TRIES} such maps none can be solved; raise FROZEN"
            )
        return generate_random_map(size=self.size, p=self.frozen, seed=int(drawn))


@dataclass(frozen=True)
class FileRows(VariedValues):
    """The column of a file that bears the argument's name, one row a task.

    Which rows are sources' and which are targets' is named, or a column `split` tells it; without both they take turns, a
    source first.
    """

    path: str  # as it was typed
    content: str  # float, integer, or row where a column of numbers cannot hold them; with the digest known, else empty
    digest: str  # that the file must have
    name: str
    use: str | None = None  # sources' rows, and targets', see task_ranges
    targets: str | None = None

    form: ClassVar[str] = "PATH"

    @classmethod
    def read(cls, text: str, name: str) -> Self:
        stored = re.fullmatch(r"(.+)@(float|integer|row):sha256:([0-9a-f]{64})", text)
        path, content, digest = stored.groups() if stored else (text, "", "")
        if not path:
            raise ValueError
        return cls(PurePath(path).as_posix(), content, digest, name)

    def stored(self) -> str:
        """The text behind the kind with the content and the digest of the file; UsageError where there is no such file."""
        return f"{self.path}@{self._content}:sha256:{self.digest or self.rows.digest}"

    @property
    def label(self) -> str:
        return f"F{PurePath(self.path).stem}"

    @property
    def dtype(self) -> str:
        return "<f8" if self._content == "float" else "<i8"

    @property
    def note(self) -> str:
        return f"by its row in {PurePath(self.path).name}" if self._content == "row" else ""

    @property
    def rows(self) -> Rows:
        """The rows of the file; NotAllowed where it is another than tasks were drawn from."""
        rows = read_rows(self.path)
        if self.digest and rows.digest != self.digest:
            raise NotAllowed(
                f"{self.path} is not the file any more from which tasks were drawn; bring that one back"
            )
        return rows

    def of(self, role: Role) -> tuple[int, ...]:
        """The rows of sources, or of targets."""
        count, asked = self.rows.count, self.targets if role == "target" else self.use
        if self.use is None and asked is None:
            return self.rows.of[role]
        try:
            if asked is not None:
                return named("--targets" if role == "target" else "--use", asked, count)
            return others(named("--use", self.use or "", count), count)
        except ValueError as error:
            raise NotAllowed(f"of {self.path} {error}") from error

    def available(self, role: Role) -> int | None:
        return len(self.of(role))

    def at(self, row: int) -> float | int:
        """What is drawn for a row: its number where the column holds more than numbers."""
        return row if self._content == "row" else self._column[row]

    def draw(self, rng: np.random.Generator, index: int, role: Role) -> float | int:
        rows = self.of(role)
        if index >= len(rows):
            raise NotAllowed(
                f"{self.path} has {counted(len(rows), 'row')} for {role}s, and task {index + 1} was asked for; add rows, "
                "or ask for fewer --tasks"
            )
        return self.at(rows[index])

    def value(self, drawn: float | int) -> Any:
        if self._content == "row":
            return self._column[int(drawn)]
        return float(drawn) if self._content == "float" else int(drawn)

    @property
    def _content(self) -> str:
        if self.content:
            return self.content
        if not all(map(is_number, self._column)):
            return "row"
        return "float" if any(isinstance(value, float) for value in self._column) else "integer"

    @property
    def _column(self) -> tuple[Any, ...]:
        columns = self.rows.columns
        if self.name not in columns:
            raise UsageError(
                f"--vary {self.name}=file:{self.path}: there is no column {self.name}; its columns are {', '.join(columns)}"
            )
        return columns[self.name]


KINDS: dict[str, type[VariedValues]] = {
    "normal": NormalValues,
    "uniform": UniformValues,
    "map": FrozenLakeMaps,
    "choice": ListedValues,
    "integer": WholeValues,
    "loguniform": LogUniformValues,
    "truncnorm": TruncatedNormalValues,
    "file": FileRows,
}


def numbers(text: str, count: int) -> list[float]:
    """So many finite numbers, divided by commas; ValueError, without words where there are not so many."""
    try:
        found = [float(number) for number in text.split(",")]
    except ValueError:
        found = []
    if len(found) != count:
        raise ValueError
    if not all(map(math.isfinite, found)):
        raise ValueError("the numbers must be finite")
    return found


def ordered(low: float, high: float) -> tuple[float, float]:
    """Both; ValueError where the first is larger."""
    if low > high:
        raise ValueError("LOW is above HIGH")
    return low, high


@lru_cache
def _map_is_found(size: int, frozen: float) -> bool:
    """Whether a map that can be solved is found soon: gymnasium's generator would look for one without end."""
    import numpy as np
    from gymnasium.envs.toy_text.frozen_lake import is_valid

    rng = np.random.Generator(np.random.PCG64(0))
    for _ in range(MAP_TRIES):
        board = np.where(rng.random((size, size)) < frozen, "F", "H")
        board[0, 0], board[-1, -1] = "S", "G"
        if is_valid(board.tolist(), size):
            return True
    return False
