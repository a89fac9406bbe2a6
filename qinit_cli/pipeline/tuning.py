"""Choosing a method's parameters by its sources alone: each source stands in for a target, the method knowing the others.

The sources are split into folds; a fit of all others is what the method starts the sources of a fold with, and these are
learned as targets are. No target and none of the targets' dice are seen, so that the choice cannot flatter a comparison.
The average of the chosen candidate is the largest of several and reads a little too high; `worth` does not.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import Field, dataclass, replace
from typing import TYPE_CHECKING, Any, Literal, get_type_hints

import numpy as np

from qinit_cli.analysis.intervals import Estimate, over_targets
from qinit_cli.artefacts.opening import open_artefact
from qinit_cli.environments import Family, family_of, label_of
from qinit_cli.errors import NotAllowed, UsageError
from qinit_cli.fields import flag, options
from qinit_cli.methods import METHODS, Method
from qinit_cli.seeding import Stream, generator

if TYPE_CHECKING:
    from pathlib import Path

    from qinit_cli.arrays import Flags, Floats, Integers
    from qinit_store.held import Held
    from qinit_store.reading import Artefact

FOLDS = 5
Grid = dict[str, tuple[float, ...]]  # the values to try of each parameter
End = Literal["smallest", "largest"]


def folds(kept: Flags) -> Integers:
    """The fold of each source, (N,), -1 for those that are not `kept` (N,): runs of ids, as even as can be.

    Tasks are independent draws, so runs are as good as any other split, and tasks of a fold are learned side by side.
    """
    fold = np.full(len(kept), -1, np.int64)
    for number, ids in enumerate(np.array_split(np.flatnonzero(kept), FOLDS)):
        fold[ids] = number
    return fold


@dataclass(frozen=True)
class Candidate:
    """How one choice of parameters fared, with 95 % intervals over sources."""

    parameters: dict[str, float]
    average: Estimate
    difference: Estimate  # to the method as it is by default, on the same sources
    default: bool
    chosen: bool


def judged(average: Floats, parameters: dict[str, Floats], seed: int) -> list[Candidate]:
    """The candidates by their parameters: `average` (N, C), the default first, NaN for sources that were not tried, (C,) each."""
    tried = average[~np.isnan(average).any(axis=1)]
    rng = generator(seed, Stream.BOOTSTRAP, 0)
    found = over_targets(np.concatenate([tried, tried - tried[:, :1]], axis=1), rng)
    count = average.shape[1]
    best = int(np.argmax(found.estimate[:count]))  # the first of equals: the default, if it is among them
    told = [
        Candidate(
            parameters={name: float(column[place]) for name, column in parameters.items()},
            average=found.at(place),
            difference=found.at(count + place),
            default=place == 0,
            chosen=place == best,
        )
        for place in range(count)
    ]
    return sorted(told, key=lambda one: tuple(one.parameters.values()))


@dataclass(frozen=True)
class Choice:
    """What a tuning found."""

    method: str
    label: str  # of the method and the distribution
    sources: int  # that were tried
    candidates: list[Candidate]  # by their parameters
    worth: Estimate  # what choosing gains on sources that had no part in the choice, to the default
    # the parameters of the chosen one beyond which nothing was tried, though there is more
    edges: dict[str, End]

    @classmethod
    def of(cls, artefact: Artefact) -> Choice:
        """The choice that is kept, every task verified."""
        average, seed = artefact.read("average"), int(artefact.spec["seed"])
        method, grid = artefact.spec["method"], artefact.spec["grid"]
        known = [one.name for one in _options(str(method["name"]))]
        names = sorted(grid, key=lambda name: known.index(name) if name in known else 0)
        found = judged(average, {name: artefact.read(name) for name in names}, seed)
        return cls(
            method=str(method["name"]),
            label=f"{method['label']}, {label_of(artefact.spec)}",
            sources=int((~np.isnan(average).any(axis=1)).sum()),
            candidates=found,
            worth=worth(average, seed),
            edges=edges(str(method["name"]), found, grid),
        )

    @property
    def names(self) -> list[str]:
        """The parameters that vary."""
        return list(self.chosen.parameters)

    @property
    def chosen(self) -> Candidate:
        """The best."""
        return next(one for one in self.candidates if one.chosen)

    @property
    def default(self) -> Candidate:
        """The method as it is by default."""
        return next(one for one in self.candidates if one.default)


def worth(average: Floats, seed: int) -> Estimate:
    """The gain over the default of what the other folds' sources choose, (N, C) as for `judged`, judged by each fold's own."""
    tried = average[~np.isnan(average).any(axis=1)]
    gained = np.zeros(len(tried))
    fold = folds(np.ones(len(tried), bool))
    for number in range(FOLDS):
        own = fold == number
        best = int(np.argmax(tried[~own].mean(axis=0)))
        gained[own] = tried[own, best] - tried[own, 0]
    return over_targets(gained[:, None], generator(seed, Stream.BOOTSTRAP, 0)).at(0)


def edges(
    method: str, candidates: Sequence[Candidate], grid: Mapping[str, Sequence[float]]
) -> dict[str, End]:
    """Which of the chosen parameters is an end of what was tried; not where the option's range ends, nor of one value alone."""
    bounds = {one.name: (one.metadata["low"], one.metadata["high"]) for one in _options(method)}
    [best] = [one for one in candidates if one.chosen]
    found: dict[str, End] = {}
    for name in (name for name in best.parameters if len(grid[name]) > 1):
        value, values = best.parameters[name], {one.parameters[name] for one in candidates}
        low, high = bounds.get(name, (None, None))
        if value == min(values) and value != low:
            found[name] = "smallest"
        elif value == max(values) and value != high:
            found[name] = "largest"
    return found


def _options(method: str) -> tuple[Field[Any], ...]:
    """The options of a method, () where it is a plug-in's that is not installed any more."""
    kind = METHODS.get(method)
    return options(kind) if kind else ()


def settings(artefact: Artefact) -> dict[str, Any]:
    """The options that a tuned method is to have: the chosen parameters, and what was given to tune besides."""
    kind, family = METHODS[artefact.spec["method"]["name"]], family_of(artefact.spec)
    defaults = {one.name: one.default for one in options(kind)}
    stored = {name: artefact.spec["method"][name] for name in defaults}
    if isinstance(stored.get("init"), dict):
        stored["init"] = stored["init"]["name"]
    method = kind(**stored)
    for name, default in defaults.items():  # what the family fills in stays with the family
        plainer = replace(method, **{name: default})  # type: ignore[type-var]  # every concrete method is a dataclass
        if plainer.on(family) == method.on(family):
            method = plainer
    given = {name: getattr(method, name) for name in defaults if getattr(method, name) != defaults[name]}
    chosen = with_parameters(method, Choice.of(artefact).chosen.parameters)
    return given | {name: getattr(chosen, name) for name in artefact.spec["grid"]}


def chosen(tuning: Path | Held, method: Method, family: Family) -> tuple[Method, list[dict[str, str]]]:
    """The method with what a tuning chose, and the tuning as an input; UsageError where both set an option."""
    with open_artefact(tuning, "tuning") as artefact:
        name = artefact.spec["method"]["name"]
        if name != method.name:
            raise NotAllowed(f"{artefact.path} chose parameters of {name}, not of {method.name}")
        drawn, wanted = family_of(artefact.spec), settings(artefact)
        given = {"role": "tuning", "name": artefact.path.stem, "content_sha256": artefact.content_sha256}
        if drawn != family:
            raise NotAllowed(
                f"{artefact.path} chose parameters for {drawn.label}; this fit is of {family.label}: tune its own sources"
            )
    defaults = {one.name: one.default for one in options(type(method))}
    clash = [one for one, value in wanted.items() if getattr(method, one) not in (defaults[one], value)]
    if clash:
        raise UsageError(f"{flag(clash[0])} and --tuned both say what {clash[0]} is; leave one of them out")
    return replace(method, **wanted), [given]  # type: ignore[type-var]  # every concrete method is a dataclass


def with_parameters(method: Method, parameters: dict[str, float]) -> Method:
    """The method with these parameters, whole numbers where it takes whole numbers; ValueError for one that cannot be."""
    hints, given = get_type_hints(type(method)), dict[str, float]()
    for name, value in parameters.items():
        whole = hints[name] in (int, int | None)
        if whole and not float(value).is_integer():
            raise ValueError(f"{flag(name)} is {value:g}; it must be a whole number")
        given[name] = int(value) if whole else float(value)
    return replace(method, **given)  # type: ignore[type-var]  # every concrete method is a dataclass
