"""What a user asks of a stage: each setting once, with its default, range and help, for the library as for the command line."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, fields, replace
from typing import Any, Literal

from qinit_cli import cores
from qinit_cli.environments import Family
from qinit_cli.environments.tiled import TiledFamily, Tiles
from qinit_cli.errors import UsageError
from qinit_cli.learners import LEARNERS, Learner
from qinit_cli.learners.exploration import EXPLORATIONS, EpsilonGreedy, Exploration
from qinit_cli.learning import KNOWN_AT, Learning
from qinit_cli.options import check, flag, option
from qinit_cli.schedules import ByVisits, Exponential, Linear, Schedule, schedule
from qinit_cli.spelling import read, setting

SETTINGS = ("episodes", "horizon", "alpha", "gamma", "epsilon", "start", "explore")
FROM_SOURCES = ("alpha", "gamma", "horizon")  # targets are learned with these settings of the sources
ALL = "all there are"  # tasks of a family that takes them from a list
BY_EPISODE = f"{Linear.form} or {Exponential.form}"
TYPED = "NAME[:KEY=VALUE,...]"
EXPLORE = option(
    None,
    f"How steps explore: {', '.join(EXPLORATIONS)}, and their options.",
    metavar=TYPED,
    default_text="epsilon-greedy; greedy for delayed-q and r-max",
    seldom=True,
)
ALPHA = option(
    None,
    f"Step size, or a schedule: {Linear.form}, {Exponential.form} or {ByVisits.form}.",
    above=0,
    high=1,
    metavar="NUMBER|SCHEDULE",
    seldom=True,
)
EPSILON = option(
    None,
    f"Probability that a step explores, or a schedule: {BY_EPISODE}.",
    low=0,
    high=1,
    metavar="NUMBER|SCHEDULE",
    seldom=True,
)
BY = option(
    "q-learning",
    f"How they are learned, whatever the sources were: {', '.join(LEARNERS.own)}, and their options (docs/learners.md).",
    metavar=TYPED,
)
MIN_VISITS = 50  # 0.9^50: half a hundredth of an entry is still its start, at the grid's alpha of 0.1


def _of_tiles(name: str) -> Any:
    """An option of Tiles with no default: beside a table it must not be given."""
    [one] = [field for field in fields(Tiles) if field.name == name]
    told = one.metadata
    return option(
        None, told["help"], low=told["low"], high=told["high"], default_text=str(one.default), seldom=True
    )


@dataclass(frozen=True)
class LearningSources:
    """How source tasks are learned; None: as the family has it."""

    tasks: int | None = option(None, "Source tasks.", low=1, metavar="N")
    seed: int = option(0, "Root of all randomness; each task has streams of its own.", low=0)
    learner: str | Learner = option(
        "q-learning",
        "Exact tables by value iteration (exact), or how they are learned: "
        f"{', '.join(name for name in LEARNERS.own if LEARNERS[name].learns)}, and their options (docs/learners.md).",
        metavar=TYPED,
    )
    episodes: int | None = option(None, "Episodes of each task.", low=1)
    horizon: int | None = option(None, "Steps after which an episode is cut off.", low=1, seldom=True)
    alpha: float | str | Schedule | None = ALPHA
    gamma: float | None = option(None, "Discount.", above=0, high=1, seldom=True)
    epsilon: float | str | Schedule | None = EPSILON
    explore: str | Exploration | None = EXPLORE
    start: Literal["anywhere", "fixed"] | None = option(
        None, "Where episodes start: anywhere, or where target tasks start.", seldom=True
    )
    representation: Literal["table", "tiles"] = option(
        "table",
        "Values by a table, or linear in tiles of the continuous state (docs/continuous.md).",
    )
    tilings: int | None = _of_tiles("tilings")
    tiles: int | None = _of_tiles("tiles")
    probes: int | None = _of_tiles("probes")

    def __post_init__(self) -> None:
        _read(self, "exact")
        check(self)
        if self.representation == "table" and (given := self._cutting()):
            raise ValueError(
                f"{flag(min(given))} is of --representation tiles; give that too, or leave it out"
            )
        idle = [
            name for name in ("episodes", "epsilon", "explore", "start") if getattr(self, name) is not None
        ]
        if self.exact and idle:
            raise ValueError(
                f"the exact learner has no episodes, so {flag(idle[0])} means nothing to it; leave it out"
            )
        if isinstance(self.learner, Learner) and not self.learner.learns:
            raise ValueError(f"--learner is {self.learner}, which learns nothing; sources need another")

    @property
    def cut(self) -> Tiles | None:
        """How values are tiled; None: they are tables."""
        return Tiles(**self._cutting()) if self.representation == "tiles" else None

    def _cutting(self) -> dict[str, int]:
        """The options of tiles that are given."""
        values = {one.name: getattr(self, one.name) for one in fields(Tiles)}
        return {name: value for name, value in values.items() if value is not None}

    @property
    def exact(self) -> bool:
        """Whether the tables are solved for instead of learned."""
        return self.learner == "exact"

    def learning(self, family: type[Family]) -> Learning:
        """The family's way of learning sources with what was asked put in its place; UsageError where that cannot be."""
        return _learning(family.source_learning, {}, self)


@dataclass(frozen=True)
class LearningTargets:
    """How target tasks are learned; None: as the fit's sources or the family have it."""

    tasks: int | None = option(None, "Target tasks.", low=1, metavar="N")
    seed: int = option(
        0, "Root of the targets' randomness: every method meets the same tasks and random streams.", low=0
    )
    learner: str | Learner = BY
    episodes: int | None = option(None, "Episodes of each task.", low=1)
    horizon: int | None = option(None, "Steps after which an episode is cut off.", low=1, seldom=True)
    alpha: float | str | Schedule | None = ALPHA
    gamma: float | None = option(None, "Discount.", above=0, high=1, seldom=True)
    epsilon: float | str | Schedule | None = EPSILON
    explore: str | Exploration | None = EXPLORE
    start: Literal["anywhere", "fixed"] | None = option(
        None, "Where episodes start: at the family's target start, or anywhere.", seldom=True
    )
    shift: list[str] | None = option(
        None,
        "Draw targets from a changed family, such as variance=10; may be given several times.",
        metavar="KEY=VALUE",
        seldom=True,
    )
    targets: str | None = option(
        None,
        "Tasks of the sources' file that are targets, written as for --use of train-sources tasks and gym.",
        metavar="A:B",
        default_text="those that are no sources",
    )
    allow_overlap: bool = option(
        False, "Allow a task of the sources' file to be source and target.", seldom=True
    )
    evaluate_every: int = option(
        0,
        "Evaluate greedily, without learning, before the first episode and after every N-th; 0: never.",
        low=0,
        metavar="N",
        seldom=True,
    )
    keep_q: bool = option(False, "Keep the learned tables too.", seldom=True)
    blend: Literal["none", "knownness"] = option(
        "none",
        "Act on (1 - k) Q0 + k Q, with Q0 the start and Q learned from a return of 0 (knownness); none: learn from the start.",
        seldom=True,
    )
    known_at: int | None = option(
        None,
        "k is min(1, n / N) after n updates of a state-action, or of a tile's weight.",
        low=1,
        metavar="N",
        default_text=f"{KNOWN_AT}, with --blend knownness",
        seldom=True,
    )

    def __post_init__(self) -> None:
        _read(self)
        check(self)
        if self.known_at is not None and not self.blends:
            raise ValueError(
                "--known-at says how soon a blend gives way; give --blend knownness too, or leave it out"
            )

    @property
    def blends(self) -> bool:
        """Whether the start gives way to learned values."""
        return self.blend != "none"

    @property
    def updates_known(self) -> int | None:
        """Updates after which a blended value is the learned one; None without a blend."""
        return (self.known_at or KNOWN_AT) if self.blends else None

    def learning(self, family: Family, sources: Learning) -> Learning:
        """The family's way of learning targets, with alpha, gamma and horizon of the sources, and what was asked on top."""
        return _learning(family.target_learning, _inherited(sources), self)

    def family(self, sources: Family) -> Family:
        """The sources' family with the shifts made or the targets named; UsageError, one sentence, where they cannot be."""
        changes = dict(_change(sources, text) for text in self.shift or [])
        if fixed := [name for name in ("reward", "returns") if name in changes]:
            raise UsageError(
                f"--shift {fixed[0]}: what sources learned is in the units of their own rewards; "
                f"leave it out, or learn sources with another --{fixed[0]}"
            )
        try:
            changed = sources.shifted(changes) if changes else sources
        except ValueError as error:
            raise UsageError(f"--shift: {error}") from error
        return changed.holding_out(self.targets, allow_overlap=self.allow_overlap)


@dataclass(frozen=True)
class Living:
    """What a finished task leaves to those after it."""

    update: bool = option(
        False,
        "Add the values that a finished task learned to what later tasks start from; else mu and sigma stay as fitted.",
    )
    min_visits: int | None = option(
        None,
        "Add those entries alone that the task visited at least so often: others still hold their start.",
        low=1,
        metavar="N",
        default_text=f"{MIN_VISITS}, with --update",
    )

    def __post_init__(self) -> None:
        check(self)
        if self.min_visits is not None and not self.update:
            raise ValueError(
                "--min-visits says which entries --update adds; give --update too, or leave it out"
            )

    @property
    def visits(self) -> int:
        """Visits from which on an entry is added."""
        return MIN_VISITS if self.min_visits is None else self.min_visits


@dataclass(frozen=True)
class CrossValidating:
    """How sources are learned in the place of targets; what is not given is as for targets."""

    learner: str | Learner = BY
    episodes: int | None = option(
        None, "Episodes of each source, learned as a target is.", low=1, default_text="as targets have"
    )
    alpha: float | str | Schedule | None = ALPHA
    epsilon: float | str | Schedule | None = EPSILON
    explore: str | Exploration | None = EXPLORE
    jobs: int | None = option(
        None, "Sources learned at once.", low=1, high=cores.MOST_JOBS, default_text="all cores", metavar="N"
    )

    def __post_init__(self) -> None:
        _read(self)
        check(self)

    def learning(self, family: Family, sources: Learning) -> Learning:
        """The family's way of learning targets, with alpha, gamma and horizon of the sources, and what was asked on top."""
        return _learning(family.target_learning, _inherited(sources), self)


def _read(asked: Any, *also: str) -> None:
    """Texts become the learner, exploration, schedule or number that they write; ValueError, one sentence, if they write none.

    Names in `also` may stand for a learner, and stay texts.
    """
    readers: dict[str, Callable[[str], Any]] = {
        "learner": lambda text: text if text in also else read(text, LEARNERS, also),
        "explore": lambda text: read(text, EXPLORATIONS),
        "alpha": schedule,
        "epsilon": schedule,
    }
    for name, reader in readers.items():
        if isinstance(text := getattr(asked, name), str):
            try:
                object.__setattr__(asked, name, reader(text))
            except ValueError as error:
                raise ValueError(f"{flag(name)} {error}") from error


def _learning(usual: Learning, inherited: dict[str, Any], asked: Any) -> Learning:
    """The usual way of learning with what is inherited and what was asked put in its place; UsageError where that cannot be."""
    given = {name: value for name in SETTINGS if (value := getattr(asked, name, None)) is not None}
    learner = asked.learner if isinstance(asked.learner, Learner) else usual.learner
    explore = given.get("explore", usual.explore)
    if "alpha" in given and not learner.steps:
        raise UsageError(f"--learner {learner} has no step size; leave out --alpha")
    if "epsilon" in given and not isinstance(explore, EpsilonGreedy):
        raise UsageError(f"--explore {explore} has no epsilon; leave out --epsilon")
    greedy = not (learner.explores or given.keys() & {"epsilon", "explore"})
    if greedy or not isinstance(explore, EpsilonGreedy):
        given["epsilon"] = 0.0
    try:
        return replace(usual, **inherited | given, learner=learner)
    except ValueError as error:
        name = str(error).split()[0]
        if name in inherited and name not in given:
            raise UsageError(f"the sources' {error}; give another --{name}") from error
        raise UsageError(f"--{error}") from error


def _inherited(sources: Learning) -> dict[str, Any]:
    return {name: getattr(sources, name) for name in FROM_SOURCES}


def _change(family: Family, text: str) -> tuple[str, Any]:
    """A field of the family and its new value, from KEY=VALUE."""
    try:
        return setting(text, type(_untiled(family)), family.name)
    except ValueError as error:
        raise UsageError(f"--shift {text}: {error}") from error


def _untiled(family: Family) -> Family:
    """The family whose fields can be shifted: by tiles, the one that is tiled."""
    return family.family if isinstance(family, TiledFamily) else family
