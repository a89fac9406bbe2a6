"""A run as every tracker takes it: parameters, a number for each step of its curves, and summary numbers."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from datetime import datetime
from importlib import import_module
from typing import TYPE_CHECKING, Any

from qinit_cli.artefacts.run import RUN, mean_curves
from qinit_cli.errors import NotAllowed, UsageError

if TYPE_CHECKING:
    from qinit_cli.arrays import Floats
    from qinit_store.reading import Artefact

Plain = str | int | float | bool
EPISODES = ("return", "success", "steps")
GREEDY = {"greedy_return": "eval_return", "greedy_success": "eval_reached", "greedy_steps": "eval_steps"}


SUMMARY = {"success": "average_success"}  # under its own name it would be one more point of the curve


@dataclass(frozen=True)
class RunRecord:
    """One run."""

    name: str
    method: str
    content_sha256: str
    time: float  # s since 1970, when the run was made; 0 where that is unknown
    parameters: dict[str, Plain]  # its settings, those of parts as `learning.gamma`
    curves: dict[str, Floats]  # means over targets, (E,), by episode
    evaluations: dict[str, Floats]  # means over targets, (V,), of greedy evaluations
    every: int  # episodes between evaluations
    summary: dict[str, float]

    @classmethod
    def of(cls, artefact: Artefact) -> RunRecord:
        """The record of a run, every task verified; memory is that of a block of tasks. NotAllowed without targets."""
        if not artefact.task_count:
            raise NotAllowed(f"{artefact.path.stem} has no targets, so there is no learning curve to log")
        settings, shown = RUN.read(artefact.spec), RUN.shown(artefact)
        curves = mean_curves(artefact)
        return cls(
            artefact.path.stem,
            settings.method.name,
            artefact.content_sha256,
            _seconds(artefact.provenance.get("time")),
            dict(_flat(artefact.spec)),
            {name: curves[name] for name in EPISODES if name in curves},
            {name: curves[column] for name, column in GREEDY.items() if column in curves},
            settings.evaluate_every,
            {
                SUMMARY.get(name, name): float(number)
                for name, number in shown.numbers.items()
                if math.isfinite(float(number))
            },
        )

    def steps(self) -> Iterator[tuple[int, dict[str, float]]]:
        """The numbers of each step that has any, in order: of episode `step`, and of evaluations after so many episodes."""
        found: dict[int, dict[str, float]] = {}
        for every, curves in ((1, self.curves), (self.every, self.evaluations)):
            for name, curve in curves.items():
                for place, value in enumerate(curve.tolist()):
                    found.setdefault(place * every, {})[name] = value
        yield from sorted(found.items())


@dataclass(frozen=True)
class Logged:
    """Where a run stands in a tracker."""

    place: str  # a path, or the tracker's name of the run
    new: bool  # whether it was logged now, and not before


def package(name: str, *modules: str) -> list[Any]:
    """A tracker's package, then modules of it; UsageError where it is not installed."""
    try:
        return [import_module(name), *(import_module(f"{name}.{module}") for module in modules)]
    except ImportError as missing:
        raise UsageError(
            f"--to {name} needs the package {name}, which cannot be imported ({missing}); "
            f"in a clone of qinit, pip install '.[{name}]'"
        ) from missing


def _flat(settings: Mapping[str, Any], above: str = "") -> Iterator[tuple[str, Plain]]:
    for name, value in settings.items():
        if isinstance(value, Mapping):
            yield from _flat(value, f"{above}{name}.")
        else:
            yield f"{above}{name}", value if isinstance(value, Plain) else json.dumps(value)


def _seconds(time: object) -> float:
    try:
        return datetime.fromisoformat(str(time)).timestamp()
    except ValueError:
        return 0.0
