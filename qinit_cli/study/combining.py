"""Every combination of a study's distributions, source sets, fits, methods and targets, as an artefact."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any

from qinit_cli.environments import Family
from qinit_cli.methods import Method
from qinit_cli.options import key_of, options
from qinit_cli.pipeline.asked import FROM_SOURCES, LearningSources, LearningTargets
from qinit_cli.study.entries import DistributionEntry, Entries, FitEntry, MethodEntry, tuning_of
from qinit_cli.study.given import MOST, Given
from qinit_cli.study.planned import Artefact, PlannedFit, PlannedRun, PlannedSources

Settings = dict[str, Any]
Same = tuple[Family, Method, LearningTargets, tuple[Any, ...]]


@dataclass(frozen=True)
class Selectable:
    """An artefact, and what it is selected by."""

    artefact: Artefact
    distributions: frozenset[str]  # names of its distribution
    fits: frozenset[str] = frozenset()
    methods: frozenset[str] = frozenset()
    settings: tuple[tuple[str, Any], ...] = ()
    place: tuple[int, ...] = ()  # among distributions, methods and the rest, in the order of the file


@dataclass
class Combining:
    """Combines the entries of a file; too many combinations are refused at its `top`."""

    entries: Entries
    top: Given
    _alike: dict[Same, PlannedRun] = field(
        default_factory=dict
    )  # runs that read no sources: one serves all sets
    _count: int = 0  # of combinations, those that another run serves among them

    def __iter__(self) -> Iterator[Selectable]:
        for at, distribution in enumerate(self.entries.distributions):
            learned = [tuple(self.entries.targets(distribution, method)) for method in self.entries.methods]
            for place, learning in enumerate(self.entries.sources(distribution)):
                sources = PlannedSources(distribution.family, learning)
                told = settings_of(distribution.family) | settings_of(learning, "sources.")
                told |= {"seed": learning.seed}
                self._add()
                yield Selectable(sources, distribution.names, settings=_items(told), place=(at, -1, place))
                for fit_at, fit in enumerate(self.entries.fits):
                    if _allows(fit.given, "distributions", distribution.names) and _allows(
                        distribution.given, "fits", fit.names
                    ):
                        where = (at, place, fit_at)
                        yield from self._of_fit(distribution, sources, fit, told, learned, where)

    def _of_fit(
        self,
        distribution: DistributionEntry,
        sources: PlannedSources,
        entry: FitEntry,
        told: Settings,
        learned: list[tuple[LearningTargets, ...]],
        where: tuple[int, int, int],
    ) -> Iterator[Selectable]:
        """The fit of some sources, and its runs; `where` it stands among distributions, sources and fits."""
        at, *rest = where
        fit, told = PlannedFit(sources, entry.options), told | settings_of(entry.options)
        self._add()
        yield Selectable(fit, distribution.names, entry.names, settings=_items(told), place=(at, -1, *rest))
        for method_at, method in enumerate(self.entries.methods):
            if not _together(distribution, entry, method):
                continue
            for target_at, targets in enumerate(learned[method_at]):
                self.entries.check_targets(distribution, method, targets)
                self._add()
                run = PlannedRun(fit, method.method, targets, tuning_of(method, sources))
                if self._serves_already(run):
                    continue
                own = (
                    settings_of(method.method)
                    | settings_of(targets, "targets.")
                    | {"method": method.method.name}
                )
                place = (at, method_at, *rest, target_at)
                yield Selectable(
                    run, distribution.names, entry.names, method.names, _items(told | own), place
                )

    def _serves_already(self, run: PlannedRun) -> bool:
        """Whether another run is the same, as it is for every source set where the method reads no sources."""
        if run.method.reads_sources:
            return False
        same = (run.family, run.method, run.learning, _inherited(run.fit.sources.learning))
        return self._alike.setdefault(same, run) is not run

    def _add(self) -> None:
        self._count += 1
        if self._count > MOST:
            self.top.refuse(
                f"its lists make more than {MOST:,} artefacts; shorten them, or make several studies of it"
            )


def settings_of(instance: Any, prefix: str = "") -> Settings:
    """Options by the names that a selection has for them."""
    return {prefix + key_of(one.name): getattr(instance, one.name) for one in options(type(instance))}


def _together(distribution: DistributionEntry, fit: FitEntry, method: MethodEntry) -> bool:
    """Whether none of the three leaves out one of the others."""
    return (
        _allows(method.given, "distributions", distribution.names)
        and _allows(method.given, "fits", fit.names)
        and _allows(fit.given, "methods", method.names)
        and _allows(distribution.given, "methods", method.names)
    )


def _allows(given: Given, key: str, names: frozenset[str]) -> bool:
    """Whether the entry is for what has one of these names; without the key it is for all."""
    listed = given.texts(key)
    return listed is None or bool(names & set(listed))


def _inherited(sources: LearningSources) -> tuple[Any, ...]:
    """What targets take over from sources beside their tables."""
    return tuple(getattr(sources, name) for name in FROM_SOURCES)


def _items(settings: Mapping[str, Any]) -> tuple[tuple[str, Any], ...]:
    return tuple(settings.items())
