"""`qinit tune METHOD SOURCES`: choose a method's parameters by the sources alone.

What has a grid (`option(grid=...)`) varies by default; every other number has one value unless several are given: all
combinations of all of a method's numbers would be hundreds, and the best of them by 100 sources would be the luckiest.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass, field, make_dataclass, replace
from functools import partial
from typing import TYPE_CHECKING, Any, get_type_hints

import typer

from qinit_cli.commands.console import Printed, note
from qinit_cli.commands.option_groups import (
    DISPLAY,
    IMPORTS,
    TABULAR,
    Display,
    Group,
    Output,
    Tabular,
    store_option,
)
from qinit_cli.commands.typer_commands import Reference, add_command, add_each
from qinit_cli.errors import TasksFailed, UsageError
from qinit_cli.methods import METHODS, Method
from qinit_cli.options import flag, help_of, numbers, option, options, tunable
from qinit_cli.pipeline.asked import CrossValidating
from qinit_cli.pipeline.machine import Machine
from qinit_store.wording import counted

if TYPE_CHECKING:
    from qinit_cli.artefacts.choice import Candidate, Choice
    from qinit_cli.pipeline.cross_validation import CrossValidation
    from qinit_cli.pipeline.job import Made, Plan
    from qinit_cli.pipeline.tuning import Grid

SCHEMA = "qinit.tune/1"
TRIAL_CANDIDATES = 6  # of a dry run, evenly among all


@dataclass(frozen=True)
class Kept:
    """Where the choice goes."""

    output: str | None = option(
        None,
        "Write the choice here.",
        short="-o",
        metavar="PATH",
        default_text="a name made of what it is, in the store",
    )
    store: str = store_option()
    force: bool = option(False, "Replace an artefact of that name that has other settings.", seldom=True)
    wait: bool = option(False, "Wait while another process writes the same artefact.", seldom=True)
    dry_run: bool = option(False, "Report what it would take, from a short trial; make nothing.")


def add_to(methods: typer.Typer, only: str | None = None) -> None:
    """Adds one subcommand per method that has parameters to choose, or that of the `only` name asked for."""
    add_each(methods, METHODS, _add, only)


def _add(methods: typer.Typer, name: str, method: type[Method]) -> None:
    if not tunable(method) or method.privileged:
        return
    add_command(
        methods,
        name,
        partial(tune, method),
        {
            "grid": Group(_grid_options(method), "Values to try, each combination of them"),
            "several": Group(
                _number_options(method), "One value of each, or several to try as well (1,3,10)"
            ),
            "fixed": Group(_fixed_options(method), "Method"),
            "validating": Group(
                CrossValidating, "Learning", {"alpha": "from the sources", "epsilon": "as targets have"}
            ),
            "kept": Group(Kept, "Artefact"),
            "tabular": TABULAR,
            "display": DISPLAY,
        },
        imports=IMPORTS,
        references=(Reference("sources", "Sources: a path, a name in the store, or - for stdin."),),
        help=method.__doc__ or "",
    )


def tune(
    kind: type[Method],
    sources: str,
    grid: Any,
    several: Any,
    fixed: Any,
    validating: CrossValidating,
    kept: Kept,
    tabular: Tabular,
    display: Display,
) -> None:
    """Tries every combination on the sources, keeps how each fared, and prints it."""
    from qinit_cli.artefacts.choice import Choice, sentences
    from qinit_cli.artefacts.opening import family_in, open_artefact
    from qinit_cli.artefacts.settings import outdated
    from qinit_cli.commands import references
    from qinit_cli.pipeline.cross_validation import cross_validation_of, plan_of, tried
    from qinit_cli.pipeline.job import make

    path = references.one(sources, kept.store, references.LEARNING, output=kept.output)
    method, values = _asked(kind, grid, several, fixed)
    as_json = tabular.chosen == "json"
    output = Output(kept.output, kept.store, kept.force, kept.wait, kept.dry_run, json=as_json)
    machine = Machine(jobs=validating.jobs)
    with open_artefact(path, "sources") as source:
        candidates = tried(method.on(family_in(source)), values)
        validation = cross_validation_of(source, candidates, validating)
        plan = plan_of(source, method, validation, values)
        if kept.dry_run:
            _say_expected(plan, validation, values, output, machine, display)
            return
        made = make(plan, output.keeping, machine, Printed(display))
    with open_artefact(made.source, "tuning") as artefact:
        choice = Choice.of(artefact)
    _print(choice, made, tabular, display)
    for warning in outdated(plan.settings):
        note(display, f"warning: {warning}")
    for said in sentences(choice, made.path):
        note(display, said)
    if made.tally.failed:
        raise TasksFailed(
            f"{made.tally.failed} of {counted(made.tally.tasks, 'source')} failed; the same command tries them again"
        )


CAPTION = "95 % bootstrap intervals over the sources, uncorrected; the largest of several averages reads a little too high"


def _asked(kind: type[Method], grid: Any, several: Any, fixed: Any) -> tuple[Method, Grid]:
    """The method as it is where nothing varies, and the values to try of what does, in the order of its options."""
    from qinit_cli.pipeline.tuning import with_parameters

    typed = {name: _values(name, text) for name, text in asdict(several).items()}
    alone = {name: values[0] for name, values in typed.items() if len(values) == 1}
    varied = {name: _values(name, text) for name, text in asdict(grid).items()}
    varied |= {name: values for name, values in typed.items() if len(values) > 1}
    try:
        method = with_parameters(kind(**asdict(fixed)), alone)
    except ValueError as error:
        raise UsageError(str(error)) from error
    return method, {one.name: varied[one.name] for one in options(kind) if one.name in varied}


def _say_expected(
    plan: Plan,
    validation: CrossValidation,
    values: Grid,
    output: Output,
    machine: Machine,
    display: Display,
) -> None:
    """What it would take, by a few sources under a few of the candidates, all their episodes."""
    import numpy as np

    from qinit_cli.artefacts.tuning import tuning_schema
    from qinit_cli.commands.results import say_expected
    from qinit_cli.pipeline.estimate import TRIAL_TASKS, foresee

    count = len(validation.candidates)
    some = np.unique(np.linspace(0, count - 1, TRIAL_CANDIDATES).astype(int))
    fewer = replace(validation, candidates=[validation.candidates[place] for place in some])
    usable = np.flatnonzero(validation.fold >= 0)
    trial = replace(
        plan,
        settings=replace(plan.settings, tasks=TRIAL_TASKS),
        schema=tuning_schema(tuple(values), len(some)),
        prepare=lambda: replace(plan.prepared, learn=lambda ids, watch: fewer(usable[ids], watch)),
    )
    episodes = validation.targets.learning.episodes
    expected = foresee(plan, trial, episodes, episodes, output.keeping, machine)
    times = count / len(some)
    say_expected(
        replace(expected, steps=round(expected.steps * times), seconds=expected.seconds * times),
        output,
        display,
    )


def _values(name: str, text: str) -> tuple[float, ...]:
    """The values of a comma-separated list, each once."""
    try:
        return tuple(dict.fromkeys(float(part) for part in text.split(",")))
    except ValueError as error:
        raise UsageError(
            f"{flag(name)} is {text!r}; write numbers with commas between them, such as 0.1,0.3"
        ) from error


def _grid_options(method: type[Method]) -> type[Any]:
    """Each parameter that can be chosen, as an option that takes several values."""
    helps = {one.name: help_of(one) for one in options(method)}
    return make_dataclass(
        f"{method.__name__}Grid",
        [
            (
                name,
                str,
                option(",".join(f"{value:.4g}" for value in values), helps[name], metavar="VALUE,..."),
            )
            for name, values in tunable(method).items()
        ],
        frozen=True,
    )


def _number_options(method: type[Method]) -> type[Any]:
    """Each other number, as an option that takes one value, or several to try."""
    return make_dataclass(
        f"{method.__name__}Numbers",
        [
            (one.name, str, option(repr(one.default), help_of(one), metavar="VALUE[,...]"))
            for one in numbers(method)
            if one.name not in tunable(method)
        ],
        frozen=True,
    )


def _fixed_options(method: type[Method]) -> type[Any]:
    """The method's options that are no numbers, as they are."""
    hints = get_type_hints(method)
    taken = {one.name for one in numbers(method)} | tunable(method).keys()
    return make_dataclass(
        f"{method.__name__}Fixed",
        [
            (one.name, hints[one.name], field(default=one.default, metadata=one.metadata))
            for one in options(method)
            if one.name not in taken
        ],
        frozen=True,
    )


def _print(choice: Choice, made: Made, tabular: Tabular, display: Display) -> None:
    from qinit_cli.artefacts.choice import row
    from qinit_cli.commands.tables import TableColumn, print_table

    columns = [
        *(TableColumn(name, flag(name)) for name in choice.names),
        TableColumn("average", "return", 4, interval=True),
        TableColumn("difference", "minus default", 4, interval=True),
        TableColumn("default"),
        TableColumn("chosen"),
    ]
    worth = choice.worth
    extra = {
        "path": str(made.path),
        "digest": made.digest,
        "method": choice.method,
        "choice": choice.chosen.parameters,
        "worth": {"difference": worth.value, "low": worth.low, "high": worth.high},
        "edges": choice.edges,
    }
    rows = [_for_people(one) if tabular.chosen == "table" else row(one) for one in choice.candidates]
    print_table(SCHEMA, columns, rows, tabular, display, caption=CAPTION, extra=extra)


def _for_people(one: Candidate) -> dict[str, Any]:
    from qinit_cli.artefacts.choice import row

    whole = row(one)
    told = {
        name: int(value) if value.is_integer() else float(f"{value:.6g}")
        for name, value in one.parameters.items()
    }
    nothing = {name: None for name in whole if name.startswith("difference") and one.default}
    marks = {name: "yes" if whole[name] else "" for name in ("default", "chosen")}
    return whole | told | nothing | marks
