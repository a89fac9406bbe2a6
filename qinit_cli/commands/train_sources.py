"""`qinit train-sources FAMILY`: learn source tasks."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import partial
from typing import TYPE_CHECKING, Any, Literal

import typer

from qinit_cli.commands.build import Group, add_command, add_each
from qinit_cli.commands.groups import DISPLAY, IMPORTS, OUTPUT, WORK, Display, Output, Work
from qinit_cli.commands.messages import note
from qinit_cli.environments import FAMILIES, Family
from qinit_cli.environments.gym import Gym
from qinit_cli.errors import UsageError
from qinit_cli.fields import check, flag, option
from qinit_cli.learning import Learning
from qinit_store.wording import counted, magnitude, plain

if TYPE_CHECKING:
    from pathlib import Path

    from qinit_cli.arrays import Flags, Floats, Integers
    from qinit_cli.commands.making import Made, Plan
    from qinit_cli.pipeline.sources import SourceTasks

ERROR_TASKS = 1_000  # the summary's error against exact tables is taken over at most this many


@dataclass(frozen=True)
class LearningSources:
    """How source tasks are learned; None: as the family has it."""

    tasks: int | None = option(None, "Source tasks.", low=1, metavar="N")
    seed: int = option(0, "Root of all chance; each task has streams of its own.", low=0)
    learner: Literal["q-learning", "exact"] = option(
        "q-learning", "Tabular Q-learning, or exact tables by value iteration."
    )
    episodes: int | None = option(None, "Episodes of each task.", low=1)
    horizon: int | None = option(None, "Steps after which an episode is cut off.", low=1, seldom=True)
    alpha: float | None = option(None, "Step size.", above=0, high=1, seldom=True)
    gamma: float | None = option(None, "Discount.", above=0, high=1, seldom=True)
    epsilon: float | None = option(None, "Chance that a step explores.", low=0, high=1, seldom=True)
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
        try:
            return replace(family.source_learning, **asked)
        except ValueError as error:
            raise UsageError(f"--{error}") from error


def add_to(families: typer.Typer) -> None:
    """Adds one subcommand per family."""
    add_each(families, FAMILIES, _add)


def _add(families: typer.Typer, name: str, family: type[Family]) -> None:
    add_command(
        families,
        name,
        partial(train_sources, name),
        {
            "family": Group(family, "Distribution"),
            "sources": Group(LearningSources, "Learning", _defaults(family)),
            "output": OUTPUT,
            "work": WORK,
            "display": DISPLAY,
        },
        imports=IMPORTS if issubclass(family, Gym) else None,
        help=family.__doc__ or "",
    )


def _defaults(family: type[Family]) -> dict[str, str]:
    learning = family.source_learning
    names = ("episodes", "horizon", "alpha", "gamma", "epsilon", "start")
    return {"tasks": str(family.source_tasks), **{name: str(getattr(learning, name)) for name in names}}


def train_sources(
    name: str, family: Family, sources: LearningSources, output: Output, work: Work, display: Display
) -> None:
    """Learns what is missing of the sources asked for, publishes them and prints their path."""
    from qinit_cli.commands.dry_run import TRIAL_TASKS, foresee, say_expected, trial_episodes
    from qinit_cli.commands.making import make, say_result, warn

    if isinstance(family, Gym):
        family = family.imported()
    tasks = tasks_of(family, sources)
    before = family.warning
    if before:
        note(display, f"warning: {before}")
    plan = plan_of(tasks, sources.tasks or family.source_tasks)
    if output.dry_run:
        tried = trial_episodes(tasks.learning.episodes)
        trial = plan_of(replace(tasks, learning=replace(tasks.learning, episodes=tried)), TRIAL_TASKS)
        say_expected(foresee(plan, trial, tasks.learning.episodes, tried, output, work), output, display)
        return
    made = make(plan, output, work, display)
    sentence, warnings = f"{counted(made.tally.tasks, 'task')}: already complete", list[str]()
    if not made.complete_before:
        sentence, warnings = _summary(made, tasks)
    warn(made, before, warnings, display)
    ends = family.ends()
    made.tally.extra |= ends
    if ends:
        sentence += f"; the goal: {ends['goal']}"
    say_result(made, "qinit.train-sources/1", sentence, output, display)


def tasks_of(family: Family, sources: LearningSources) -> SourceTasks:
    """The tasks that are asked for; UsageError where the family cannot be learned so."""
    from qinit_cli.pipeline.sources import SourceTasks

    if sources.learner == "exact" and not family.tabular:
        raise UsageError(f"{family.untabled}, so there are no exact tables; leave out --learner exact")
    learning = sources.learning(type(family))
    if refusal := family.refusal(learning):
        raise UsageError(refusal)
    return SourceTasks(family, sources.learner, learning, sources.seed)


def plan_of(tasks: SourceTasks, count: int) -> Plan:
    """The artefact that holds these tasks, learned to the end."""
    from qinit_cli.artefacts import specs
    from qinit_cli.commands.making import Plan
    from qinit_cli.pipeline.sources import learn_sources

    exact = tasks.learner == "exact"
    role = "" if tasks.role == "source" else "-targets"
    return Plan(
        stem=f"{tasks.family.label}{'-exact' if exact else ''}{role}-{count}-seed-{tasks.seed}",
        spec=specs.sources(tasks, count),
        schema=_schema(tasks),
        learn=partial(learn_sources, tasks),
        kernel=f"{tasks.family.name} {'exact tables' if exact else 'sources'}",
        what="sources" if tasks.role == "source" else "optimal tables",
    )


def _schema(tasks: SourceTasks) -> Any:
    from qinit_cli.artefacts.opening import action_axis
    from qinit_store.schema import sources_schema

    return sources_schema(
        tasks.family.axes(), action_axis(tasks.family), tasks.family.parameters(), tasks.bins
    )


def _summary(made: Made, tasks: SourceTasks) -> tuple[str, list[str]]:
    """What was learned and how well, and what makes it worth little; the errors also go into the tally."""
    from qinit_cli.environments.family import draw_tasks
    from qinit_cli.pipeline.degenerate import SourcesLearned, of_sources
    from qinit_cli.seeding import Stream

    tally = made.tally
    found = _learned(made.path, tasks)
    drawn = draw_tasks(tasks.family, tasks.seed, Stream.SOURCE_TASK, found.ids)
    solved, solvable = (
        int(each.sum())
        for each in (found.solved, tasks.family.solvable(drawn, found.solved, tasks.learning.horizon))
    )
    count, learned = len(found.ids), tally.tasks - tally.skipped - tally.failed
    sentence = (
        f"{counted(learned, 'task')} learned, {magnitude(tally.steps)} steps in {plain(tally.seconds)} kernel seconds; "
        f"{solved} of {count} solved"
    )
    if solvable < count:
        sentence += f", {count - solvable} cannot be"
    errors = found.error_numbers() if tasks.learner != "exact" and tasks.family.tabular else {}
    tally.extra |= {"solved": solved, "unsolvable": count - solvable, **errors}
    median = errors.get("median_relative_error")
    warnings = of_sources(
        tasks.learner,
        tasks.learning,
        SourcesLearned(
            tasks=count,
            positive=int(found.positive.sum()),
            solvable=solvable,
            solved=solved,
            least=found.least,
            largest=found.largest,
            steps=tally.steps / learned if learned else 0.0,
            anywhere=not tasks.family.refusal(replace(tasks.learning, start="anywhere")),
            error=math.nan if median is None else median,
        ),
    )
    return sentence + _told(errors), list(warnings)


def _told(errors: dict[str, Any]) -> str:
    """The errors against exact tables in words; nothing where there are none."""
    if not errors:
        return ""
    median, worst = errors["median_relative_error"], errors["worst_median_relative_error"]
    if median is None:
        return "; relative error against exact tables: unknown, as these have no value above 0"
    return (
        f"; relative error against exact tables: median {median:.2%} over {counted(errors['error_tasks'], 'task')}, "
        f"{worst:.2%} in the worst, task {errors['worst_task']}"
    )


@dataclass(frozen=True)
class _Learned:
    """What an artefact of N sources holds, and the first ones' relative errors against exact tables."""

    ids: Integers  # (N,)
    solved: Flags  # (N,)
    positive: Flags  # (N,) whether a value is above 0
    least: float  # of the values above 0; NaN where there are none
    largest: float
    errors: Floats  # (n, S * A), NaN where the exact value is 0; no rows where there are no exact tables, or these are

    def error_numbers(self) -> dict[str, int | float | None]:
        """The errors of the first tasks that have any, None where none has."""
        import numpy as np

        medians = {
            int(task): float(np.median(known))
            for task, row in zip(self.ids, self.errors, strict=False)
            if (known := row[np.isfinite(row)]).size
        }
        worst = max(medians, key=lambda task: medians[task], default=None)
        whole = self.errors[np.isfinite(self.errors)]
        return {
            "error_tasks": len(medians),
            "median_relative_error": float(np.median(whole)) if medians else None,
            "worst_task": worst,
            "worst_median_relative_error": None if worst is None else medians[worst],
        }


def _learned(path: Path, tasks: SourceTasks) -> _Learned:
    import numpy as np

    from qinit_cli.artefacts.opening import open_artefact
    from qinit_cli.environments.family import draw_tasks
    from qinit_cli.pipeline.sources import relative_error
    from qinit_cli.seeding import Stream

    family, left = tasks.family, ERROR_TASKS if tasks.learner != "exact" and tasks.family.tabular else 0
    entries = math.prod(family.shape) * len(family.actions)
    solved, errors = [np.empty(0, np.bool_)], [np.empty((0, entries))]
    least, largest = [np.empty(0)], [np.empty(0)]
    with open_artefact(path, "sources") as artefact:
        for block in artefact.blocks(("solved", "q"), artefact.schema.block_size):
            solved.append(block["solved"].astype(bool))
            q = block["q"].reshape(len(block["q"]), -1, len(family.actions))
            largest.append(q.max(axis=(1, 2)))
            least.append(np.where(q > 0, q, np.inf).min(axis=(1, 2)))
            if left > 0:
                drawn = draw_tasks(family, tasks.seed, Stream.SOURCE_TASK, block["task"][:left])
                error = relative_error(family, tasks.learning.gamma, drawn, q[:left])
                errors.append(error.reshape(len(drawn), entries))
                left -= len(drawn)
        ids = artefact.tasks
    positive = np.concatenate(largest) > 0
    return _Learned(
        ids,
        np.concatenate(solved),
        positive,
        float(np.min(np.concatenate(least)[positive], initial=np.inf)) if positive.any() else math.nan,
        float(np.max(np.concatenate(largest), initial=0.0)) if positive.any() else math.nan,
        np.concatenate(errors),
    )
