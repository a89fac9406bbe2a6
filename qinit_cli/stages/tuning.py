"""Choosing a method's parameters by its sources alone: each source stands in for a target, the method knowing the others.

The sources are split into folds; a fit of all others is what the method starts the sources of a fold with, and these are
learned as targets are. No target and none of the targets' dice are seen, so that the choice cannot flatter a comparison.
The average of the chosen candidate is the largest of several and reads a little too high; the differences say by how much.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from itertools import product
from typing import TYPE_CHECKING, Any

import numpy as np

from qinit_cli.analysis import intervals, returns
from qinit_cli.errors import NotAllowed
from qinit_cli.methods import Method
from qinit_cli.seeding import Stream, generator
from qinit_cli.stages.transfer import TargetTasks, learn_targets

if TYPE_CHECKING:
    from qinit_cli.arrays import Flags, Floats, Integers
    from qinit_cli.fitted import Fit
    from qinit_cli.kernels.batch import Watch
    from qinit_cli.stages.sources import Rows
    from store.reading import Artefact

FOLDS = 5
Grid = dict[str, tuple[float, ...]]  # the values to try of each parameter


def candidates(method: Method, grid: Grid) -> list[Method]:
    """The method with every combination of the grid's values, and first as it is; ValueError for a value out of its range."""
    others = [
        replace(method, **dict(zip(grid, values, strict=True)))  # type: ignore[type-var]  # every concrete method is a dataclass
        for values in product(*grid.values())
    ]
    return [method, *(other for other in others if other != method)]


def folds(kept: Flags) -> Integers:
    """The fold of each source, (N,), -1 for those that are not `kept` (N,): runs of ids, as even as can be.

    Tasks are independent draws, so runs are as good as any other split, and tasks of a fold are learned side by side.
    """
    fold = np.full(len(kept), -1, np.int64)
    for number, ids in enumerate(np.array_split(np.flatnonzero(kept), FOLDS)):
        fold[ids] = number
    return fold


@dataclass(frozen=True)
class Rehearsal:
    """Learns sources in the place of targets, under every candidate; called as any learner is, with ids of sources."""

    targets: TargetTasks  # whose tasks are the sources
    candidates: Sequence[Method]
    fits: Sequence[Fit]  # of all sources but those of a fold
    fold: Integers  # (N,)

    def __call__(self, indices: Integers, watch: Watch) -> tuple[Integers, Rows]:
        """The ids of the sources that were finished under every candidate, and a row for each column of the artefact."""
        rows: Rows = {
            "average": np.full((len(indices), len(self.candidates)), np.nan),
            "steps": np.zeros(len(indices), np.int64),
            "seconds": np.zeros(len(indices)),
        }
        finished = self.fold[indices] < 0  # what cannot be fitted is not tried
        for number in np.unique(self.fold[indices][~finished]):
            places = np.flatnonzero(self.fold[indices] == number)
            finished[places] = self._fold(indices[places], self.fits[number], watch, rows, places)
        return indices[finished], {name: values[finished] for name, values in rows.items()}

    def _fold(self, ids: Integers, fit: Fit, watch: Watch, rows: Rows, places: Integers) -> bool:
        """Fills the rows at these places; whether all was learned before the watch stopped."""
        gamma = self.targets.learning.gamma
        for column, method in enumerate(self.candidates):
            initial = method.initial(fit, self.targets.targets(0, _not_here))
            done, learned = learn_targets(self.targets, initial, ids, watch)
            if len(done) < len(ids):
                return False
            earned = returns.discounted_returns(learned["steps"], learned["reached"].astype(bool), gamma)
            rows["average"][places, column] = earned.mean(axis=1)
            rows["steps"][places] += learned["steps"].sum(axis=1, dtype=np.int64)
            rows["seconds"][places] += learned["seconds"]
        return True


@dataclass(frozen=True)
class Candidate:
    """How one choice of parameters fared, with 95 % intervals over sources."""

    parameters: dict[str, float]
    average: float
    low: float
    high: float
    difference: float  # to the method as it is by default, on the same sources
    difference_low: float
    difference_high: float
    default: bool
    chosen: bool


def judged(average: Floats, parameters: dict[str, Floats], seed: int) -> list[Candidate]:
    """The candidates by their parameters: `average` (N, C), the default first, NaN for sources that were not tried, (C,) each."""
    tried = average[~np.isnan(average).any(axis=1)]
    chance = generator(seed, Stream.BOOTSTRAP, 0)
    found = intervals.over_targets(np.concatenate([tried, tried - tried[:, :1]], axis=1), chance)
    count = average.shape[1]
    best = int(np.argmax(found.estimate[:count]))  # the first of equals: the default, if it is among them
    low, high = found.low.tolist(), found.high.tolist()
    told = [
        Candidate(
            parameters={name: float(column[place]) for name, column in parameters.items()},
            average=float(found.estimate[place]),
            low=low[place],
            high=high[place],
            difference=float(found.estimate[count + place]),
            difference_low=low[count + place],
            difference_high=high[count + place],
            default=place == 0,
            chosen=place == best,
        )
        for place in range(count)
    ]
    return sorted(told, key=lambda one: tuple(one.parameters.values()))


def chosen(artefact: Artefact) -> tuple[str, dict[str, float]]:
    """The method that a tuning is of, and the parameters it chose; every task verified."""
    parameters = {name: artefact.read(name) for name in artefact.spec["grid"]}
    found = judged(artefact.read("average"), parameters, int(artefact.spec["seed"]))
    return str(artefact.spec["method"]["name"]), next(one.parameters for one in found if one.chosen)


def parameters_of(methods: Sequence[Method], names: Sequence[str]) -> dict[str, Floats]:
    """The named parameters of each method, (C,)."""
    told: list[dict[str, Any]] = [asdict(method) for method in methods]  # type: ignore[call-overload]  # dataclasses
    return {name: np.array([float(one[name]) for one in told]) for name in names}


def with_parameters(method: Method, parameters: dict[str, float]) -> Method:
    """The method with these parameters, whole numbers where it takes whole numbers."""
    given = {name: type(getattr(method, name))(value) for name, value in parameters.items()}
    return replace(method, **given)  # type: ignore[type-var]  # every concrete method is a dataclass


def _not_here() -> Floats:
    raise NotAllowed("a method that reads the target itself has nothing that sources could choose")
