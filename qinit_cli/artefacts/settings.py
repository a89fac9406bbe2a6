"""What changes an artefact's numbers: read whole from what the store keeps, by the dataclasses that made it, or refused.

An artefact's settings contain all that transfer and compare need of the stage before, so that files can travel alone. A setting
that an earlier version did not have may be missing if its option has a default; an unknown one is refused.
"""

from __future__ import annotations

import dataclasses
import math
import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Any, ClassVar, Protocol, Self, TypeVar

from qinit_cli.environments import FAMILIES, Family
from qinit_cli.environments.folds import OF_FILES
from qinit_cli.environments.imported import ImportedTables
from qinit_cli.environments.task_ranges import FOLD, folds_of
from qinit_cli.environments.tiled import TiledFamily, Tiles
from qinit_cli.errors import NotAllowed, QinitError
from qinit_cli.fitted import FitOptions
from qinit_cli.learners import LEARNERS, Learner, QLearner
from qinit_cli.learners.exploration import EXPLORATIONS, EpsilonGreedy, Exploration
from qinit_cli.learning import EXACT, IMPORTED, IMPORTED_CURVES, KNOWNNESS, Learning
from qinit_cli.methods import METHODS, Method
from qinit_cli.methods.plus import Plus, initialisations
from qinit_cli.methods.zero import Zero
from qinit_cli.options import is_of
from qinit_cli.registry import PLUG_IN
from qinit_cli.rewards import UNIT, Payment, ReturnBounds, payment
from qinit_cli.schedules import Schedule, schedule
from qinit_store.guard import MOST_TASKS

if TYPE_CHECKING:
    from qinit_cli.tasks import SourceTasks, TargetTasks

Spec = Mapping[str, Any]  # as the store keeps it
Made = TypeVar("Made")

# raised whenever the same settings would give other numbers; a family may have a higher one of its own
ALGORITHM = 1
CONTENT = re.compile("[0-9a-f]{64}")  # the hash of an artefact
LEAST_FITTED = 2  # sources of a fit: a standard deviation takes two
ROLES = ("source", "target")
# stand-ins for settings that there are none of, where tables were solved for, or learned elsewhere
WITHOUT_STEPS: dict[str, Any] = {
    "alpha": 0.1,
    "epsilon": 0.0,
    "episodes": 1,
    "horizon": 1,
    "start": "fixed",
    "learner": QLearner(),
    "explore": EpsilonGreedy(),
}
# what there is; alpha and horizon of exact tables are kept for the transfer that follows
NOT_LEARNED: dict[str, dict[str, Any]] = {
    EXACT: {"alpha": float | str, "gamma": float, "horizon": int},
    IMPORTED: {"gamma": float},
    IMPORTED_CURVES: {"gamma": float, "episodes": int, "horizon": int},
}
SCHEDULED = ("alpha", "epsilon")  # numbers or schedules; these are kept as they are typed
OF_TARGETS: dict[str, Any] = {  # what runs and tunings have in common
    "algorithm_version": int,
    "method": dict,
    "family": dict,
    "learning": dict,
    "seed": int,
    "tasks": int,
    "inputs": list,
}
OF_SET = ("estimator", "library", "holdout", "exclude_unlearned")  # options of a fit that a run names
TILES = "tiles"  # the setting of a family that is learned by tiles
LEFT_OUT = (
    "reward",
    "returns",
    "wrap",
    "state",
    "map",
    "goals_per_task",
    "slip_per",
)  # not stored at their defaults, as before families had these options; a family may have more, as its `left_out`
REFUSALS = (ValueError, TypeError, OverflowError, QinitError)  # of a dataclass that cannot be so


@dataclass(frozen=True)
class StoredFamily:
    """A family as an artefact names it."""

    name: str
    options: Spec
    here: Family | None  # None: a plug-in's that is not installed

    @classmethod
    def of(cls, family: Family) -> Self:
        """The family, to be stored."""
        if isinstance(family, TiledFamily):
            inner = cls.of(family.family)
            return cls(inner.name, {**inner.options, TILES: asdict(family.cut)}, family)
        told = _plain(asdict(family))  # type: ignore[call-overload]  # a dataclass
        left_out = (*LEFT_OUT, *getattr(family, "left_out", ()))
        usual = {one.name: one.default for one in dataclasses.fields(family) if one.name in left_out}  # type: ignore[arg-type]  # as above
        kept = {key: value for key, value in told.items() if key not in usual or value != usual[key]}
        return cls(family.name, kept, family)

    @classmethod
    def read(cls, told: Any) -> Self:
        """ValueError where it cannot be."""
        name, options = _named(told, "the family")
        own = {key: value for key, value in options.items() if key != TILES}
        here: Any = _built(FAMILIES[name], own, f"the family {name}") if name in FAMILIES else None
        if TILES in options:
            cut = _built(Tiles, _object(options[TILES], TILES), TILES)
            here = None if here is None else _built(TiledFamily, {"family": here, "cut": cut}, TILES)
        return cls(name, options, here)

    def spec(self) -> dict[str, Any]:
        """As the store keeps it."""
        return {"name": self.name, **self.options}

    def distribution(self) -> dict[str, Any]:
        """As the store keeps it, without the options that name targets; of a fold it says how many there are, not which."""
        here = self._untiled
        fields = () if here is None else dataclasses.fields(here)  # type: ignore[arg-type]  # a dataclass
        named = {field.name for field in fields if not field.compare}
        told = {key: value for key, value in self.spec().items() if key not in named}
        return told | ({"use": folds_of(self.fold)} if self.fold else {})

    @property
    def fold(self) -> str:
        """The fold of its file that is left out, as "fold:2/5"; empty where tasks are not cut into folds."""
        use = self.options.get("use") if isinstance(self._untiled, OF_FILES) else None
        return use if use and FOLD.fullmatch(use) else ""

    @property
    def _untiled(self) -> Family | None:
        """The family whose options these are."""
        return self.here.family if isinstance(self.here, TiledFamily) else self.here

    @property
    def tiled(self) -> bool:
        """Whether values are sums of weights of tiles, at probes: no return bounds them, and nothing is counted by state."""
        return TILES in self.options

    @property
    def label(self) -> str:
        """What it calls its distribution; where it is not installed, its name and options."""
        if self.here is not None:
            return self.here.label
        given = [f"{key}={value}" for key, value in sorted(self.options.items()) if value is not None]
        return " ".join([self.name, *given])

    def payment(self, gamma: float) -> Payment | None:
        """What its steps pay; of a family that is not installed, all that its options tell."""
        if self.here is not None:
            return self.here.payment(gamma)
        reward = str(self.options.get("reward", "goal"))
        if reward == "native":
            return Payment(ReturnBounds(-math.inf, math.inf), None, 0.0)
        return payment(reward, gamma)

    def bounds(self, gamma: float) -> ReturnBounds:
        """The least and the largest return of its tasks."""
        paid = self.payment(gamma)
        return UNIT if paid is None else paid.bounds

    def installed(self, provenance: Mapping[str, Any] | None = None) -> Family:
        """The family; NotAllowed where it is not installed. The artefact's `provenance` tells which plug-in is missing."""
        if self.here is not None:
            return self.here
        package = str((provenance or {}).get(f"{PLUG_IN} {self.name}", ""))
        there = f"known are {', '.join(FAMILIES)}"
        remedy = f"it came with {package}: pip install {package.split()[0]}" if package.strip() else there
        raise NotAllowed(f"the family {self.name} is not installed here; {remedy}")


@dataclass(frozen=True)
class StoredMethod:
    """A method as an artefact names it."""

    name: str
    label: str
    options: Spec  # what it starts from, `init`, with its own name and options
    here: Method | None  # None: it, or what it starts from, is a plug-in's that is not installed
    min_visits: int | None = None  # of entries that a lifetime adds; None: it adds none
    known_at: int | None = None  # updates after which a blended value is the learned one; None: no blend

    @classmethod
    def of(cls, method: Method, family: Family) -> Self:
        """The method, to be stored with the options that it has on the family."""
        options = asdict(method.on(family))  # type: ignore[call-overload]  # a dataclass
        if isinstance(method, Plus):
            start = initialisations()[method.init]()
            options["init"] = {"name": start.name, **asdict(start)}  # type: ignore[call-overload]  # a dataclass
        return cls(method.name, method.label, _plain(options), method)

    @classmethod
    def read(cls, told: Any, tuned: Iterable[str] = ()) -> Self:
        """ValueError where it cannot be, or has no option `tuned`; one that is not installed may have any options."""
        name, options = _named(told, "the method")
        label = options.pop("label", None)
        if not isinstance(label, str):
            raise ValueError("the method lacks its label")
        visits = None
        if "update" in options:
            update = _of(options.pop("update"), "the update", {"min_visits": int})
            _at_least(update, min_visits=1)
            visits = update["min_visits"]
        known_at = None
        if "blend" in options:
            blend = _of(options.pop("blend"), "the blend", {"name": str, "known_at": int})
            _among("the blend", blend["name"], (KNOWNNESS,))
            _at_least(blend, known_at=1)
            known_at = blend["known_at"]
        given = dict(options)
        first, own = _first(options.get("init"))
        if first is not None and own is not None and first in METHODS:
            _built(METHODS[first], own, f"the method {first}")
        if first is not None:
            given["init"] = first
        here = None
        if name in METHODS:
            # what it starts from, if that is not installed, would be refused: the rest is checked without it
            known = own is None or str(first) in METHODS
            checked = given if known else {key: value for key, value in given.items() if key != "init"}
            made = _built(METHODS[name], checked, f"the method {name}")
            if unknown := set(tuned) - {field.name for field in dataclasses.fields(made)}:  # type: ignore[arg-type]  # a dataclass
                raise ValueError(f"the method {name} has no {min(unknown)} to choose")
            here = made if known else None
        return cls(name, label, options, here, visits, known_at)

    def spec(self) -> dict[str, Any]:
        """As the store keeps it."""
        update = {} if self.min_visits is None else {"update": {"min_visits": self.min_visits}}
        blend = {"blend": {"name": KNOWNNESS, "known_at": self.known_at}} if self.blended else {}
        return {"name": self.name, "label": self.label, **self.options, **update, **blend}

    def installed(self) -> Method:
        """The method; NotAllowed where it is not installed."""
        if self.here is None:
            raise NotAllowed(f"the method {self.label} is not installed here; known are {', '.join(METHODS)}")
        return self.here

    @property
    def start(self) -> str:
        """The method that it starts from."""
        return _first(self.options.get("init"))[0] or Zero.name

    @property
    def plus(self) -> bool:
        """Whether it starts from another method instead of zero."""
        return self.start != Zero.name

    @property
    def blended(self) -> bool:
        """Whether what it starts from gives way to learned values."""
        return self.known_at is not None

    @property
    def reads_sources(self) -> bool:
        """Whether its start depends on the sources; True for a method that is not installed."""
        return self.here is None or self.here.reads_sources


@dataclass(frozen=True)
class StoredLearner(Learner):
    """A plug-in's learner that is not installed: its settings can be read and compared, but nothing be learned by it."""

    name: str = ""  # type: ignore[misc]  # of each its own
    options: Spec = dataclasses.field(default_factory=dict)

    def kernel(self, learning: Learning, batch: Any) -> Any:
        """None: NotAllowed."""
        raise NotAllowed(f"the learner {self.name} is not installed here; known are {', '.join(LEARNERS)}")

    def __str__(self) -> str:
        """As it would be typed, with all options."""
        given = ",".join(f"{name}={value}" for name, value in self.options.items())
        return ":".join([self.name, *([given] if given else [])])


class DrawnTasks(Protocol):
    """How the tasks of an artefact were drawn."""

    @property
    def algorithm_version(self) -> int:
        """That of the program that learned them."""

    @property
    def family(self) -> StoredFamily:
        """What they were drawn from."""

    @property
    def tasks(self) -> int:
        """How many there are to be."""


class Settings(Protocol):
    """What decides the numbers of an artefact; each kind has a dataclass of its own."""

    kind: ClassVar[str]

    @property
    def sources(self) -> DrawnTasks:
        """How its tasks, or those that it was made of, were drawn."""

    def spec(self) -> dict[str, Any]:
        """As the store keeps them."""


@dataclass(frozen=True)
class SourcesSettings:
    """What decides the numbers of source tasks."""

    kind: ClassVar[str] = "sources"
    algorithm_version: int
    family: StoredFamily
    learner: str
    learning: Learning  # of the exact learner with stand-ins for what it does not have
    seed: int
    tasks: int
    role: str = "source"
    files: tuple[str, ...] = ()  # SHA-256 of each file that tables were imported from
    min_visits: int | None = (
        None  # below which a pair of imported tables is unknown; None: visits are unknown
    )

    @classmethod
    def of(cls, tasks: SourceTasks, count: int) -> Self:
        """The settings of `count` tasks to learn."""
        family = StoredFamily.of(tasks.family)
        learning = tasks.learning
        if tasks.learner == EXACT:
            stands_in = {
                name: value for name, value in WITHOUT_STEPS.items() if name not in NOT_LEARNED[EXACT]
            }
            learning = dataclasses.replace(learning, **stands_in)
        version = _algorithm(tasks.family)
        return cls(version, family, tasks.learner, learning, tasks.seed, count, tasks.role)

    @classmethod
    def read(cls, spec: Spec) -> Self:
        """ValueError, in one clause, for the first setting that cannot be."""
        return cls.read_within(_beside_kind(cls.kind, spec))

    @classmethod
    def read_within(cls, told: Spec) -> Self:
        """The same as `within` wrote them."""
        needed = {
            "algorithm_version": int,
            "family": dict,
            "learner": str,
            "learning": dict,
            "seed": int,
            "tasks": int,
        }
        told = _of(told, "the settings", needed, {"role": str, "files": list, "min_visits": int})
        _among("role", told.get("role", "source"), ROLES)
        files = told.get("files", [])
        if (told["learner"] == IMPORTED) != bool(files) or not all(map(_is_content, files)):
            raise ValueError(
                f"files is {files!r}; imported tables have a list of content hashes, others none"
            )
        _at_least(told, min_visits=0)
        return cls(**{**told, "files": tuple(files), **_drawn(told)})

    def spec(self) -> dict[str, Any]:
        """As the store keeps them."""
        return {"kind": self.kind, **self.within()}

    def within(self) -> dict[str, Any]:
        """As they stand in the settings of what is made from these sources."""
        return {
            "algorithm_version": self.algorithm_version,
            "role": self.role,
            "family": self.family.spec(),
            "learner": self.learner,
            "learning": plain_learning(self.learning, self.learner),
            "seed": self.seed,
            "tasks": self.tasks,
            **({"files": list(self.files)} if self.files else {}),
            **({} if self.min_visits is None else {"min_visits": self.min_visits}),
        }

    @property
    def bounds(self) -> ReturnBounds:
        """The least and the largest return of the tasks."""
        return self.family.bounds(self.learning.gamma)

    @property
    def imported(self) -> bool:
        """Whether the tables were learned elsewhere: path lengths, steps and where targets start are unknown."""
        return self.learner == IMPORTED

    @property
    def varied(self) -> bool:
        """Whether each value has a variance of TD errors."""
        return not (self.imported or self.family.tiled)

    @property
    def sources(self) -> SourcesSettings:
        """The settings by which the tasks were drawn."""
        return self

    def choice(self) -> Self:
        """What replicates of a set of sources share; the rest is neutral."""
        return dataclasses.replace(
            self, algorithm_version=ALGORITHM, seed=0, tasks=1, role="source", files=self.files[:0]
        )


@dataclass(frozen=True)
class FitSettings:
    """What decides the numbers of a fit."""

    kind: ClassVar[str] = "fit"
    algorithm_version: int
    content: str  # hash of the sources
    sources: SourcesSettings
    options: FitOptions
    given: tuple[str, ...]  # names of the options stored: earlier versions had fewer
    initialisations: tuple[str, ...] | None = None  # methods whose starts are judged by the sources held out

    @classmethod
    def of(cls, sources: SourcesSettings, content: str, options: FitOptions) -> Self:
        """The settings of a fit of the sources with this content hash; all methods' starts are judged."""
        judged = tuple(initialisations()) if options.holdout else None
        return cls(ALGORITHM, content, sources, options, tuple(asdict(options)), judged)

    @classmethod
    def read(cls, spec: Spec) -> Self:
        """ValueError, in one clause, for the first setting that cannot be."""
        options = {field.name: object for field in dataclasses.fields(FitOptions)}
        needed = {"algorithm_version": int, "inputs": list, "sources": dict, "estimator": str}
        more = {**options, "initialisations": list}
        told = _of(_beside_kind(cls.kind, spec), "the settings", needed, more)
        content = _content(told)
        judged = told.get("initialisations")
        if not all(isinstance(one, str) for one in judged or ()):
            raise ValueError(f"initialisations is {judged!r}, no list of texts")
        sources = SourcesSettings.read_within(told["sources"])
        given = {name: told[name] for name in options if name in told}
        fitted = _fitted(given, sources.tasks)
        judged = None if judged is None else tuple(judged)
        return cls(told["algorithm_version"], content, sources, fitted, tuple(given), judged)

    def choice(self) -> Self:
        """What the fits of replicates share; the rest is neutral."""
        return dataclasses.replace(self, content="", sources=self.sources.choice())

    def spec(self) -> dict[str, Any]:
        """As the store keeps them."""
        judged = {} if self.initialisations is None else {"initialisations": list(self.initialisations)}
        return {
            "kind": self.kind,
            "algorithm_version": self.algorithm_version,
            "inputs": [self.content],
            "sources": self.sources.within(),
            **{name: getattr(self.options, name) for name in self.given},
            **judged,
        }


@dataclass(frozen=True)
class SourceSet:
    """What tells one source set from its replicates, the content hash of the sources, and what all replicates share."""

    content: str
    family: StoredFamily
    learner: str
    learning: Learning
    tasks: int
    fitted: FitOptions
    given: tuple[str, ...]  # names of the options stored
    seed: int | None = None  # of the sources, where they are at hand

    @classmethod
    def of(cls, fit: FitSettings) -> Self:
        """The set that was fitted."""
        sources = fit.sources
        given = tuple(name for name in OF_SET if name in fit.given)
        return cls(
            fit.content, sources.family, sources.learner, sources.learning, sources.tasks, fit.options, given
        )

    @classmethod
    def unknown(cls, family: StoredFamily, learning: Learning) -> Self:
        """The one set that all imported curves of a distribution count as started from."""
        from qinit_store.spec import spec_sha256

        return cls(spec_sha256(family.spec()), family, IMPORTED, learning, 1, FitOptions(), ())

    @classmethod
    def read(cls, told: Any) -> Self:
        """ValueError, in one clause, for the first setting that cannot be."""
        drawn = {"sources": str, "family": dict, "learner": str, "learning": dict, "tasks": int}
        told = _of(told, "the source set", drawn, dict.fromkeys(OF_SET, object))
        there = _drawn(told)
        given = {name: told[name] for name in OF_SET if name in told}
        fitted = _fitted(given, told["tasks"])
        return cls(
            told["sources"],
            **there,
            learner=told["learner"],
            tasks=told["tasks"],
            fitted=fitted,
            given=tuple(given),
        )

    def spec(self) -> dict[str, Any]:
        """As the store keeps it."""
        return {"sources": self.content, **self.shared()}

    def shared(self) -> dict[str, Any]:
        """What all replicates share."""
        return {
            "family": self.family.spec(),
            "learner": self.learner,
            "learning": plain_learning(self.learning, self.learner),
            "tasks": self.tasks,
            **{name: getattr(self.fitted, name) for name in self.given},
        }


@dataclass(frozen=True)
class RunSettings:
    """What decides the numbers of a run: the method, the targets, how they are learned, the fit and what it was made of.

    Tables that `optimal` learned are not named: these settings decide them, and their content hash changes with their count,
    on which no single target depends.
    """

    kind: ClassVar[str] = "run"
    algorithm_version: int
    method: StoredMethod
    family: StoredFamily
    learning: Learning
    seed: int
    tasks: int
    content: str  # hash of the fit
    source_set: SourceSet
    keep_q: bool = False
    evaluate_every: int = 0

    @classmethod
    def of(cls, method: Method, targets: TargetTasks, tasks: int, content: str, fit: FitSettings) -> Self:
        """The settings of targets to learn from the fit with this content hash."""
        return cls(
            **_of_targets(method, targets),
            tasks=tasks,
            content=content,
            source_set=SourceSet.of(fit),
            keep_q=targets.keep_q,
            evaluate_every=targets.evaluate_every,
        )

    @classmethod
    def read(cls, spec: Spec) -> Self:
        """ValueError, in one clause, for the first setting that cannot be."""
        told = _beside_kind(cls.kind, spec)
        imported = _object(told.get("family"), "the family").get("name") == ImportedTables.name
        needed = OF_TARGETS | ({} if imported else {"source_set": dict})
        more = {} if imported else {"keep_q": bool, "evaluate_every": int}
        told = _of(told, "the settings", needed, more)
        _at_least(told, evaluate_every=0)
        found = _read_targets(told, learner=IMPORTED_CURVES if imported else "")
        there = (
            SourceSet.unknown(found["family"], found["learning"])
            if imported
            else SourceSet.read(told["source_set"])
        )
        return cls(**found | {"source_set": there})

    @property
    def bounds(self) -> ReturnBounds:
        """The least and the largest return of the tasks."""
        return self.family.bounds(self.learning.gamma)

    @property
    def imported(self) -> bool:
        """Whether the curves come from elsewhere: start, sources and how the targets were learned are unknown."""
        return self.family.name == ImportedTables.name

    def spec(self) -> dict[str, Any]:
        """As the store keeps them."""
        if self.imported:
            return _targets_spec(self, IMPORTED_CURVES)
        return {
            **_targets_spec(self),
            "source_set": self.source_set.spec(),
            "keep_q": self.keep_q,
            "evaluate_every": self.evaluate_every,
        }

    @property
    def sources(self) -> Self:
        """The settings by which the tasks were drawn."""
        return self

    def choice(self) -> Self:
        """What runs from replicates of a source set share; the rest is neutral."""
        return dataclasses.replace(
            self, seed=0, tasks=1, content="", source_set=dataclasses.replace(self.source_set, content="")
        )


@dataclass(frozen=True)
class TuningSettings:
    """What decides a choice of parameters: the method as it is by default, the values tried, and how the sources were learned."""

    kind: ClassVar[str] = "tuning"
    algorithm_version: int
    method: StoredMethod
    grid: Mapping[str, Sequence[float]]
    family: StoredFamily
    learning: Learning
    seed: int
    tasks: int
    content: str  # hash of the sources
    sources: SourcesSettings

    @classmethod
    def of(
        cls,
        method: Method,
        grid: Mapping[str, Sequence[float]],
        targets: TargetTasks,
        sources: SourcesSettings,
        content: str,
        tasks: int,
    ) -> Self:
        """The settings of a choice by the sources with this content hash."""
        return cls(
            **_of_targets(method, targets),
            tasks=tasks,
            content=content,
            grid={name: list(values) for name, values in grid.items()},
            sources=sources,
        )

    @classmethod
    def read(cls, spec: Spec) -> Self:
        """ValueError, in one clause, for the first setting that cannot be."""
        needed = OF_TARGETS | {"grid": dict, "sources": dict}
        told = _of(_beside_kind(cls.kind, spec), "the settings", needed)
        for name, values in told["grid"].items():
            if not (isinstance(values, list) and values and all(is_of(value, float) for value in values)):
                raise ValueError(f"the values tried of {name} are no list of numbers")
        found = _read_targets(told, tuned=told["grid"])
        return cls(**found | {"sources": SourcesSettings.read_within(told["sources"])})

    @property
    def bounds(self) -> ReturnBounds:
        """The least and the largest return of the tasks."""
        return self.family.bounds(self.learning.gamma)

    def spec(self) -> dict[str, Any]:
        """As the store keeps them."""
        return {
            **_targets_spec(self),
            "grid": {name: list(values) for name, values in self.grid.items()},
            "sources": self.sources.within(),
        }


def plug_ins(settings: Settings) -> dict[str, str]:
    """The plug-ins whose families, methods and learners they name: "plug-in NAME", and the distribution with its version.

    Also the packages that a family's numbers depend on (its `packages`), with their versions.
    """
    from importlib.metadata import version

    family = settings.sources.family.name
    methods = set(settings.initialisations or ()) if isinstance(settings, FitSettings) else set()
    if isinstance(settings, RunSettings | TuningSettings):
        methods |= {settings.method.name, settings.method.start}
    packages = [(family, FAMILIES.package(family))]
    packages += [(name, METHODS.package(name)) for name in sorted(methods)]
    packages += [(name, LEARNERS.package(name)) for name in sorted(_learners(settings))]
    needed = getattr(settings.sources.family.here, "packages", ())
    return {f"{PLUG_IN} {name}": package for name, package in packages if package} | {
        each: version(each) for each in sorted(needed)
    }


def _learners(settings: Settings) -> set[str]:
    """The learners behind an artefact, but for the exact one."""
    match settings:
        case RunSettings():
            several = [settings.learning, settings.source_set.learning]
        case TuningSettings():
            several = [settings.learning, settings.sources.learning]
        case SourcesSettings() | FitSettings():
            several = [settings.sources.learning]
        case _:
            several = []
    return {learning.learner.name for learning in several}


def without_range(spec: Spec) -> dict[str, Any]:
    """The settings of sources, without their number and the tasks of a file that they are."""
    kept = {name: value for name, value in spec.items() if name != "tasks"}
    if isinstance(family := spec.get("family"), Mapping):
        kept["family"] = {name: value for name, value in family.items() if name != "use"}
    return kept


def outdated(settings: Settings) -> list[str]:
    """A warning where an earlier version learned these tasks, or the sources behind them, otherwise; else none."""
    told = settings.sources
    family = told.family.here
    if family is None or told.algorithm_version >= _algorithm(family):
        return []
    return [
        f"these tasks of {family.name} were learned by an earlier version: {getattr(family, 'learned_anew', '')}"
    ]


def _plain(options: Spec) -> dict[str, Any]:
    """The options as they are read again: lists in the place of tuples."""
    return {name: list(value) if isinstance(value, tuple) else value for name, value in options.items()}


def _of_targets(method: Method, targets: TargetTasks) -> dict[str, Any]:
    """What runs and tunings have in common, of tasks to learn as targets."""
    stored = StoredMethod.of(method, targets.family)
    return {
        "algorithm_version": _algorithm(targets.family),
        "method": dataclasses.replace(stored, label=targets.label_of(method), known_at=targets.known_at),
        "family": StoredFamily.of(targets.family),
        "learning": targets.learning,
        "seed": targets.seed,
    }


def _read_targets(told: Spec, tuned: Iterable[str] = (), learner: str = "") -> dict[str, Any]:
    """The fields of a run or a tuning; ValueError where what both have in common cannot be."""
    found = {
        "family": StoredFamily.read(told["family"]),
        "learning": _learning(told["learning"], learner),
        "content": _content(told),
    }
    _counted(told)
    found["method"] = StoredMethod.read(told["method"], tuned)
    return {name: value for name, value in told.items() if name != "inputs"} | found


def _targets_spec(settings: RunSettings | TuningSettings, learner: str = "") -> dict[str, Any]:
    """What runs and tunings have in common, as the store keeps it."""
    return {
        "kind": settings.kind,
        "algorithm_version": settings.algorithm_version,
        "method": settings.method.spec(),
        "family": settings.family.spec(),
        "learning": plain_learning(settings.learning, learner),
        "seed": settings.seed,
        "tasks": settings.tasks,
        "inputs": [settings.content],
    }


def _algorithm(family: Family) -> int:
    return int(getattr(family, "algorithm", ALGORITHM))


def plain_learning(learning: Learning, learner: str = "") -> dict[str, Any]:
    """As the store keeps it, for what is learned; of tables that were solved for or imported, the settings that they have.

    Learner and exploration stand there unless they are epsilon-greedy Q-learning.
    """
    told = {one.name: getattr(learning, one.name) for one in dataclasses.fields(Learning)}
    told |= {name: str(told[name]) for name in SCHEDULED if isinstance(told[name], Schedule)}
    if learner in NOT_LEARNED:
        kept = {name: told[name] for name in NOT_LEARNED[learner]}
        if learner == IMPORTED_CURVES and kept["horizon"] == WITHOUT_STEPS["horizon"]:
            del kept["horizon"]  # unknown, as the steps are
        return kept
    for name, usual in (("learner", QLearner()), ("explore", EpsilonGreedy())):
        one = told.pop(name)
        if one != usual:
            told[name] = {"name": one.name, **options_of(one)}
    return told


def options_of(one: Learner | Exploration) -> dict[str, Any]:
    """The options of a learner or an exploration by the names that are typed."""
    if isinstance(one, StoredLearner):
        return dict(one.options)
    return {name.rstrip("_"): value for name, value in _plain(asdict(one)).items()}


def _beside_kind(kind: str, spec: Spec) -> dict[str, Any]:
    """The settings beside the name of the kind."""
    if (said := spec.get("kind")) != kind:
        raise ValueError(f"its settings are of {said!r}, the artefact is of {kind}")
    return {name: value for name, value in spec.items() if name != "kind"}


def _learning(told: Any, learner: str = "") -> Learning:
    """How tasks are learned, by the `learner` of this name if one is given; ValueError where that cannot be."""
    settings = dict(_object(told, "learning"))
    if learner in NOT_LEARNED:
        more = {"horizon": int} if learner == IMPORTED_CURVES else {}
        needed = {name: kind for name, kind in NOT_LEARNED[learner].items() if name not in more}
        settings = WITHOUT_STEPS | _of(settings, "learning", needed, more)
    for name in SCHEDULED:
        if isinstance(text := settings.get(name), str):
            settings[name] = _schedule(name, text)
    readers: dict[str, Callable[[Any], Any]] = {"learner": _learner, "explore": _exploration}
    for name, reader in readers.items():
        if name in settings and learner not in NOT_LEARNED:
            settings[name] = reader(settings[name])
    found = _built(Learning, settings, "learning")
    if learner not in ("", *NOT_LEARNED, found.learner.name):
        raise ValueError(f"the learner is {learner!r}, and learning is by {found.learner.name}")
    return found


def _schedule(name: str, text: str) -> Schedule:
    found = schedule(text)
    if not isinstance(found, Schedule) or str(found) != text:
        raise ValueError(f"{name} is {text!r} in learning, no schedule as it is written here")
    return found


def _learner(told: Any) -> Learner:
    name, options = _named(told, "the learner")
    return _with_options(LEARNERS[name], options, name) if name in LEARNERS else StoredLearner(name, options)


def _exploration(told: Any) -> Exploration:
    name, options = _named(told, "the exploration")
    _among("exploration", name, EXPLORATIONS)
    return _with_options(EXPLORATIONS[name], options, name)


def _with_options(kind: type[Made], options: Spec, name: str) -> Made:
    """An instance by its options as they are typed; ValueError where one is unknown or out of its range."""
    fields = {one.name.rstrip("_"): one.name for one in dataclasses.fields(kind)}  # type: ignore[arg-type]  # a dataclass
    _refuse_unknown(options, fields, name)
    return _built(kind, {fields[key]: value for key, value in options.items()}, name)


def _built(kind: Callable[..., Made], settings: Spec, what: str) -> Made:
    """An instance of a dataclass; ValueError where a setting is missing, unknown or out of its range."""
    known = {field.name: field for field in dataclasses.fields(kind) if field.init}  # type: ignore[arg-type]  # a dataclass
    _refuse_unknown(settings, known, what)
    for name, field in known.items():
        if name not in settings and field.default is field.default_factory is dataclasses.MISSING:
            raise ValueError(f"{what} lacks {name}")
    try:
        return kind(**settings)
    except REFUSALS as error:
        raise ValueError(f"{what} cannot be so: {error}") from error


def _drawn(told: Spec) -> dict[str, Any]:
    """How sources were drawn and learned: part of every artefact that is made from them."""
    found = {
        "family": StoredFamily.read(told["family"]),
        "learning": _learning(told["learning"], told["learner"]),
    }
    _counted(told)
    return found


def _counted(told: Spec) -> None:
    """ValueError where there can be no such number of tasks in an artefact, or no such seed."""
    _at_least(told, tasks=1, seed=0)
    if told["tasks"] > MOST_TASKS:
        raise ValueError(f"tasks is {told['tasks']}; an artefact holds {MOST_TASKS} at most")


def _fitted(told: Spec, tasks: int) -> FitOptions:
    """ValueError where `tasks` sources cannot be fitted with these options."""
    options = _built(FitOptions, told, "the fit")
    if options.holdout > tasks - LEAST_FITTED:
        raise ValueError(
            f"holdout is {options.holdout}; a fit of {tasks} sources keeps at least {LEAST_FITTED}"
        )
    return options


def _first(init: Any) -> tuple[str | None, dict[str, Any] | None]:
    """What a method starts from, with its options where they stand there; None where it names nothing."""
    if isinstance(init, dict):
        return _named(init, "what the method starts from")
    return (None if init is None else str(init)), None


def _named(told: Any, what: str) -> tuple[str, dict[str, Any]]:
    settings = dict(_object(told, what))
    name = settings.pop("name", None)
    if not isinstance(name, str):
        raise ValueError(f"{what} lacks its name")
    return name, settings


def _object(told: Any, what: str) -> Spec:
    if not isinstance(told, Mapping):
        raise ValueError(f"{what} is {told!r}, which are no settings")
    return told


def _of(
    told: Any, what: str, needed: Mapping[str, Any], more: Mapping[str, Any] | None = None
) -> dict[str, Any]:
    """The settings, each of the type it must have; those in `more` may be missing."""
    settings, known = _object(told, what), {**needed, **(more or {})}
    _refuse_unknown(settings, known, what)
    for name, kind in known.items():
        if name in settings:
            if not is_of(settings[name], kind):
                raise ValueError(f"{name} is {settings[name]!r} in {what}")
        elif name in needed:
            raise ValueError(
                f"{what} lacks {name}" if what != "the settings" else f"the settings lack {name}"
            )
    return dict(settings)


def _refuse_unknown(settings: Spec, known: Iterable[str], what: str) -> None:
    if unknown := sorted(set(settings) - set(known)):
        raise ValueError(f"{unknown[0]!r} in {what} is no setting of this version")


def _among(name: str, value: Any, choices: Iterable[str]) -> None:
    """ValueError where a setting is none of the choices."""
    if value not in choices:
        raise ValueError(f"the {name} is {value!r}; it is one of {', '.join(choices)}")


def _at_least(settings: Spec, **least: int) -> None:
    """ValueError where a setting is below its least value; one that is absent is none."""
    for name, low in least.items():
        if settings.get(name, low) < low:
            raise ValueError(f"{name} is {settings[name]}; it must be at least {low}")


def _content(told: Spec) -> str:
    """The content hash of the one input."""
    inputs = told["inputs"]
    if len(inputs) != 1 or not _is_content(inputs[0]):
        raise ValueError(f"inputs is {inputs!r}, no list of one content hash")
    return str(inputs[0])


def _is_content(value: Any) -> bool:
    return isinstance(value, str) and bool(CONTENT.fullmatch(value))
