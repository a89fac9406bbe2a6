"""Timing things side by side: in turns, so that whatever else the machine does hits all of them."""

from __future__ import annotations

import gc
import resource
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from statistics import median
from typing import Literal

Unit = Literal["M steps/s", "ms"]


@dataclass(frozen=True)
class Runner:
    """Something that can be timed again and again."""

    name: str
    run: Callable[
        [], float
    ]  # does the work and tells how much there was: steps, or how often it did the same thing


@dataclass(frozen=True)
class Race:
    """One runner of ours against others that do the same."""

    what: str  # the part of qinit
    case: str
    unit: Unit  # how the figures are told; a ratio above 1 means that ours is faster, whichever it is
    ours: Runner
    others: Sequence[Runner]


@dataclass(frozen=True)
class Result:
    """Ours against one other, medians over the turns."""

    what: str
    case: str
    unit: Unit
    other: str
    ours_figure: float
    other_figure: float
    ratio: float  # how many times faster ours is, the median over turns of the quotient within a turn
    ratio_low: float  # the lowest of them
    ratio_high: float  # and the highest
    turns: int


def results(race: Race, turns: int) -> list[Result]:
    """A result for each of the others, after one turn that does not count: it compiles and warms up."""
    runners = [race.ours, *race.others]
    rates: dict[str, list[float]] = {runner.name: [] for runner in runners}
    for turn in range(1 + turns):
        for runner in runners:
            gc.collect()
            began = cpu_seconds()
            work = runner.run()
            # a clock that has not moved has moved by less than its tick
            rate = work / max(cpu_seconds() - began, 1e-9)
            if turn > 0:
                rates[runner.name].append(rate)
    return [_result(race, other.name, rates[race.ours.name], rates[other.name]) for other in race.others]


def cpu_seconds() -> float:
    """Seconds of processor that this process has used so far, all its threads and the ended children included."""
    children = resource.getrusage(resource.RUSAGE_CHILDREN)
    return time.process_time() + children.ru_utime + children.ru_stime


def _result(race: Race, other: str, ours: list[float], others: list[float]) -> Result:
    quotients = [mine / theirs for mine, theirs in zip(ours, others, strict=True)]
    return Result(
        what=race.what,
        case=race.case,
        unit=race.unit,
        other=other,
        ours_figure=_figure(median(ours), race.unit),
        other_figure=_figure(median(others), race.unit),
        ratio=median(quotients),
        ratio_low=min(quotients),
        ratio_high=max(quotients),
        turns=len(quotients),
    )


def _figure(rate: float, unit: Unit) -> float:
    return rate / 1e6 if unit == "M steps/s" else 1e3 / rate
