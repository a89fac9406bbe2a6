"""What a user asks of a stage: each setting once, with its default, range and help, for the library as for the command line."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, Literal, get_args, get_type_hints

from qinit_cli import cores
from qinit_cli.environments import Family
from qinit_cli.errors import UsageError
from qinit_cli.learning import Learning
from qinit_cli.nearest import nearest
from qinit_cli.options import check, flag, option, options

FROM_SOURCES = ("alpha", "gamma", "horizon")  # targets are learned with these settings of the sources
MIN_VISITS = 50  # 0.9^50: half a hundredth of an entry is still its start, at the grid's alpha of 0.1


@dataclass(frozen=True)
class LearningSources:
    """How source tasks are learned; None: as the family has it."""

    tasks: int | None = option(None, "Source tasks.", low=1, metavar="N")
    seed: int = option(0, "Root of all randomness; each task has streams of its own.", low=0)
    learner: Literal["q-learning", "exact"] = option(
        "q-learning", "Tabular Q-learning, or exact tables by value iteration."
    )
    episodes: int | None = option(None, "Episodes of each task.", low=1)
    horizon: int | None = option(None, "Steps after which an episode is cut off.", low=1, seldom=True)
    alpha: float | None = option(None, "Step size.", above=0, high=1, seldom=True)
    gamma: float | None = option(None, "Discount.", above=0, high=1, seldom=True)
    epsilon: float | None = option(None, "Probability that a step explores.", low=0, high=1, seldom=True)
    start: Literal["anywhere", "fixed"] | None = option(
        None, "Where episodes start: anywhere, or where target tasks start.", seldom=True
    )

    def __post_init__(self) -> None:
        check(self)
        idle = [name for name in ("episodes", "epsilon", "start") if getattr(self, name) is not None]
        if self.learner == "exact" and idle:
            raise ValueError(
                f"the exact learner has no episodes, so {flag(idle[0])} means nothing to it; leave it out"
            )

    def learning(self, family: type[Family]) -> Learning:
        """The family's way of learning sources with what was asked put in its place; UsageError where that cannot be."""
        names = ("episodes", "horizon", "alpha", "gamma", "epsilon", "start")
        asked = {name: value for name in names if (value := getattr(self, name)) is not None}
        return _changed(family.source_learning, asked)


@dataclass(frozen=True)
class LearningTargets:
    """How target tasks are learned; None: as the fit's sources or the family have it."""

    tasks: int | None = option(None, "Target tasks.", low=1, metavar="N")
    seed: int = option(
        0, "Root of the targets' randomness: every method meets the same tasks and random streams.", low=0
    )
    episodes: int | None = option(None, "Episodes of each task.", low=1)
    horizon: int | None = option(None, "Steps after which an episode is cut off.", low=1, seldom=True)
    alpha: float | None = option(None, "Step size.", above=0, high=1, seldom=True)
    gamma: float | None = option(None, "Discount.", above=0, high=1, seldom=True)
    epsilon: float | None = option(None, "Probability that a step explores.", low=0, high=1, seldom=True)
    start: Literal["anywhere", "fixed"] | None = option(
        None, "Where episodes start: at the family's target start, or anywhere.", seldom=True
    )
    shift: list[str] | None = option(
        None,
        "Draw targets from a changed family, such as variance=10; may be given several times.",
        metavar="KEY=VALUE",
        seldom=True,
    )
    evaluate_every: int = option(
        0,
        "Evaluate greedily, without learning, before the first episode and after every N-th; 0: never.",
        low=0,
        metavar="N",
        seldom=True,
    )
    keep_q: bool = option(False, "Keep the learned tables too.", seldom=True)

    def __post_init__(self) -> None:
        check(self)

    def learning(self, family: Family, sources: Learning) -> Learning:
        """The family's way of learning targets, with alpha, gamma and horizon of the sources, and what was asked on top."""
        given = {name: getattr(sources, name) for name in FROM_SOURCES}
        names = ("episodes", "horizon", "alpha", "gamma", "epsilon", "start")
        asked = {name: value for name in names if (value := getattr(self, name)) is not None}
        return _changed(family.target_learning, given | asked)

    def family(self, sources: Family) -> Family:
        """The sources' family with the shifts made; UsageError, one sentence, where they cannot be."""
        changes = dict(_change(sources, text) for text in self.shift or [])
        try:
            return sources.shifted(changes) if changes else sources
        except ValueError as error:
            raise UsageError(f"--shift: {error}") from error


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

    episodes: int | None = option(
        None, "Episodes of each source, learned as a target is.", low=1, default_text="as targets have"
    )
    jobs: int | None = option(
        None, "Sources learned at once.", low=1, high=cores.MOST_JOBS, default_text="all cores", metavar="N"
    )

    def __post_init__(self) -> None:
        check(self)

    def learning(self, family: Family, sources: Learning) -> Learning:
        """The family's way of learning targets, with alpha, gamma and horizon of the sources; UsageError where that cannot be."""
        given = {name: getattr(sources, name) for name in FROM_SOURCES}
        asked = {} if self.episodes is None else {"episodes": self.episodes}
        return _changed(family.target_learning, given | asked)


def _changed(usual: Learning, asked: dict[str, Any]) -> Learning:
    try:
        return replace(usual, **asked)
    except ValueError as error:
        raise UsageError(f"--{error}") from error


def _change(family: Family, text: str) -> tuple[str, Any]:
    """A field of the family and its new value, from KEY=VALUE."""
    name, equals, value = text.partition("=")
    name = name.strip().replace("-", "_")
    known = {field.name: get_type_hints(type(family))[field.name] for field in options(type(family))}
    if not equals:
        raise UsageError(f"--shift {text}: write KEY=VALUE, KEY one of {', '.join(sorted(known))}")
    if name not in known:
        raise UsageError(f"--shift {text}: {family.name} has no {name}; {nearest(name, sorted(known))}")
    kinds = get_args(known[name]) or (known[name],)
    for kind in (kind for kind in (int, float) if kind in kinds):
        try:
            return name, kind(value)
        except ValueError as error:
            raise UsageError(f"--shift {text}: {value!r} is no {kind.__name__}") from error
    return name, value
