"""The entries of a study's file: its distributions, fits and methods, and how sources and targets of each are learned."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

from qinit_cli.environments import FAMILIES
from qinit_cli.environments.family import Family, task_count
from qinit_cli.errors import QinitError, UsageError
from qinit_cli.fitted import FitOptions
from qinit_cli.methods import METHODS, Method
from qinit_cli.nearest import nearest
from qinit_cli.options import key_of, options, tunable
from qinit_cli.pipeline.asked import CrossValidating, LearningSources, LearningTargets
from qinit_cli.study.given import MOST, Given
from qinit_cli.study.planned import PlannedSources, PlannedTuning, Values
from qinit_cli.study.scaled_file import ScaledFile

OF_DISTRIBUTION = ("family", "group", "sources", "targets", "fits", "methods")
OF_FIT = ("group", "distributions", "methods")
OF_METHOD = ("name", "group", "distributions", "fits", "targets", "tuned", "tune")


@dataclass(frozen=True)
class DistributionEntry:
    """One distribution."""

    given: Given
    family: Family
    names: frozenset[str]  # that select it: group, family, label


@dataclass(frozen=True)
class FitEntry:
    """One way to fit sources."""

    given: Given
    options: FitOptions

    @property
    def names(self) -> frozenset[str]:
        """What selects it: its group."""
        return _group(self.given)


@dataclass(frozen=True)
class MethodEntry:
    """One method with its options."""

    given: Given
    method: Method

    @property
    def names(self) -> frozenset[str]:
        """What selects it: its group, name and label."""
        return _group(self.given) | {self.method.name, self.method.label}


@dataclass
class Entries:
    """All that a file combines; a fault is UsageError, with its line."""

    scaled: ScaledFile
    sets: int | None  # in place of those that the file asks for
    _drawn: set[Any] = field(default_factory=set)  # families and changes of which targets can be drawn

    @cached_property
    def distributions(self) -> list[DistributionEntry]:
        """In the order of the file."""
        return [one for given in self.scaled.entries("distribution") for one in _distributions(given)]

    @cached_property
    def fits(self) -> list[FitEntry]:
        """In the order of the file; without a table the usual one."""
        entries = self.scaled.entries("fit") or [Given(str(self.scaled.file), ("fit",), {}, {})]
        found: list[FitEntry] = []
        for given in entries:
            given.check_keys([*OF_FIT, *keys(FitOptions)])
            own = [key for key in given.values if key not in OF_FIT]
            found += [FitEntry(given, one) for one in given.instances(FitOptions, own)]
        return found

    @cached_property
    def methods(self) -> list[MethodEntry]:
        """In the order of the file."""
        return [one for given in self.scaled.entries("method") for one in _methods(given)]

    def sources(self, distribution: DistributionEntry) -> Iterator[LearningSources]:
        """How sources of a distribution are learned, one for each source set."""
        given = self.scaled.of("sources", distribution.given)
        given.check_keys(["sets", *keys(LearningSources)])
        count = given.of("sets", int)
        if count is not None and "seed" in given.values:
            given.refuse("sets and seed both say which source sets there are; leave out one of them", "sets")
        if count is not None and not 1 <= count <= MOST:
            given.refuse(f"sets is {count}; it must be from 1 to {MOST:,}", "sets")
        if self.sets is not None and "seed" not in distribution.given.table("sources").values:
            count = self.sets
        given = given.without("sets") if count is None else given.without("sets").without("seed")
        for learning in given.instances(LearningSources):
            for seed in [learning.seed] if count is None else range(count):
                asked = replace(learning, seed=seed)
                try:
                    asked.learning(type(distribution.family))
                    task_count(distribution.family.opened(), "source", asked.tasks)
                except UsageError as error:
                    given.refuse(str(error).removeprefix("--"))
                yield asked

    def targets(self, distribution: DistributionEntry, method: MethodEntry) -> Iterator[LearningTargets]:
        """How targets of a distribution are learned by a method."""
        given = self._of_targets(distribution, method)
        given.check_keys(keys(LearningTargets))
        for targets in given.instances(LearningTargets):
            shifts = tuple(one for one in targets.shift or () if one) or None  # "" is no shift
            yield replace(targets, shift=shifts)

    def check_targets(
        self, distribution: DistributionEntry, method: MethodEntry, targets: LearningTargets
    ) -> None:
        """Refuses targets that cannot be drawn; called of those alone that runs have, as a shift fits some families only."""
        asked = (distribution.family, targets.shift, targets.targets, targets.allow_overlap)
        if asked in self._drawn:
            return
        try:
            targets.family(distribution.family.opened())
        except QinitError as error:
            said = str(error).removeprefix("--").replace("shift: --", "shift: ")
            given = self._of_targets(distribution, method)
            given.refuse(said, "shift" if said.startswith("shift") else "targets")
        self._drawn.add(asked)

    def _of_targets(self, distribution: DistributionEntry, method: MethodEntry) -> Given:
        return self.scaled.of("targets", distribution.given).merged(method.given.table("targets"))


def _distributions(given: Given) -> Iterator[DistributionEntry]:
    name = given.of("family", str)
    if name is None:
        given.refuse(f"family is missing; it is one of {', '.join(FAMILIES)}")
    if name not in FAMILIES:
        given.refuse(f"there is no family {name}; {nearest(name, FAMILIES)}", "family")
    kind = FAMILIES[name]
    given.check_keys([*OF_DISTRIBUTION, *keys(kind)], name)
    for family in given.instances(kind, [key for key in given.values if key not in OF_DISTRIBUTION]):
        try:
            opened = family.opened()
        except UsageError as error:
            given.refuse(str(error), "family")
        yield DistributionEntry(given, family, _group(given) | {name, opened.label})


def _methods(given: Given) -> Iterator[MethodEntry]:
    names = given.texts("name")
    if not names:
        given.refuse(f"name is missing; it is one of {', '.join(METHODS)}")
    for name in names:
        if name not in METHODS:
            given.refuse(f"there is no method {name}; {nearest(name, METHODS)}", "name")
        kind = METHODS[name]
        given.check_keys([*OF_METHOD, *keys(kind)], name)
        own = [key for key in given.values if key not in OF_METHOD]
        yield from (MethodEntry(given, method) for method in given.instances(kind, own))


def tuning_of(entry: MethodEntry, sources: PlannedSources) -> PlannedTuning | None:
    """How the method's parameters are chosen by its sources; None where they are as they stand."""
    given, method = entry.given, entry.method
    if not given.of("tuned", bool, False):
        if "tune" in given.values:
            given.refuse(
                "tune says how parameters are chosen; give tuned = true too, or leave it out", "tune"
            )
        return None
    kind = type(method)
    if not tunable(kind) or method.privileged:
        given.refuse(f"{method.name} has no parameters to choose; leave out tuned", "tuned")
    tune = given.table("tune")
    numbers = {key_of(one.name): one.name for one in options(kind)}
    tune.check_keys([*numbers, *keys(CrossValidating)])
    fixed = {one.name for one in options(kind) if key_of(one.name) in given.values}
    values: dict[str, tuple[float, ...]] = {
        name: (getattr(method, name),) if name in fixed else grid for name, grid in tunable(kind).items()
    }
    for key, name in numbers.items():
        if key in tune.values:
            several = tune.values[key] if isinstance(tune.values[key], list) else [tune.values[key]]
            numeric = all(isinstance(one, int | float) and not isinstance(one, bool) for one in several)
            if not several or not numeric:
                tune.refuse(f"{key} is {tune.values[key]!r}; it must be numbers", key)
            values[name] = tuple(float(one) for one in several)
            for number in values[name]:
                try:
                    replace(method, **{name: number})  # type: ignore[type-var]  # every concrete method is a dataclass
                except (ValueError, UsageError) as error:
                    tune.refuse(str(error).removeprefix("--"), key)
    found = list(tune.instances(CrossValidating, [key for key in tune.values if key not in numbers]))
    if len(found) > 1:
        tune.refuse("parameters are chosen in one way; a list is of values that are tried of a parameter")
    [learning] = found
    ordered: Values = tuple((one.name, values[one.name]) for one in options(kind) if one.name in values)
    return PlannedTuning(sources, method, ordered, learning)


def keys(owner: type[Any]) -> list[str]:
    """The options of a dataclass, as they are spelled."""
    return [key_of(one.name) for one in options(owner)]


def _group(given: Given) -> frozenset[str]:
    group = given.of("group", str)
    return frozenset([group] if group else [])
