"""`qinit tune METHOD SOURCES`: choose a method's parameters by the sources alone."""

from __future__ import annotations

from dataclasses import asdict, dataclass, field, make_dataclass, replace
from functools import partial
from typing import TYPE_CHECKING, Any, get_type_hints

import typer

from qinit_cli.commands.build import Group, Reference, add_command, add_each
from qinit_cli.commands.groups import DISPLAY, TABULAR, Display, Output, Tabular, Work, store_option
from qinit_cli.commands.messages import note
from qinit_cli.errors import NotAllowed, TasksFailed, UsageError
from qinit_cli.fields import check, flag, option, options, tunable
from qinit_cli.methods import METHODS, Method

if TYPE_CHECKING:
    from pathlib import Path

    from qinit_cli.commands.making import Plan
    from qinit_cli.stages.tuning import Candidate, Grid, Rehearsal
    from store.reading import Artefact

SCHEMA = "qinit.tune/1"
MOST_CANDIDATES = 2_000


@dataclass(frozen=True)
class Rehearsing:
    """How sources are learned in the place of targets; what is not given is as for targets."""

    episodes: int | None = option(
        None, "Episodes of each source, learned as a target is.", low=1, default_text="as targets have"
    )
    jobs: int | None = option(None, "Sources learned at once.", low=1, default_text="all cores", metavar="N")

    def __post_init__(self) -> None:
        check(self)


@dataclass(frozen=True)
class Keeping:
    """Where the choice goes."""

    output: str | None = option(
        None,
        "Write the choice here.",
        short="-o",
        metavar="PATH",
        default_text="a name made of what it is, in the store",
    )
    store: str = store_option()
    force: bool = option(False, "Replace an artefact of that name that has other settings.")
    wait: bool = option(False, "Wait while another process writes the same artefact.")


def add_to(methods: typer.Typer) -> None:
    """Adds one subcommand per method that has parameters to choose."""
    add_each(methods, METHODS, _add)


def _add(methods: typer.Typer, name: str, method: type[Method]) -> None:
    if not tunable(method):
        return
    add_command(
        methods,
        name,
        partial(tune, method),
        {
            "grid": Group(_grid_options(method), "Values to try, each combination of them"),
            "fixed": Group(_fixed_options(method), "Method"),
            "rehearsing": Group(Rehearsing, "Learning"),
            "keeping": Group(Keeping, "Artefact"),
            "tabular": TABULAR,
            "display": DISPLAY,
        },
        references=(Reference("sources", "Sources: a path, a name in the store, or - for stdin."),),
        help=method.__doc__ or "",
    )


def tunable_methods() -> dict[str, type[Method]]:
    """The methods that have parameters to choose."""
    return {name: method for name, method in METHODS.items() if tunable(method)}


def tune(
    kind: type[Method],
    sources: str,
    grid: Any,
    fixed: Any,
    rehearsing: Rehearsing,
    keeping: Keeping,
    tabular: Tabular,
    display: Display,
) -> None:
    """Tries every combination on the sources, keeps how each fared, and prints it."""
    from qinit_cli.commands import references
    from qinit_cli.commands.making import make
    from qinit_cli.commands.tables import TableColumn, print_table
    from qinit_cli.stages import tuning
    from store.reading import open_artefact

    path = references.one(sources, keeping.store, "qinit_cli.kernels.batch")
    method = kind(**asdict(fixed))
    values = {name: _numbers(name, text) for name, text in asdict(grid).items()}
    tried = _candidates(method, values)
    output = Output(keeping.output, keeping.store, keeping.force, keeping.wait)
    with open_artefact(path, "sources") as source:
        plan = _plan(source, tried, values, rehearsing)
        made = make(plan, output, Work(jobs=rehearsing.jobs), display)
    with open_artefact(made.path, "tuning") as artefact:
        parameters = {name: artefact.read(name) for name in values}
        judged = tuning.judged(artefact.read("average"), parameters, int(artefact.spec["seed"]))
    columns = [
        *(TableColumn(name, flag(name)) for name in values),
        TableColumn("average", "return", 4, interval=True),
        TableColumn("difference", "minus default", 4, interval=True),
        TableColumn("default"),
        TableColumn("chosen"),
    ]
    chosen = next(one for one in judged if one.chosen)
    extra = {
        "path": str(made.path),
        "digest": made.digest,
        "method": method.name,
        "choice": chosen.parameters,
    }
    rows = [_row(one, tabular.chosen == "table") for one in judged]
    print_table(SCHEMA, columns, rows, tabular, display, caption=CAPTION, extra=extra)
    note(display, _sentence(method, chosen, made.path))
    if made.tally.failed:
        raise TasksFailed(
            f"{made.tally.failed} of {made.tally.tasks} sources failed; the same command tries them again"
        )


CAPTION = "95 % bootstrap intervals over the sources, uncorrected; the largest of several averages reads a little too high"


def _candidates(method: Method, values: Grid) -> list[Method]:
    from qinit_cli.stages.tuning import candidates, with_parameters

    try:
        typed = {
            name: tuple(getattr(with_parameters(method, {name: value}), name) for value in several)
            for name, several in values.items()
        }
        tried = candidates(method, typed)
    except ValueError as error:
        raise UsageError(str(error)) from error
    if len(tried) > MOST_CANDIDATES:
        raise UsageError(
            f"these are {len(tried)} combinations; at most {MOST_CANDIDATES} are tried at once, give fewer values"
        )
    return tried


def _plan(source: Artefact, tried: list[Method], values: Grid, rehearsing: Rehearsing) -> Plan:
    """The artefact of how every candidate fares on every source."""
    from qinit_cli import specs
    from qinit_cli.commands.making import Plan
    from qinit_cli.stages.tuning import parameters_of
    from store.schema import tuning_schema

    rehearsal = _rehearsal(source, tried, rehearsing)
    family = rehearsal.targets.family
    spec = specs.tuning(
        tried[0], values, rehearsal.targets, source.spec, source.content_sha256, source.task_count
    )
    return Plan(
        stem=f"{family.label}-{tried[0].name}-{source.task_count}",
        spec=spec,
        schema=tuning_schema(tuple(values), len(tried)),
        learn=rehearsal,
        compiled=f"{family.name}-targets-{tried[0].name}",
        what=f"{len(tried)} candidates",
        read=source.path,
        inputs=[{"role": "sources", "name": source.path.stem, "content_sha256": source.content_sha256}],
        statics=parameters_of(tried, tuple(values)),
    )


def _rehearsal(source: Artefact, tried: list[Method], rehearsing: Rehearsing) -> Rehearsal:
    """The learner, with a fit of all other sources for each fold."""
    import numpy as np

    from qinit_cli.commands.fit import selection_of
    from qinit_cli.environments import family_of
    from qinit_cli.fitted import Fit, FitOptions
    from qinit_cli.stages import fit as stage
    from qinit_cli.stages.transfer import STAND_INS, TargetTasks
    from qinit_cli.stages.tuning import FOLDS, Rehearsal, folds

    family, fitting = family_of(source.spec), FitOptions()
    selection = selection_of(source, family, fitting)
    if int(selection.kept.sum()) < 2 * FOLDS:
        raise NotAllowed(
            f"{source.path} has {int(selection.kept.sum())} sources to learn from; tune needs at least {2 * FOLDS}: "
            "ask train-sources for more --tasks"
        )
    fold = folds(selection.kept)
    states = int(np.prod(family.shape))
    fits = []
    for number in range(FOLDS):
        others = replace(selection, kept=selection.kept & (fold != number))
        blocks = source.blocks(("q", "td_var", "eopl"), stage.BLOCK)
        fits.append(Fit.from_arrays(stage.fit(blocks, others, fitting), states, fitting.estimator))
    sources = source.spec["learning"]
    given = {name: sources[name] for name in ("alpha", "gamma", "horizon")}
    episodes = {} if rehearsing.episodes is None else {"episodes": rehearsing.episodes}
    learning = replace(family.target_learning, **(given | episodes))
    targets = TargetTasks(family, learning, int(source.spec["seed"]), False, streams=STAND_INS)
    return Rehearsal(targets, tried, fits, fold)


def _numbers(name: str, text: str) -> tuple[float, ...]:
    """The values of a comma-separated list, each once."""
    try:
        return tuple(dict.fromkeys(float(part) for part in text.split(",")))
    except ValueError as error:
        raise UsageError(
            f"{flag(name)} is {text!r}; write numbers with commas between them, such as 0.1,0.3"
        ) from error


def _grid_options(method: type[Method]) -> type[Any]:
    """Each parameter that can be chosen, as an option that takes several values."""
    told = {one.name: one.metadata["help"] for one in options(method)}
    return make_dataclass(
        f"{method.__name__}Grid",
        [
            (name, str, option(",".join(f"{value:.4g}" for value in values), told[name], metavar="VALUE,..."))
            for name, values in tunable(method).items()
        ],
        frozen=True,
    )


def _fixed_options(method: type[Method]) -> type[Any]:
    """The method's other options, as they are."""
    hints = get_type_hints(method)
    return make_dataclass(
        f"{method.__name__}Fixed",
        [
            (one.name, hints[one.name], field(default=one.default, metadata=one.metadata))
            for one in options(method)
            if one.name not in tunable(method)
        ],
        frozen=True,
    )


def _row(one: Candidate, for_people: bool) -> dict[str, Any]:
    return {
        **{name: float(f"{value:.6g}") if for_people else value for name, value in one.parameters.items()},
        "average": one.average,
        "average_low": one.low,
        "average_high": one.high,
        "difference": one.difference,
        "difference_low": one.difference_low,
        "difference_high": one.difference_high,
        "default": ("yes" if one.default else "") if for_people else one.default,
        "chosen": ("yes" if one.chosen else "") if for_people else one.chosen,
    }


def _sentence(method: Method, chosen: Candidate, path: Path) -> str:
    told = " ".join(f"{flag(name)} {value:g}" for name, value in chosen.parameters.items())
    return (
        f"{method.name}: {told} is chosen, {chosen.difference:+.4f} [{chosen.difference_low:.4f}, "
        f"{chosen.difference_high:.4f}] to the default; qinit transfer {method.name} FIT --tuned {path} takes it"
    )
