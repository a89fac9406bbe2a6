"""What a study makes and shows, as data. Nothing is learned or drawn here.

An artefact is planned by the same dataclasses of options that the plain command reads, so that both make the same.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Literal

from qinit_cli.environments import Family
from qinit_cli.fitted import FitOptions
from qinit_cli.methods import Method
from qinit_cli.pipeline.asked import CrossValidating, LearningSources, LearningTargets

if TYPE_CHECKING:
    from qinit_cli.plots import Plot

Metric = Literal["return", "success", "steps"]
Values = tuple[tuple[str, tuple[float, ...]], ...]  # of each parameter that is tuned, those that are tried


@dataclass(frozen=True)
class PlannedSources:
    """Source tasks of one distribution."""

    family: Family
    learning: LearningSources


@dataclass(frozen=True)
class PlannedFit:
    """The fit of some sources."""

    sources: PlannedSources
    options: FitOptions = field(default_factory=FitOptions)


@dataclass(frozen=True)
class PlannedTuning:
    """A method's parameters, chosen by some sources."""

    sources: PlannedSources
    method: Method  # with the options that do not vary
    values: Values
    learning: CrossValidating = field(default_factory=CrossValidating)


@dataclass(frozen=True)
class PlannedRun:
    """Targets learned from what a method makes of a fit."""

    fit: PlannedFit
    method: Method
    learning: LearningTargets
    tuning: PlannedTuning | None = None

    @property
    def family(self) -> Family:
        """What the sources are drawn from."""
        return self.fit.sources.family


Artefact = PlannedSources | PlannedFit | PlannedTuning | PlannedRun
STAGES: dict[type[Artefact], str] = {
    PlannedSources: "sources",
    PlannedFit: "fits",
    PlannedTuning: "tunings",
    PlannedRun: "runs",
}


def inputs(artefact: Artefact) -> tuple[Artefact, ...]:
    """What it is made of."""
    match artefact:
        case PlannedSources():
            return ()
        case PlannedFit(sources) | PlannedTuning(sources):
            return (sources,)
        case PlannedRun(fit, tuning=tuning):
            return (fit,) if tuning is None else (fit, tuning)


def ordered(artefacts: Iterable[Artefact]) -> tuple[Artefact, ...]:
    """These artefacts and all that they are made of, each once: sources, their fits with all their runs, set after set."""
    needed: dict[PlannedSources, dict[Artefact, dict[Artefact, None]]] = {}
    for artefact in artefacts:
        match artefact:
            case PlannedSources():
                needed.setdefault(artefact, {})
            case PlannedFit(sources) | PlannedTuning(sources):
                needed.setdefault(sources, {}).setdefault(artefact, {})
            case PlannedRun(fit, tuning=tuning):
                runs = needed.setdefault(fit.sources, {}).setdefault(fit, {})
                runs |= {} if tuning is None else {tuning: None}
                runs[artefact] = None
    return tuple(dict.fromkeys(_flat(needed)))


def _flat(needed: dict[PlannedSources, dict[Artefact, dict[Artefact, None]]]) -> Iterator[Artefact]:
    for sources, made in needed.items():
        yield sources
        for fit, runs in made.items():
            yield fit
            yield from runs


def named(artefact: Artefact) -> str:
    """The artefact on a line of progress."""
    match artefact:
        case PlannedSources(family, learning):
            return f"sources {family.label} seed {learning.seed}"
        case PlannedFit(sources):
            return f"fit {sources.family.label} seed {sources.learning.seed}"
        case PlannedTuning(sources, method):
            return f"tuning {method.label} {sources.family.label} seed {sources.learning.seed}"
        case PlannedRun(fit, method):
            return f"{method.label} {fit.sources.family.label} seed {fit.sources.learning.seed}"


@dataclass(frozen=True)
class PlannedPicture:
    """One picture, made of artefacts."""

    name: str  # of its file, without the ending
    figure: str  # that it belongs to
    plot: Plot
    artefacts: tuple[Artefact, ...]
    title: str | None
    caption: str
    optional: bool = False  # whether it is left out, with a note, where these artefacts make none


@dataclass(frozen=True)
class PlannedTable:
    """Runs side by side, as `qinit compare` has them."""

    name: str
    figure: str
    runs: tuple[PlannedRun, ...]
    title: str
    first: int | None = None  # targets that count; None: all
    baseline: str = "zero"
    metric: Metric = "return"
    columns: tuple[str, ...] = ()  # of its files for spreadsheets and data frames; (): all

    @property
    def artefacts(self) -> tuple[Artefact, ...]:
        """What it is made of."""
        return self.runs


@dataclass(frozen=True)
class PlannedShares:
    """What decides the average of these runs, as `qinit sensitivity` has it."""

    runs: tuple[PlannedRun, ...]
    metric: Metric = "return"
    name: str = "shares"
    figure: str = "shares"
    title: str = "What decides the average"

    @property
    def artefacts(self) -> tuple[Artefact, ...]:
        """What it is made of."""
        return self.runs


@dataclass(frozen=True)
class PlannedJudgement:
    """The paper's claims, as `qinit verdicts` judges them from artefacts."""

    artefacts: tuple[Artefact, ...]
    whole: bool  # whether claims that these artefacts say nothing of are reported too
    name: str = "verdicts"
    figure: str = "verdicts"
    title: str = "The paper's claims"


Shown = PlannedPicture | PlannedTable | PlannedShares | PlannedJudgement
