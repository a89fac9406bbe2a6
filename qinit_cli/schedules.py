"""Schedules: step sizes and explorations that change while a task is learned, free of numpy so that help stays fast."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, fields
from typing import Any, ClassVar, TypeVar

from qinit_cli.options import is_of

LARGEST = 2.0**53  # no number of a schedule is: float64 has every whole number below it


@dataclass(frozen=True)
class Schedule:
    """A number for each episode, or for each visit; written NAME:NUMBER:NUMBER, as on the command line."""

    name: ClassVar[str]
    form: ClassVar[str]  # how it is written

    def __post_init__(self) -> None:
        for field in fields(self):
            value = getattr(self, field.name)
            whole = field.name == "episodes"
            if not is_of(value, int if whole else float) or not abs(value) < LARGEST:
                raise ValueError(f"{self.name} takes {self.form}, and {field.name} is {value!r}")
            # as a text gives it: 1 and numpy's 1.0 are one setting
            object.__setattr__(self, field.name, int(value) if whole else float(value))

    def __str__(self) -> str:
        return ":".join([self.name, *(f"{getattr(self, field.name)!r}" for field in fields(self))])

    def values(self, episodes: int) -> list[float]:
        """The number for each of the first `episodes` episodes."""
        raise NotImplementedError

    @property
    def extremes(self) -> tuple[float, float]:
        """The numbers between which all its values are, both included."""
        raise NotImplementedError


@dataclass(frozen=True)
class Linear(Schedule):
    """In equal steps from the first episode's number to that of episode `episodes` and all after it, counted from 0."""

    name: ClassVar[str] = "linear"
    form: ClassVar[str] = "linear:FROM:TO:EPISODES"
    first: float
    last: float
    episodes: int

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.episodes < 1:
            raise ValueError(f"{self.form} takes 1 episode or more, not {self.episodes}")

    def values(self, episodes: int) -> list[float]:
        """first + (last - first) min(1, e / episodes) for episode e."""
        way = self.last - self.first
        return [self.first + way * min(1.0, episode / self.episodes) for episode in range(episodes)]

    @property
    def extremes(self) -> tuple[float, float]:
        """The least and the largest of both ends."""
        return min(self.first, self.last), max(self.first, self.last)


@dataclass(frozen=True)
class Exponential(Schedule):
    """A constant share of the episode before, until `least` is reached."""

    name: ClassVar[str] = "exponential"
    form: ClassVar[str] = "exponential:FROM:DECAY:LEAST"
    first: float
    decay: float
    least: float

    def __post_init__(self) -> None:
        super().__post_init__()
        if not 0 < self.decay <= 1:
            raise ValueError(f"{self.form} takes a decay above 0 and at most 1, not {self.decay}")
        if self.least > self.first:
            raise ValueError(
                f"{self.form} falls from {self.first} to {self.least}, which is larger; exchange them"
            )

    def values(self, episodes: int) -> list[float]:
        """max(least, first decay^e) for episode e."""
        return [max(self.least, self.first * self.decay**episode) for episode in range(episodes)]

    @property
    def extremes(self) -> tuple[float, float]:
        """From `least` to `first`."""
        return self.least, self.first


@dataclass(frozen=True)
class ByVisits(Schedule):
    """1 / n^power for the n-th update of a state-action (Robbins & Monro, 1951: Q-learning converges for powers in (0.5, 1])."""

    name: ClassVar[str] = "visits"
    form: ClassVar[str] = "visits:POWER"
    power: float

    def __post_init__(self) -> None:
        super().__post_init__()
        if not 0 < self.power <= 1:
            raise ValueError(f"{self.form} takes a power above 0 and at most 1, not {self.power}")

    def of_visits(self, count: int) -> list[float]:
        """The step sizes of the first `count` updates."""
        return [1.0 / math.pow(visit, self.power) for visit in range(1, count + 1)]

    @property
    def extremes(self) -> tuple[float, float]:
        """From the least number above 0 to 1."""
        return math.ulp(0.0), 1.0


KINDS: dict[str, type[Schedule]] = {each.name: each for each in (Linear, Exponential, ByVisits)}
FORMS = ", ".join(each.form for each in KINDS.values())
Number = TypeVar("Number", int, float)


def schedule(text: str) -> float | Schedule:
    """The number or the schedule that a text writes; ValueError, one sentence, where it writes neither."""
    name, *numbers = text.split(":")
    if not numbers:
        return _number(text, text, float)
    if name not in KINDS:
        raise ValueError(f"{text!r} is no schedule; there are {FORMS}")
    kind = KINDS[name]
    if len(numbers) != len(fields(kind)):
        raise ValueError(f"{text!r} is no {kind.form}")
    types: list[Callable[[str], Any]] = [int if field.name == "episodes" else float for field in fields(kind)]
    return kind(*(_number(number, text, of) for number, of in zip(numbers, types, strict=True)))


def _number(text: str, whole: str, of: Callable[[str], Number]) -> Number:
    try:
        return of(text)
    except ValueError as error:
        if text == whole:
            raise ValueError(f"{text!r} is no number, and no schedule: {FORMS}") from error
        raise ValueError(f"{text!r} in {whole!r} is no {'whole ' * (of is int)}number") from error
