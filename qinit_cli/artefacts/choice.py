"""What a tuning found: how each candidate fared, which is best, and what choosing is worth.

The average of the chosen candidate is the largest of several and reads a little too high; `worth` does not.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import Field, dataclass
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from qinit_cli.analysis.intervals import Estimate, over_targets
from qinit_cli.artefacts.settings import TuningSettings
from qinit_cli.learners import QLearner
from qinit_cli.learners.exploration import EpsilonGreedy
from qinit_cli.learning import Learning
from qinit_cli.methods import METHODS
from qinit_cli.options import flag, options
from qinit_cli.seeding import Stream, generator
from qinit_store.wording import shell_line

if TYPE_CHECKING:
    from pathlib import Path

    from qinit_cli.arrays import Flags, Floats, Integers
    from qinit_store.reading import Artefact

FOLDS = 5
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
    # options of transfer that learn as it was chosen by, where these are not the usual ones
    how: tuple[str, ...] = ()

    @classmethod
    def of(cls, artefact: Artefact) -> Choice:
        """The choice that is kept, every task verified."""
        settings = TuningSettings.read(artefact.spec)
        average, seed, method, grid = artefact.read("average"), settings.seed, settings.method, settings.grid
        known = [one.name for one in _options(method.name)]
        names = sorted(grid, key=lambda name: known.index(name) if name in known else 0)
        found = judged(average, {name: artefact.read(name) for name in names}, seed)
        return cls(
            method=method.name,
            label=f"{method.label}, {settings.family.label}",
            sources=int((~np.isnan(average).any(axis=1)).sum()),
            candidates=found,
            worth=worth(average, seed),
            edges=edges(method.name, found, grid),
            how=_how(settings.learning),
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


def row(one: Candidate) -> dict[str, Any]:
    """A candidate's parameters, average and difference with their bounds, and whether it is the default or chosen."""
    return {
        **one.parameters,
        "average": one.average.value,
        "average_low": one.average.low,
        "average_high": one.average.high,
        "difference": one.difference.value,
        "difference_low": one.difference.low,
        "difference_high": one.difference.high,
        "default": one.default,
        "chosen": one.chosen,
    }


def _how(learning: Learning) -> tuple[str, ...]:
    learner = () if learning.learner == QLearner() else ("--learner", str(learning.learner))
    return learner if learning.explore == EpsilonGreedy() else (*learner, "--explore", str(learning.explore))


def sentences(choice: Choice, path: Path) -> list[str]:
    """What was chosen, what choosing is worth, and where values beyond those tried may be better."""
    best, worth = choice.chosen, choice.worth
    told = " ".join(f"{flag(name)} {value:g}" for name, value in best.parameters.items())
    if best.default:
        found = f"the default, {told}, is the best of {len(choice.candidates)}"
    else:
        unsure = "" if best.difference.low > 0 else ", from which it cannot be told"
        found = (
            f"{told} is chosen, {best.difference.value:+.4f} [{best.difference.low:.4f}, {best.difference.high:.4f}] "
            f"to the default{unsure}"
        )
    edges = [
        f"{flag(name)} {best.parameters[name]:g} is the {end} value tried; try {further} ones"
        for name, end in choice.edges.items()
        for further in ["smaller" if end == "smallest" else "larger"]
    ]
    taking = shell_line("qinit", "transfer", choice.method, "FIT", "--tuned", path, *choice.how)
    return [
        f"{choice.method}: {found}; {taking} takes it",
        f"chosen by four folds and judged by the fifth, a choice is worth {worth.value:+.4f} "
        f"[{worth.low:.4f}, {worth.high:.4f}] to the default",
        *edges,
    ]
