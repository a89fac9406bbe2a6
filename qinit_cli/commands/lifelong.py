"""`qinit lifelong METHOD FIT|SOURCES`: target tasks one after another, as algorithm 1 of the paper goes on for ever."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING

import typer

from qinit_cli.commands.console import Printed, note
from qinit_cli.commands.option_groups import DISPLAY, IMPORTS, MACHINE, OUTPUT, Display, Group, Output
from qinit_cli.commands.transfer import learning_group, transfer
from qinit_cli.commands.typer_commands import Reference, add_command, add_each
from qinit_cli.errors import UsageError
from qinit_cli.methods import METHODS, Method
from qinit_cli.pipeline.asked import LearningTargets, Living
from qinit_cli.pipeline.machine import Machine
from qinit_store.wording import counted, magnitude, plain, shell_line

if TYPE_CHECKING:
    from pathlib import Path

    from qinit_cli.pipeline.job import Made, Plan
    from qinit_cli.pipeline.knowledge import Knowledge
    from qinit_cli.tasks import TargetTasks


def add_to(methods: typer.Typer, only: str | None = None) -> None:
    """Adds one subcommand per method, or that of the `only` name asked for."""
    add_each(methods, METHODS, partial(_add, learning_group()), only)


def _add(targets: Group, methods: typer.Typer, name: str, method: type[Method]) -> None:
    add_command(
        methods,
        name,
        lifelong,
        {
            "method": Group(method, "Method"),
            "living": Group(Living, "Lifetime"),
            "learning": targets,
            "output": OUTPUT,
            "machine": MACHINE,
            "display": DISPLAY,
        },
        imports=IMPORTS,
        references=(
            Reference(
                "known", "A fit, or sources to fit first: a path, a name in the store, or - for stdin."
            ),
        ),
        help=method.__doc__ or "",
    )


def lifelong(
    known: str,
    method: Method,
    living: Living,
    learning: LearningTargets,
    output: Output,
    machine: Machine,
    display: Display,
) -> None:
    """Learns what is missing of the lifetime, publishes it as a run and prints its path.

    Without --update no task depends on another: the lifetime is the run that `qinit transfer` makes.
    """
    if living.update:
        _check_alone(method, machine)
    path = _fitted(known, method, learning, output, display)
    if living.update:
        _update(path, method, living, learning, output, machine, display)
    else:
        transfer(str(path), method, learning, output, machine, display)


def _check_alone(method: Method, machine: Machine) -> None:
    """UsageError where tasks of this method cannot add to each other, or not so."""
    from qinit_cli.pipeline.lifelong import check_updates

    check_updates(method)
    if machine.shard is not None or machine.dask is not None:
        raise UsageError(
            "tasks that add to each other are learned one after another, here; leave out --shard and --dask"
        )


def _fitted(known: str, method: Method, learning: LearningTargets, output: Output, display: Display) -> Path:
    """The fit that is named, or that of the sources that are, with the defaults of `qinit fit`.

    What refuses the targets that are asked for refuses them before a fit is written.
    """
    from qinit_cli.artefacts.opening import open_artefact
    from qinit_cli.artefacts.settings import SourcesSettings
    from qinit_cli.commands import references
    from qinit_cli.fitted import FitOptions
    from qinit_cli.pipeline.fitting import make_fit
    from qinit_cli.pipeline.transfer import targets_of
    from qinit_store.reading import describe

    path = references.one(known, output.store, references.LEARNING, output=output.output)
    if describe(path).kind != "sources":
        return path
    with open_artefact(path, "sources") as sources:
        targets, _ = targets_of(method, learning, SourcesSettings.read(sources.spec))
    _ = targets.family.shape  # asks for the module of an environment that is not imported
    if output.dry_run:
        raise UsageError(
            f"--dry-run makes no fit of {path}; {shell_line('qinit', 'fit', path)} does, and its path can stand here"
        )
    keeping = replace(output.keeping, output=None, force=False, command=("fit", str(path)))
    made, _, _ = make_fit(path, FitOptions(), keeping, Printed(display))
    if not made.complete_before:
        note(display, f"fitted: {made.path}")
    return made.path


def _update(
    path: Path,
    method: Method,
    living: Living,
    learning: LearningTargets,
    output: Output,
    machine: Machine,
    display: Display,
) -> None:
    from qinit_cli.artefacts.settings import outdated
    from qinit_cli.commands.results import say_expected, say_result, warn
    from qinit_cli.pipeline.degenerate import of_targets
    from qinit_cli.pipeline.estimate import expected
    from qinit_cli.pipeline.job import make
    from qinit_cli.pipeline.knowledge import Knowledge
    from qinit_cli.pipeline.lifelong import lifetime_plan
    from qinit_cli.pipeline.transfer import learned, targets_of

    if (machine.jobs or 1) > 1:
        note(display, "tasks that add to each other are learned one after another, whatever --jobs says")
    fitted = Knowledge.read(path)
    targets, count = targets_of(method, replace(learning, keep_q=True), fitted.settings.sources)
    targets = replace(targets, keep_visits=True)
    if targets.family != fitted.family:
        note(
            display,
            "warning: the targets are of a changed family; --update mixes them into what is known of the sources'",
        )

    def plan(targets: TargetTasks, count: int) -> Plan:
        return lifetime_plan(method, living, targets, count, fitted)

    alone = replace(
        machine, jobs=1, fail_fast=True
    )  # what comes after a task that failed needs what it learned
    if output.dry_run:
        say_expected(expected(plan, targets, count, output.keeping, alone), output, display)
        return
    made = make(plan(targets, count), output.keeping, alone, Printed(display))
    sentence = _summary(made, targets.label_of(method), fitted)
    found = of_targets(targets.learning, learned(made, targets, fitted.fit))
    warn(made, "", [*outdated(fitted.settings), *found], display)
    say_result(made, "qinit.lifelong/1", sentence, output, display)


def _summary(made: Made, label: str, fitted: Knowledge) -> str:
    """What was lived, and how the spread of ln Q moved; also into the tally."""
    from qinit_cli.artefacts.opening import open_artefact
    from qinit_cli.pipeline.lifelong import Known, log_std

    with open_artefact(made.source, "run") as artefact:
        added, spread = artefact.read("added"), artefact.read("log_std")
    before, after = log_std(Known.of(fitted.fit).log_q), float(spread[-1])
    tally = made.tally
    tally.extra.update(added=int(added.sum()), log_std_fitted=before, log_std=after)
    learned = tally.tasks - tally.skipped - tally.failed
    lived = (
        f"{counted(len(added), 'task')}: already complete"
        if made.complete_before
        else f"{counted(learned, 'target')} learned one after another, {magnitude(tally.steps)} steps "
        f"in {plain(tally.seconds)} kernel seconds"
    )
    return (
        f"{label} updated: {lived}; {counted(round(added.mean()), 'entry', 'entries')} added a task; "
        f"sd(ln Q) {after:.3f}, as fitted {before:.3f} (medians over state-actions)"
    )
