"""`qinit transfer METHOD FIT`: learn target tasks from what a method starts them with."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Any

import typer

from qinit_cli.commands.console import Printed, note
from qinit_cli.commands.option_groups import DISPLAY, IMPORTS, MACHINE, OUTPUT, Display, Group, Output
from qinit_cli.commands.typer_commands import Reference, add_command, add_each
from qinit_cli.environments import FAMILIES, Family
from qinit_cli.methods import METHODS, Method
from qinit_cli.options import option, tunable
from qinit_cli.pipeline.asked import ALL, FROM_SOURCES, LearningTargets
from qinit_cli.pipeline.machine import Machine
from qinit_store.wording import counted, magnitude, noun, plain

if TYPE_CHECKING:
    from pathlib import Path

    from qinit_cli.fitted import FittedTables
    from qinit_cli.learning import Learning
    from qinit_cli.pipeline.beginning import Beginning
    from qinit_cli.pipeline.job import Made, Plan, Tally
    from qinit_cli.pipeline.knowledge import Knowledge
    from qinit_cli.tasks import TargetTasks


@dataclass(frozen=True)
class Tuned:
    """Where a method's parameters may come from."""

    tuned: str | None = option(
        None,
        "Take the parameters that qinit tune chose, and what it was given besides: its artefact.",
        metavar="TUNING",
        default_text="the method's options",
        seldom=True,
    )

    def applied(self, method: Method, output: Output, family: Family) -> tuple[Method, list[dict[str, str]]]:
        """The method with what was chosen, and the choice as an input; UsageError where both set an option."""
        if self.tuned is None:
            return method, []
        from qinit_cli.commands import references
        from qinit_cli.pipeline.tuning import chosen

        tuning = references.one(self.tuned, output.store, output=output.output)
        return chosen(tuning, method, family)


NOT_TUNED = Tuned()


def learning_group() -> Group:
    """How targets are learned, as options."""
    return Group(LearningTargets, "Targets", _defaults())


def add_to(methods: typer.Typer, only: str | None = None) -> None:
    """Adds one subcommand per method, or that of the `only` name asked for."""
    add_each(methods, METHODS, partial(_add, learning_group()), only)


def _add(targets: Group, methods: typer.Typer, name: str, method: type[Method]) -> None:
    add_command(
        methods,
        name,
        transfer,
        {
            "method": Group(method, "Method"),
            **({"tuned": Group(Tuned, "Method")} if tunable(method) else {}),
            "learning": targets,
            "output": OUTPUT,
            "machine": MACHINE,
            "display": DISPLAY,
        },
        imports=IMPORTS,
        references=(
            Reference("fit", "A fit: a path, a name in the store, or - for stdin, which may name several."),
        ),
        help=method.__doc__ or "",
    )


def _defaults() -> dict[str, str]:
    from_family = {
        "tasks": _from_the_family(
            {name: str(family.target_tasks or ALL) for name, family in FAMILIES.items()}
        )
    }
    for setting in ("episodes", "epsilon", "start"):
        values = {name: str(getattr(family.target_learning, setting)) for name, family in FAMILIES.items()}
        from_family[setting] = _from_the_family(values)
    return from_family | dict.fromkeys(FROM_SOURCES, "from the fit")


def _from_the_family(values: dict[str, str]) -> str:
    """A default that each family sets, as the help shows it; `values` by family."""
    several = len(set(values.values())) > 1
    return "from the family: " + (
        ", ".join(f"{name} {value}" for name, value in values.items())
        if several
        else f"each has {next(iter(values.values()))}"
    )


def transfer(
    fit: str,
    method: Method,
    learning: LearningTargets,
    output: Output,
    machine: Machine,
    display: Display,
    tuned: Tuned = NOT_TUNED,
) -> None:
    """Learns what is missing of the targets asked for, publishes the run and prints its path; a run for each fit."""
    from qinit_cli.commands import references
    from qinit_cli.commands.results import check_one_output, each

    paths = references.many([fit], output.store, references.LEARNING, output=output.output)
    check_one_output(output, paths)

    def once(path: Path) -> None:
        _transfer(
            path, method, learning, output, machine, display, tuned, f"{path.stem}: " if paths[1:] else ""
        )

    each(paths, once, fail_fast=machine.fail_fast)


def _transfer(
    path: Path,
    method: Method,
    learning: LearningTargets,
    output: Output,
    machine: Machine,
    display: Display,
    tuned: Tuned,
    told: str,
) -> None:
    """Makes one run; what is reported of it begins with what is `told`."""
    from qinit_cli.artefacts.settings import outdated
    from qinit_cli.commands.results import say_expected, say_result, warn
    from qinit_cli.pipeline.degenerate import of_targets
    from qinit_cli.pipeline.estimate import expected
    from qinit_cli.pipeline.job import make
    from qinit_cli.pipeline.knowledge import Knowledge
    from qinit_cli.pipeline.optimal_tables import beginning_of
    from qinit_cli.pipeline.transfer import learned, plan_of, targets_of

    known = Knowledge.read(path)
    method, choice = tuned.applied(method, output, known.family)
    targets, count = targets_of(method, learning, known.settings.sources)
    _say_overrides(targets.learning, known.settings.sources.learning, display)
    _say_limits(method, known.fit, targets.family, display)
    beginning = beginning_of(
        method, known, targets, count, output.keeping, machine, Printed(display), trial=output.dry_run
    )

    def plan(targets: TargetTasks, count: int) -> Plan:
        return plan_of(method, targets, beginning, count, known, choice)

    if output.dry_run:
        say_expected(expected(plan, targets, count, output.keeping, machine), output, display)
        return
    made = make(plan(targets, count), output.keeping, machine, Printed(display))
    found = learned(made, targets, known.fit)
    unsolvable = found.unsolvable
    made.tally.extra.update(unsolvable=unsolvable)
    if output.json or not made.complete_before:
        made.tally.extra.update(_start_numbers(made, method, beginning, known))
    warn(
        made,
        targets.family.warning,
        [*outdated(known.settings), *of_targets(targets.learning, found)],
        display,
    )
    label = targets.label_of(method)
    already = f"{label}, {counted(made.tally.tasks, 'target')}: already complete"
    sentence = already if made.complete_before else _summary(label, made.tally)
    say_result(made, "qinit.transfer/1", told + sentence, output, display)


def _say_overrides(learning: Learning, sources: Learning, display: Display) -> None:
    for name in FROM_SOURCES:
        if getattr(learning, name) != getattr(sources, name):
            note(
                display,
                f"{name} {getattr(learning, name)}, where the sources were learned with {getattr(sources, name)}",
            )


def _say_limits(method: Method, fit: FittedTables, family: Family, display: Display) -> None:
    if family.warning:
        note(display, f"warning: {family.warning}")
    asked, there = method.library_wanted, len(fit.library_q)
    if asked > there:
        note(display, f"{method.name} was to choose among {asked} sources; this fit keeps {there}")


def _start_numbers(made: Made, method: Method, beginning: Beginning, known: Knowledge) -> dict[str, float]:
    """What was filled and clipped of the start, and the error of its projection onto tiles.

    Of a complete run nothing is made or learned again for it: what a privileged method made is no longer counted.
    """
    from qinit_cli.pipeline.transfer import projected

    if made.complete_before and method.privileged:
        return {}
    initial = beginning.initial
    return {"filled": initial.filled, "clipped": initial.clipped, **projected(made, known.family)}


def _summary(label: str, tally: Tally) -> str:
    filled, clipped, unsolvable = (tally.extra[name] for name in ("filled", "clipped", "unsolvable"))
    learned = tally.tasks - tally.skipped - tally.failed
    sentence = f"{label}: {counted(learned, 'target')} learned"
    sentence += f", {magnitude(tally.steps)} steps in {plain(tally.seconds)} kernel seconds"
    if unsolvable:
        sentence += (
            f"; {counted(unsolvable, 'target')} cannot be solved, and {noun(unsolvable, 'stays', 'stay')}"
        )
    if filled:
        sentence += f"; {counted(filled, 'state-action')} that no source knows {noun(filled, 'was', 'were')} "
        sentence += "filled"
    if clipped:
        sentence += f"; {counted(clipped, 'starting value')} clipped to [0, 1]"
    return sentence + _projected(tally.extra)


def _projected(told: dict[str, Any]) -> str:
    """The error of a start that was projected onto tiles; nothing where it stays a table."""
    if "projection_rms" not in told:
        return ""
    rank = f", of which the probes determine {told['weights_rank']}" if "weights_rank" in told else ""
    return (
        f"; start projected onto {counted(told['weights'], 'weight')} an action{rank} ({told['weights_untouched']} have no probe "
        f"in their tile): error {told['projection_rms']:.2g} (rms), {told['projection_largest']:.2g} at most"
    )
