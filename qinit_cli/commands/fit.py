"""`qinit fit`: summarise source tasks."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import typer

from qinit_cli.commands.build import Group, Reference, add_command
from qinit_cli.commands.groups import DISPLAY, IMPORTS, ONE_PASS, OUTPUT, Display, OnePass, Output
from qinit_cli.commands.messages import Progress
from qinit_cli.errors import NotAllowed
from qinit_cli.fitted import FitOptions
from qinit_store.wording import counted

if TYPE_CHECKING:
    from pathlib import Path

    from qinit_cli.arrays import Flags
    from qinit_cli.commands.making import Bar, Made
    from qinit_cli.environments import Family
    from qinit_cli.pipeline.fit import Selection
    from qinit_store.reading import Artefact
    from qinit_store.schema import Axis, Schema

FEWEST_SOURCES = 2  # a spread needs two


def add_to(app: typer.Typer) -> None:
    """Adds the command."""
    add_command(
        app,
        "fit",
        fit,
        {"fitting": Group(FitOptions, "Fit"), "output": OUTPUT, "one_pass": ONE_PASS, "display": DISPLAY},
        imports=IMPORTS,
        references=(Reference("sources", "Sources: a path, a name in the store, or - for stdin."),),
        help="Fit the sources' values per state-action: moments, log-normal parameters, a library; prints the path.",
    )


def fit(sources: str, fitting: FitOptions, output: Output, one_pass: OnePass, display: Display) -> None:
    """Fits the sources, publishes the fit and prints its path."""
    from qinit_cli.artefacts.fit_findings import findings
    from qinit_cli.artefacts.opening import open_artefact
    from qinit_cli.artefacts.specs import outdated
    from qinit_cli.commands import references
    from qinit_cli.commands.dry_run import Expected, say_expected
    from qinit_cli.commands.fit_statistics import lines
    from qinit_cli.commands.making import provenance, say_result, target_path, warn
    from qinit_cli.pipeline.degenerate import of_fit

    path = references.one(sources, output.store, "scipy.special", output=output.output)
    if output.dry_run:
        with open_artefact(path, "sources") as source:
            asked = _asked(source, fitting)
            source.check_tasks()
        target = target_path(output, "fit", asked.stem, asked.spec)
        say_expected(Expected(str(target), asked.count, 0, 0, 0.0, _bytes(asked.schema)), output, display)
        return
    made, arrays, asked = make_fit(path, fitting, output, provenance(path), display)
    names = {axis.name: axis.values for axis in asked.schema.axes}
    found = findings(arrays | names, asked.spec)
    sentence = "fit: already complete" if made.complete_before else _summary(arrays, asked)
    made.tally.extra["statistics"] = found
    warn(made, "", [*outdated(asked.spec), *of_fit(asked.spec, arrays)], display)
    say_result(made, "qinit.fit/1", sentence, output, display, further=lines(found))


@dataclass(frozen=True)
class Asked:
    """A fit that is to be made of some sources."""

    family: Family
    stem: str  # of its default name
    spec: dict[str, Any]
    schema: Schema
    selection: Selection
    held: Flags  # (N,) the sources that are held out

    @property
    def count(self) -> int:
        """How many sources are fitted."""
        return int(self.selection.kept.sum())


def place(path: Path, fitting: FitOptions, output: Output) -> tuple[Path, dict[str, Any]]:
    """Where the fit of the sources at `path` goes, and its spec."""
    from qinit_cli.artefacts.opening import open_artefact
    from qinit_cli.commands.making import target_path

    with open_artefact(path, "sources") as source:
        asked = _asked(source, fitting)
        source.check_tasks()
    return target_path(output, "fit", asked.stem, asked.spec), asked.spec


def make_fit(
    path: Path,
    fitting: FitOptions,
    output: Output,
    origin: dict[str, str],
    display: Display,
    bar: Bar = Progress,
) -> tuple[Made, dict[str, Any], Asked]:
    """The fit of the sources at `path`, made if need be, with its arrays by name; `origin` is its provenance."""
    from qinit_cli.artefacts.opening import open_artefact
    from qinit_cli.artefacts.specs import plug_ins
    from qinit_cli.commands.making import Made, Tally, target_path
    from qinit_cli.watch import Watch
    from qinit_store.reading import describe
    from qinit_store.work import open_work

    with open_artefact(path, "sources") as source:
        asked = _asked(source, fitting)
        origin = origin | plug_ins(asked.spec)
        target = target_path(output, "fit", asked.stem, asked.spec)
        with open_work(
            target, asked.schema, asked.spec, force=output.force, wait=output.wait, provenance=origin
        ) as artefact:
            complete = artefact.complete
            if complete:
                source.check_tasks()  # which are fitted was read ahead
            else:
                with bar(display, "fit", 0, source.task_count, Watch()) as progress:
                    arrays = _arrays(source, asked, fitting, progress)
                artefact.finish(statics=arrays, provenance=origin, inputs=[_input(source)])
    if complete:
        with open_artefact(target, "fit") as made:
            arrays = {column.name: made.read(column.name) for column in made.schema.static_columns}
    tally = Tally(
        tasks=asked.count,
        skipped=asked.count if complete else 0,
        extra={
            "unsolvable": asked.selection.unsolvable,
            "unlearned": asked.selection.unlearned,
            "held_out": int(asked.held.sum()),
        },
    )
    return Made(target, describe(target).content_sha256, tally, complete), arrays, asked


def _asked(source: Artefact, fitting: FitOptions) -> Asked:
    """What a fit of these sources is; NotAllowed where they are target tasks, or too few."""
    from qinit_cli.environments import family_of
    from qinit_cli.pipeline import fit as stage

    # artefacts of the first version have no role: there were no others
    if source.spec.get("role", "source") != "source":
        raise NotAllowed(
            f"{source.path} holds target tasks, learned for `optimal`; fit sources, or nothing is transferred"
        )
    family = family_of(source.spec, source.provenance)
    selection, held = stage.hold_out(selection_of(source, family, fitting), fitting.holdout)
    return Asked(
        family,
        f"{family.label}-{int(selection.kept.sum())}-{fitting.estimator}",
        _spec(source, fitting),
        _schema(source, fitting, stage.library_size(selection, fitting)),
        selection,
        held,
    )


def _spec(source: Artefact, fitting: FitOptions) -> dict[str, Any]:
    """The fit's spec; the starts that are judged are those of the methods there are."""
    from qinit_cli.artefacts import specs
    from qinit_cli.methods.plus import initialisations

    spec = specs.fit(source.spec, [source.content_sha256], fitting)
    return spec | {"initialisations": list(initialisations())} if fitting.holdout else spec


def _schema(source: Artefact, fitting: FitOptions, library: int) -> Schema:
    """The fit's layout, over the sources' own axes: looking at an environment again would need its module."""
    from qinit_cli.pipeline.fit_statistics import contents
    from qinit_store.fit_statistics import fit_statistics
    from qinit_store.schema import fit_schema

    *states, action = _axes(source)
    state_action = (*(axis.name for axis in states), action.name)
    return fit_schema(tuple(states), action, library, *fit_statistics(contents(fitting), state_action))


def _axes(source: Artefact) -> list[Axis]:
    """The state axes of the sources' tables, and that of the actions."""
    [q] = [column for column in source.schema.columns if column.name == "q"]
    return [source.axes[name] for name in q.dims[1:]]


def _arrays(source: Artefact, asked: Asked, fitting: FitOptions, progress: Progress) -> dict[str, Any]:
    """All that the fit holds, by name; `progress` counts the sources as they are read."""
    from qinit_cli.fitted import Fit
    from qinit_cli.pipeline import fit as stage
    from qinit_cli.pipeline import fit_statistics

    family, selection, held = asked.family, asked.selection, asked.held
    origin = fit_statistics.Origin(family, float(source.spec["learning"]["gamma"]), int(source.spec["seed"]))
    names = fit_statistics.columns(fitting, family)
    sample = fit_statistics.Sample(selection.kept, origin.seed, names)
    blocks = source.blocks(dict.fromkeys(("q", "td_var", "eopl", *names)), stage.BLOCK)
    arrays = stage.fit(sample.reading(progress.counting(blocks)), selection, fitting)
    arrays |= fit_statistics.statistics(sample.columns, origin, fitting)
    if held.any():
        *states, _ = _axes(source)
        fitted = Fit.from_arrays(arrays, math.prod(len(axis.values) for axis in states), fitting.estimator)
        first = int(held.argmax())
        arrays |= fit_statistics.held_out_errors(_rows(source, first), held[first:], fitted, origin)
    return arrays


def _rows(source: Artefact, first: int) -> Iterator[dict[str, Any]]:
    """The tasks from the `first` on, in blocks."""
    from qinit_cli.pipeline.fit import BLOCK

    for start in range(first, source.task_count, BLOCK):
        yield source.rows(start, min(start + BLOCK, source.task_count))


def selection_of(source: Artefact, family: Family, fitting: FitOptions) -> Selection:
    """Which sources are fitted; NotAllowed where they are too few. Read ahead: verified once all rows have been read."""
    import numpy as np

    from qinit_cli.pipeline.fit import select

    columns = family.parameters()
    tasks = np.empty(source.task_count, [(column.name, column.dtype) for column in columns])
    found = source.read_ahead([*(column.name for column in columns), "solved"])
    for column in columns:
        tasks[column.name] = found[column.name]
    horizon = int(source.spec["learning"]["horizon"])
    selection = select(family, tasks, found["solved"].astype(bool), horizon, fitting)
    count = int(selection.kept.sum())
    if count - fitting.holdout < FEWEST_SOURCES:
        source.check_tasks()
        left_out = f" and --holdout {fitting.holdout} leaves them out" if fitting.holdout else ""
        raise NotAllowed(
            f"{source.path} has {counted(count, 'source')} to fit{left_out} ({selection.unsolvable} cannot be solved, "
            f"{selection.unlearned} "
            f"{_unlearned(source.spec)}); a fit needs at least {FEWEST_SOURCES}: ask train-sources for more --tasks"
        )
    return selection


def _bytes(schema: Schema) -> int:
    """The fit's size in memory; on disk it is compressed."""
    return sum(
        math.prod(schema.row_shape(column)) * column.little_endian.itemsize
        for column in schema.static_columns
    )


def _input(source: Artefact) -> dict[str, str]:
    return {"role": "sources", "name": source.path.stem, "content_sha256": source.content_sha256}


def _summary(arrays: dict[str, Any], asked: Asked) -> str:
    selection = asked.selection
    unknown = int((arrays["n"] == 0).sum())
    masked = int(arrays["n_masked"].sum())
    sentence = (
        f"{counted(int(selection.kept.sum()), 'source')} fitted over {counted(arrays['n'].size, 'state-action')}; "
        f"{counted(masked, 'entry', 'entries')} masked (Q not positive), {counted(unknown, 'state-action')} that no source knows"
    )
    if selection.unsolvable:
        sentence += f"; {counted(selection.unsolvable, 'source')} that cannot be solved left out"
    if selection.unlearned:
        sentence += f"; {selection.unlearned} {_unlearned(asked.spec['sources'])}"
    return sentence


def _unlearned(sources: Mapping[str, Any]) -> str:
    """What is said, behind their number, of sources that could be solved but whose greedy path fails."""
    if sources["learner"] == "exact":  # there was nothing to learn
        horizon = sources["learning"]["horizon"]
        return f"have a best policy that reaches the goal within {horizon} steps less than every other time"
    return "could be solved but were not learned"
