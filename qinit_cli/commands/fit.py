"""`qinit fit`: summarise source tasks."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import typer

from qinit_cli.commands.build import Group, Reference, add_command
from qinit_cli.commands.groups import DISPLAY, OUTPUT, Display, Output
from qinit_cli.errors import NotAllowed
from qinit_cli.fitted import FitOptions

if TYPE_CHECKING:
    from qinit_cli.environments import Family
    from qinit_cli.stages.fit import Selection
    from store.reading import Artefact
    from store.schema import Schema

FEWEST_SOURCES = 2  # a spread needs two


def add_to(app: typer.Typer) -> None:
    """Adds the command."""
    add_command(
        app,
        "fit",
        fit,
        {"fitting": Group(FitOptions, "Fit"), "output": OUTPUT, "display": DISPLAY},
        references=(Reference("sources", "Sources: a path, a name in the store, or - for stdin."),),
        help="Fit the sources' values per state-action: moments, log-normal parameters, a library; prints the path.",
    )


def fit(sources: str, fitting: FitOptions, output: Output, display: Display) -> None:
    """Fits the sources, publishes the fit and prints its path."""
    from qinit_cli import specs
    from qinit_cli.commands import references
    from qinit_cli.commands.dry_run import Expected, say_expected
    from qinit_cli.commands.making import Made, Tally, provenance, say_result, target_path
    from qinit_cli.commands.train_sources import action_axis
    from qinit_cli.environments import family_of
    from qinit_cli.stages import fit as stage
    from store.reading import describe, open_artefact
    from store.schema import fit_schema
    from store.work import open_work

    path = references.one(sources, output.store)
    with open_artefact(path, "sources") as source:
        if source.spec["role"] != "source":
            raise NotAllowed(
                f"{path} holds target tasks, learned for `optimal`; fit sources, or nothing is transferred"
            )
        family = family_of(source.spec)
        selection = _selection(source, family, fitting)
        count = int(selection.kept.sum())
        spec = specs.fit(source.spec, [source.content_sha256], fitting)
        library = stage.library_size(selection, fitting)
        schema = fit_schema(family.axes(), action_axis(family), library)
        target = target_path(output, "fit", f"{family.label}-{count}-{fitting.estimator}", spec)
        if output.dry_run:
            say_expected(Expected(str(target), count, 0, 0, 0.0, _bytes(schema)), output, display)
            return
        tally = Tally(
            tasks=count, extra={"unsolvable": selection.unsolvable, "unlearned": selection.unlearned}
        )
        origin = provenance(path)
        with open_work(
            target, schema, spec, force=output.force, wait=output.wait, provenance=origin
        ) as artefact:
            complete = artefact.complete
            sentence = "fit: already complete"
            if not complete:
                blocks = source.blocks(("q", "td_var", "eopl"), stage.BLOCK)
                arrays = stage.fit(blocks, selection, fitting)
                artefact.finish(statics=arrays, provenance=origin, inputs=[_input(source)])
                sentence = _summary(arrays, selection)
    tally.skipped = count if complete else 0
    say_result(
        Made(target, describe(target).content_sha256, tally, complete),
        "qinit.fit/1",
        sentence,
        output,
        display,
    )


def _selection(source: Artefact, family: Family, fitting: FitOptions) -> Selection:
    """Which sources are fitted; NotAllowed where they are too few."""
    import numpy as np

    from qinit_cli.stages.fit import select

    columns = family.parameters()
    tasks = np.empty(source.task_count, [(column.name, column.dtype) for column in columns])
    solved = np.empty(source.task_count, np.bool_)
    first = 0
    for block in source.blocks([*(column.name for column in columns), "solved"], source.schema.block_size):
        rows = slice(first, first + len(block["task"]))
        for column in columns:
            tasks[column.name][rows] = block[column.name]
        solved[rows] = block["solved"]
        first = rows.stop
    horizon = int(source.spec["learning"]["horizon"])
    selection = select(family, tasks, solved, horizon, fitting)
    if (count := int(selection.kept.sum())) < FEWEST_SOURCES:
        raise NotAllowed(
            f"{source.path} has {count} sources to fit ({selection.unsolvable} cannot be solved, {selection.unlearned} "
            f"were not learned); a fit needs at least {FEWEST_SOURCES}: ask train-sources for more --tasks"
        )
    return selection


def _bytes(schema: Schema) -> int:
    """The fit's size in memory; on disk it is compressed."""
    import math

    return sum(
        math.prod(schema.row_shape(column)) * column.little_endian.itemsize
        for column in schema.static_columns
    )


def _input(source: Artefact) -> dict[str, str]:
    return {"role": "sources", "name": source.path.stem, "content_sha256": source.content_sha256}


def _summary(arrays: dict[str, Any], selection: Selection) -> str:
    unknown = int((arrays["n"] == 0).sum())
    masked = int(arrays["n_masked"].sum())
    sentence = (
        f"{int(selection.kept.sum())} sources fitted over {arrays['n'].size} state-actions; {masked} entries masked "
        f"(Q not positive), {unknown} state-actions that no source knows"
    )
    if selection.unsolvable:
        sentence += f"; {selection.unsolvable} sources cannot be solved and are left out"
    if selection.unlearned:
        sentence += f"; {selection.unlearned} could be solved but were not learned"
    return sentence
