"""`qinit train-sources FAMILY`: learn source tasks."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import TYPE_CHECKING, Any

import typer

from qinit_cli.commands.console import Printed, note
from qinit_cli.commands.option_groups import DISPLAY, IMPORTS, MACHINE, OUTPUT, Display, Group, Output
from qinit_cli.commands.typer_commands import add_command, add_each
from qinit_cli.environments import FAMILIES, Family
from qinit_cli.environments.folds import OF_FILES, each_fold
from qinit_cli.environments.gym import Gym
from qinit_cli.environments.own_tasks import OwnTasks
from qinit_cli.options import check, option
from qinit_cli.pipeline.asked import ALL, LearningSources
from qinit_cli.pipeline.keeping import Keeping
from qinit_cli.pipeline.machine import Machine
from qinit_store.wording import counted, magnitude, plain

if TYPE_CHECKING:
    from qinit_cli.pipeline.job import Made
    from qinit_cli.tasks import SourceTasks


@dataclass(frozen=True)
class Folds:
    """How often tasks of a file are cut into sources and targets."""

    folds: int | None = option(
        None,
        "Make sources for each of N folds: all tasks but those that the fold holds out, as --use fold:1/N to fold:N/N.",
        low=2,
        metavar="N",
        default_text="one artefact, by --use",
    )

    def __post_init__(self) -> None:
        check(self)


ONE_CUT = Folds()


def add_to(families: typer.Typer, only: str | None = None) -> None:
    """Adds one subcommand per family, or that of the `only` name asked for."""
    add_each(families, FAMILIES, _add, only)


def _add(families: typer.Typer, name: str, family: type[Family]) -> None:
    add_command(
        families,
        name,
        partial(train_sources, name),
        {
            "family": Group(family, "Distribution"),
            **({"folds": Group(Folds, "Distribution")} if issubclass(family, OF_FILES) else {}),
            "sources": Group(LearningSources, "Learning", _defaults(family)),
            "output": OUTPUT,
            "machine": MACHINE,
            "display": DISPLAY,
        },
        imports=IMPORTS if issubclass(family, OF_FILES) else None,
        help=family.__doc__ or "",
    )


def _defaults(family: type[Family]) -> dict[str, str]:
    names = ("episodes", "horizon", "alpha", "gamma", "epsilon", "start")
    usual = {name: str(getattr(family.source_learning, name)) for name in names}
    if issubclass(family, OwnTasks):
        others = {name: str(getattr(Gym.source_learning, name)) for name in names}
        usual |= {
            name: f"{usual[name]}, with --env {value}"
            for name, value in others.items()
            if value != usual[name]
        }
    return {"tasks": str(family.source_tasks or ALL), **usual}


def train_sources(
    name: str,
    family: Family,
    sources: LearningSources,
    output: Output,
    machine: Machine,
    display: Display,
    folds: Folds = ONE_CUT,
) -> None:
    """Learns what is missing of the sources asked for, publishes them and prints their path; with folds those of each."""
    from qinit_cli.commands.results import check_one_output, each

    if folds.folds is None:
        _train(family, sources, output, output.keeping, machine, display)
        return
    several = each_fold(family, folds.folds)
    check_one_output(output, several)

    def once(one: Any) -> None:
        keeping = replace(output.keeping, command=_of_fold(output.keeping.command, one.use))
        _train(one, sources, output, keeping, machine, display, f"{one.use}: ")

    each(several, once, fail_fast=machine.fail_fast)


def _of_fold(command: Sequence[str], use: str) -> tuple[str, ...]:
    """The words of a command with --folds as those that make one of its folds."""
    words = [word for word in command if not word.startswith("--folds=")]
    if "--folds" in words:
        del words[words.index("--folds") : words.index("--folds") + 2]
    return (*words, "--use", use)


def _train(
    family: Family,
    sources: LearningSources,
    output: Output,
    keeping: Keeping,
    machine: Machine,
    display: Display,
    told: str = "",
) -> None:
    """Makes one artefact; what is reported of it begins with what is `told`."""
    from qinit_cli.commands.results import say_expected, say_result, warn
    from qinit_cli.environments.family import task_count
    from qinit_cli.pipeline.estimate import expected
    from qinit_cli.pipeline.job import make
    from qinit_cli.pipeline.sources import plan_of, tasks_of

    family = family.opened()
    tasks = tasks_of(family, sources)
    before = family.warning
    if before:
        note(display, f"warning: {before}")
    count = task_count(family, "source", sources.tasks)
    if output.dry_run:
        say_expected(expected(plan_of, tasks, count, keeping, machine), output, display)
        return
    made = make(plan_of(tasks, count), keeping, machine, Printed(display))
    sentence, warnings = f"{counted(made.tally.tasks, 'task')}: already complete", list[str]()
    if not made.complete_before:
        sentence, warnings = _summary(made, tasks)
        warnings += family.beyond if isinstance(family, Gym) else []
    warn(made, before, warnings, display)
    ends = family.ends()
    made.tally.extra |= ends
    if ends:
        sentence += f"; the goal: {ends['goal']}"
    say_result(made, "qinit.train-sources/1", told + sentence, output, display)


def _summary(made: Made, tasks: SourceTasks) -> tuple[str, list[str]]:
    """What was learned and how well, and what makes it worth little; the errors also go into the tally."""
    from qinit_cli.environments.family import draw_tasks
    from qinit_cli.pipeline import source_findings
    from qinit_cli.pipeline.degenerate import SourcesLearned, of_sources
    from qinit_cli.seeding import Stream

    tally = made.tally
    found = source_findings.learned(made.source, tasks)
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
