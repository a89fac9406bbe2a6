"""A study's file: which distributions, fits, methods and targets are combined, and what is shown of them.

Every option of the plain commands can stand in it, and a list makes one of each value. All of it is read before anything is
made: an unknown key, an impossible value or an empty selection is refused with its file and line.
"""

from __future__ import annotations

import hashlib
import re
import tomllib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import islice
from pathlib import Path
from typing import Any, NoReturn

from qinit_cli.environments import FAMILIES
from qinit_cli.environments.family import Family, task_count
from qinit_cli.errors import QinitError, UsageError
from qinit_cli.fitted import FitOptions
from qinit_cli.methods import METHODS, Method
from qinit_cli.nearest import nearest
from qinit_cli.options import flag, options, tunable
from qinit_cli.pipeline.asked import FROM_SOURCES, CrossValidating, LearningSources, LearningTargets
from qinit_cli.study.folder import PROGRESS
from qinit_cli.study.given import MOST, Given
from qinit_cli.study.lines import lines
from qinit_cli.study.planned import (
    Artefact,
    PlannedFit,
    PlannedJudgement,
    PlannedPicture,
    PlannedRun,
    PlannedSources,
    PlannedTable,
    PlannedTuning,
    Shown,
    Values,
    inputs,
)
from qinit_cli.study.showing import OF_PLOT, OF_TABLE, family_of, pictures, tables
from qinit_cli.study.usual import usual

TOP = (
    "study",
    "distribution",
    "sources",
    "fit",
    "method",
    "targets",
    "table",
    "plot",
    "verdicts",
    "part",
    "scale",
)
OF_STUDY = ("title", "question", "import", "baseline", "metric")
OF_DISTRIBUTION = ("family", "group", "sources", "targets", "fits", "methods")
OF_FIT = ("group", "distributions", "methods")
OF_METHOD = ("name", "group", "distributions", "fits", "targets", "tuned", "tune")
Settings = Mapping[str, Any]
FILE_NAME = re.compile(r"[\w+=-][\w.+= -]*")  # no folder, and none that is hidden
LONGEST = 200  # bytes of a name, to which endings and .part are added
OWN_FILES = ("study.json", "reproduction.json", PROGRESS)  # that a folder holds beside its tables


@dataclass(frozen=True)
class Selectable:
    """An artefact, and what it is selected by."""

    artefact: Artefact
    distributions: frozenset[str]  # names of its distribution: group, family, label
    fits: frozenset[str] = frozenset()
    methods: frozenset[str] = frozenset()
    settings: tuple[tuple[str, Any], ...] = ()
    place: tuple[int, ...] = ()  # among distributions, methods and the rest, in the order of the file


@dataclass(frozen=True)
class StudyDistribution:
    """One distribution, and how its sources and targets are learned."""

    entry: Given
    family: Family
    names: frozenset[str]
    sources: Given
    targets: Given


@dataclass
class Study:
    """A study that was read. `read` makes it."""

    file: Path
    text: str
    scale: str | None
    title: str
    question: str | None
    imports: tuple[str, ...]
    planned: tuple[Selectable, ...]
    shown: tuple[Shown, ...]
    parts: Mapping[str, tuple[str, ...]]
    sets: int | None
    selected: tuple[str, ...] = ()  # names of what alone is asked for; (): all of it

    @classmethod
    def read(cls, file: Path, scale: str | None = None, sets: int | None = None) -> Study:
        """The study in a file, at one of its scales and with so many source sets; UsageError where it is none."""
        try:
            text = file.read_bytes().decode("utf-8-sig")
        except OSError as error:
            problem = "there is no such file" if isinstance(error, FileNotFoundError) else error.strerror
            raise UsageError(f"{file}: {problem}; qinit study init writes an example") from error
        except UnicodeDecodeError as error:
            raise UsageError(f"{file} is not UTF-8 (byte {error.start}); save it as UTF-8") from error
        return cls.of(text, file, scale, sets)

    @classmethod
    def of(cls, text: str, file: Path, scale: str | None = None, sets: int | None = None) -> Study:
        """The study that a text describes."""
        try:
            values = tomllib.loads(text)
        except tomllib.TOMLDecodeError as error:
            raise UsageError(f"{file} is no TOML: {error}") from error
        except RecursionError as error:
            raise UsageError(
                f"{file} nests its lists or tables too deeply; nothing in a study needs more than three"
            ) from error
        return _Reading(Given(str(file), (), values, lines(text)), text, file, scale, sets).study()

    @property
    def digest(self) -> str:
        """SHA-256 of the file's text."""
        return hashlib.sha256(self.text.encode()).hexdigest()

    def only(self, names: Sequence[str]) -> Study:
        """What the named parts, figures, pictures and tables need, and nothing else; all of it where none is named.

        Claims are judged whole where parts alone are named, else as far as these artefacts bear on them.
        """
        if not names:
            return self
        wanted = {part for name in names for part in self.parts.get(name, (name,))}
        known = {name for one in self.shown for name in (one.name, one.figure)}
        if unknown := sorted(wanted - known):
            raise UsageError(
                f"{self.file} shows no {unknown[0]}; {nearest(unknown[0], [*self.parts, *sorted(known)])}"
            )
        shown: list[Shown] = []
        for one in self.shown:
            if not isinstance(one, PlannedJudgement) and wanted & {one.name, one.figure}:
                shown.append(one)
        needed = dict.fromkeys(artefact for one in shown for artefact in one.artefacts)
        whole = all(name in self.parts for name in names)
        if whole:
            families = {family_of(artefact) for artefact in needed}
            needed |= dict.fromkeys(one for one in _ends(self.planned) if family_of(one) in families)
        if any(isinstance(one, PlannedJudgement) for one in self.shown):
            shown.append(PlannedJudgement(tuple(needed), whole))
        kept = tuple(one for one in self.planned if one.artefact in needed)
        return replace(self, planned=kept, shown=tuple(shown), selected=tuple(names))

    @property
    def artefacts(self) -> tuple[Artefact, ...]:
        """All that is made."""
        shown = [artefact for one in self.shown for artefact in one.artefacts]
        return tuple(dict.fromkeys([*(one.artefact for one in self.planned), *shown]))


def _ends(planned: Sequence[Selectable]) -> list[Artefact]:
    """The artefacts of which no other is made."""
    given = {one for each in planned for one in inputs(each.artefact)}
    return [one.artefact for one in planned if one.artefact not in given]


@dataclass
class _Reading:
    """Reads one file."""

    top: Given
    text: str
    file: Path
    scale: str | None
    sets: int | None
    _drawn: set[Any] = field(default_factory=set)  # families and changes of which targets can be drawn

    def study(self) -> Study:
        self.top.check_keys(TOP)
        told = self.top.table("study")
        told.check_keys(OF_STUDY)
        imports = told.texts("import") or ()
        if imports:
            from qinit_cli.environments.modules import import_named

            try:
                import_named(imports)
            except UsageError as error:
                told.refuse(str(error).removeprefix("--"), "import")
        self._check_scale()
        planned = tuple(islice(self._planned(), MOST + 1))
        if len(planned) > MOST:
            self.top.refuse(
                f"its lists ask for more than {MOST:,} artefacts; shorten them, or make several studies of it"
            )
        if not planned:
            self.top.refuse("no [[distribution]] stands here; a study needs at least one")
        shown = tuple(self._shown(planned, told))
        if self._judged():
            judged = [*(artefact for one in shown for artefact in one.artefacts), *_ends(planned)]
            shown = (*shown, PlannedJudgement(tuple(dict.fromkeys(judged)), whole=True))
        self._check_files(shown)
        return Study(
            file=self.file,
            text=self.text,
            scale=self.scale,
            title=told.of("title", str) or self.file.stem,
            question=told.of("question", str),
            imports=imports,
            planned=planned,
            shown=shown,
            parts=self._parts(shown),
            sets=self.sets,
        )

    def _refuse_many(self) -> NoReturn:
        self.top.refuse(
            f"its lists make more than {MOST:,} artefacts; shorten them, or make several studies of it"
        )

    # --- scales -------------------------------------------------------------------------------------------------------------

    def _check_scale(self) -> None:
        scales = self.top.table("scale")
        for name in scales.values:
            table = scales.table(name)
            table.check_keys(["sources", "targets", *self._groups()])
        if self.scale is not None and self.scale not in scales.values:
            there = list(scales.values)
            problem = nearest(self.scale, there) if there else "its file has no [scale.NAME]"
            raise UsageError(f"{self.file} has no scale {self.scale}; {problem}")

    def _groups(self) -> list[str]:
        named = [
            entry.values.get("group", entry.values.get("name", entry.values.get("family")))
            for kind in ("distribution", "fit", "method", "table", "plot")
            for entry in self.top.tables(kind)
        ]
        return [one for one in named if isinstance(one, str)]

    def _scaled(self, entry: Given, group: str | None = None) -> Given:
        """The table as the scale has it."""
        if self.scale is None:
            return entry
        changes = self.top.table("scale").table(self.scale)
        name = group or entry.values.get("group", entry.values.get("name", entry.values.get("family")))
        return (
            entry.merged(changes.table(name)) if isinstance(name, str) and name in changes.values else entry
        )

    def _entries(self, kind: str) -> list[Given]:
        return [self._scaled(entry) for entry in self.top.tables(kind)]

    # --- artefacts ----------------------------------------------------------------------------------------------------------

    def _planned(self) -> Iterator[Selectable]:
        fits, methods = self._fits(), self._methods()
        self._check_names(fits, methods)
        alike: dict[
            Any, PlannedRun
        ] = {}  # runs of methods that read no sources, of which one serves all source sets
        count = 0  # of runs, those that another serves among them
        for at, distribution in enumerate(self._distributions()):
            names = distribution.names
            learned = [tuple(self._targets(distribution, entry)) for entry, _, _ in methods]
            for place, sources in enumerate(self._sources(distribution)):
                planned = PlannedSources(distribution.family, sources)
                own = _told(distribution.family, "") | _told(sources, "sources.") | {"seed": sources.seed}
                yield Selectable(planned, names, settings=_items(own), place=(at, -1, place))
                for fit_at, (fit_entry, options_) in enumerate(fits):
                    fit, fit_names = PlannedFit(planned, options_), _names(fit_entry)
                    if not (
                        _allows(fit_entry, "distributions", names)
                        and _allows(distribution.entry, "fits", fit_names)
                    ):
                        continue
                    with_fit = own | _told(options_, "")
                    yield Selectable(
                        fit, names, fit_names, settings=_items(with_fit), place=(at, -1, place, fit_at)
                    )
                    for method_at, (entry, method, method_names) in enumerate(methods):
                        if not (
                            _allows(entry, "distributions", names)
                            and _allows(entry, "fits", fit_names)
                            and _allows(fit_entry, "methods", method_names)
                            and _allows(distribution.entry, "methods", method_names)
                        ):
                            continue
                        for target_at, targets in enumerate(learned[method_at]):
                            self._check_targets(distribution, entry, targets)
                            count += 1
                            if count > MOST:
                                self._refuse_many()
                            run = PlannedRun(fit, method, targets, self._tuning(entry, method, planned))
                            if not method.reads_sources:
                                same = (distribution.family, method, targets, _inherited(sources))
                                if alike.setdefault(same, run) is not run:
                                    continue
                            told = (
                                with_fit
                                | _told(method, "")
                                | _told(targets, "targets.")
                                | {"method": method.name}
                            )
                            yield Selectable(
                                run,
                                names,
                                fit_names,
                                method_names | {method.label},
                                _items(told),
                                (at, method_at, place, fit_at, target_at),
                            )

    def _check_names(self, fits: list[Any], methods: list[Any]) -> None:
        """Refuses a selection by a name that nothing has."""
        known = {
            "distributions": frozenset().union(*(one.names for one in self._distributions())),
            "fits": frozenset().union(*(_names(entry) for entry, _ in fits)),
            "methods": frozenset().union(*(names | {method.label} for _, method, names in methods)),
        }
        for kind in ("distribution", "fit", "method", "table", "plot"):
            entries = self.top.tables(kind)
            shown = kind in ("table", "plot")
            for entry in [*entries, *(one for each in entries if shown for one in each.tables("select"))]:
                for key in {"distributions", "fits", "methods"} & entry.values.keys():
                    for name in entry.texts(key) or ():
                        if name not in known[key]:
                            there = sorted(known[key])
                            ending = nearest(name, there) if there else "there are none"
                            entry.refuse(f"{key} names {name!r}, which nothing is called; {ending}", key)

    @cached_property
    def _found(self) -> list[StudyDistribution]:
        found: list[StudyDistribution] = []
        for entry in self._entries("distribution"):
            name = entry.of("family", str)
            if name is None:
                entry.refuse(f"family is missing; it is one of {', '.join(FAMILIES)}")
            if name not in FAMILIES:
                entry.refuse(f"there is no family {name}; {nearest(name, FAMILIES)}", "family")
            kind = FAMILIES[name]
            entry.check_keys([*OF_DISTRIBUTION, *_keys(kind)], name)
            group = entry.of("group", str)
            for family in entry.instances(kind, [key for key in entry.values if key not in OF_DISTRIBUTION]):
                try:
                    opened = family.opened()
                except UsageError as error:
                    entry.refuse(str(error), "family")
                names = {name, opened.label, *([group] if group else [])}
                found.append(
                    StudyDistribution(
                        entry,
                        family,
                        frozenset(names),
                        self._over("sources", entry),
                        self._over("targets", entry),
                    )
                )
        return found

    def _distributions(self) -> list[StudyDistribution]:
        return self._found

    def _over(self, key: str, entry: Given) -> Given:
        """The study's [sources] or [targets], with what the entry says of them in its place."""
        usual, own = self._scaled(self.top.table(key), key), entry.table(key)
        for one, other in (("sets", "seed"), ("seed", "sets")):  # either says which source sets there are
            if one in own.values:
                usual = usual.without(other)
        return usual.merged(own)

    def _sources(self, distribution: StudyDistribution) -> Iterator[LearningSources]:
        given = distribution.sources
        given.check_keys(["sets", *_keys(LearningSources)])
        count = given.of("sets", int)
        if count is not None and "seed" in given.values:
            given.refuse("sets and seed both say which source sets there are; leave out one of them", "sets")
        if count is not None and not 1 <= count <= MOST:
            given.refuse(f"sets is {count}; it must be from 1 to {MOST:,}", "sets")
        if self.sets is not None and "seed" not in distribution.entry.table("sources").values:
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

    def _fits(self) -> list[tuple[Given, FitOptions]]:
        entries = self._entries("fit") or [Given(str(self.file), ("fit",), {}, {})]
        found: list[tuple[Given, FitOptions]] = []
        for entry in entries:
            entry.check_keys([*OF_FIT, *_keys(FitOptions)])
            keys = [key for key in entry.values if key not in OF_FIT]
            found += [(entry, one) for one in entry.instances(FitOptions, keys)]
        return found

    def _methods(self) -> list[tuple[Given, Method, frozenset[str]]]:
        found: list[tuple[Given, Method, frozenset[str]]] = []
        for entry in self._entries("method"):
            names = entry.texts("name")
            if not names:
                entry.refuse(f"name is missing; it is one of {', '.join(METHODS)}")
            for name in names:
                if name not in METHODS:
                    entry.refuse(f"there is no method {name}; {nearest(name, METHODS)}", "name")
                kind = METHODS[name]
                entry.check_keys([*OF_METHOD, *_keys(kind)], name)
                group = entry.of("group", str)
                named = frozenset({name, *([group] if group else [])})
                keys = [key for key in entry.values if key not in OF_METHOD]
                found += [(entry, method, named) for method in entry.instances(kind, keys)]
        return found

    def _targets(self, distribution: StudyDistribution, entry: Given) -> Iterator[LearningTargets]:
        given = distribution.targets.merged(entry.table("targets"))
        given.check_keys(_keys(LearningTargets))
        for targets in given.instances(LearningTargets):
            shifts = tuple(one for one in targets.shift or () if one) or None  # "" is no shift
            yield replace(targets, shift=shifts)

    def _check_targets(self, distribution: StudyDistribution, entry: Given, targets: LearningTargets) -> None:
        """Refuses targets that cannot be drawn; called of those alone that runs have, as a shift fits some families only."""
        asked = (distribution.family, targets.shift, targets.targets, targets.allow_overlap)
        if asked in self._drawn:
            return
        try:
            targets.family(distribution.family.opened())
        except QinitError as error:
            said = str(error).removeprefix("--").replace("shift: --", "shift: ")
            given = distribution.targets.merged(entry.table("targets"))
            given.refuse(said, "shift" if said.startswith("shift") else "targets")
        self._drawn.add(asked)

    def _tuning(self, entry: Given, method: Method, sources: PlannedSources) -> PlannedTuning | None:
        if not entry.of("tuned", bool, False):
            if "tune" in entry.values:
                entry.refuse(
                    "tune says how parameters are chosen; give tuned = true too, or leave it out", "tune"
                )
            return None
        kind = type(method)
        if not tunable(kind) or method.privileged:
            entry.refuse(f"{method.name} has no parameters to choose; leave out tuned", "tuned")
        tune = entry.table("tune")
        numbers = {flag(one.name).removeprefix("--"): one.name for one in options(kind)}
        tune.check_keys([*numbers, *_keys(CrossValidating)])
        given = {one.name for one in options(kind) if flag(one.name).removeprefix("--") in entry.values}
        values: dict[str, tuple[float, ...]] = {
            name: (getattr(method, name),) if name in given else grid for name, grid in tunable(kind).items()
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

    # --- what is shown --------------------------------------------------------------------------------------------------------

    def _parts(self, shown: Sequence[Shown]) -> dict[str, tuple[str, ...]]:
        parts = self.top.table("part")
        known = sorted({name for one in shown for name in (one.name, one.figure)})
        for part in parts.values:
            for name in parts.texts(part) or ():
                if name not in known:
                    parts.refuse(f"the study shows no {name}; {nearest(name, known)}", part)
        return {name: parts.texts(name) or () for name in parts.values}

    def _check_files(self, shown: Sequence[Shown]) -> None:
        """Refuses names that are no names of files, or that two pictures or two tables share."""
        for kind, called in ((PlannedPicture, "pictures"), (PlannedTable | PlannedJudgement, "tables")):
            taken = set() if kind is PlannedPicture else {Path(one).stem for one in OWN_FILES}
            for one in shown:
                if not isinstance(one, kind):
                    continue
                if len(one.name.encode()) > LONGEST or not FILE_NAME.fullmatch(one.name):
                    self.top.refuse(
                        f"{one.name!r} cannot name a file; take at most {LONGEST} letters, digits, spaces and . _ - + ="
                    )
                if one.name.lower() in taken:  # of which some file systems have one, whatever the case
                    self.top.refuse(f"two {called} are called {one.name}; give each a name of its own")
                taken.add(one.name.lower())

    def _shown(self, planned: tuple[Selectable, ...], told: Given) -> Iterator[Shown]:
        if not any(self.top.tables(kind) for kind in ("table", "plot")):
            yield from usual(planned, told)
        for entry in self._entries("plot"):
            entry.check_keys([*OF_PLOT, *self._plot_keys(entry)])
            yield from pictures(entry, planned)
        for entry in self._entries("table"):
            entry.check_keys(OF_TABLE)
            yield from tables(entry, planned, told)

    def _judged(self) -> bool:
        """Whether the paper's claims are judged: [verdicts] stands there."""
        if "verdicts" not in self.top.values:
            return False
        self.top.table("verdicts").check_keys(())
        return True

    def _plot_keys(self, entry: Given) -> list[str]:
        from qinit_cli.plots import PLOTS

        kind = entry.of("kind", str)
        if kind is None:
            entry.refuse(f"kind is missing; it is one of {', '.join(PLOTS)}")
        if kind not in PLOTS:
            entry.refuse(f"there is no plot {kind}; {nearest(kind, PLOTS)}", "kind")
        return _keys(PLOTS[kind])


def _keys(owner: type[Any]) -> list[str]:
    """The options of a dataclass, as they are spelled."""
    return [flag(one.name).removeprefix("--") for one in options(owner)]


def _names(fit: Given) -> frozenset[str]:
    """What selects a fit: its group."""
    group = fit.values.get("group")
    return frozenset([group] if isinstance(group, str) else [])


def _allows(entry: Given, key: str, names: frozenset[str]) -> bool:
    """Whether the entry is for what has one of these names; without the key it is for all."""
    listed = entry.texts(key)
    return listed is None or bool(names & set(listed))


def _inherited(sources: LearningSources) -> tuple[Any, ...]:
    """What targets take over from sources beside their tables."""
    return tuple(getattr(sources, name) for name in FROM_SOURCES)


def _told(instance: Any, prefix: str) -> dict[str, Any]:
    """Options by the names that a selection has for them."""
    return {
        prefix + flag(one.name).removeprefix("--"): getattr(instance, one.name)
        for one in options(type(instance))
    }


def _items(settings: Settings) -> tuple[tuple[str, Any], ...]:
    return tuple(settings.items())
