"""`qinit fit`: summarise source tasks."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import typer

from qinit_cli.commands.build import Group, Reference, add_command
from qinit_cli.commands.groups import DISPLAY, OUTPUT, Display, Output
from qinit_cli.errors import NotAllowed
from qinit_cli.fitted import FitOptions

if TYPE_CHECKING:
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
    from qinit_cli.stages import fit as stage
    from store.reading import describe, open_artefact
    from store.schema import fit_schema
    from store.work import open_work

    path = references.one(sources, output.store)
    with open_artefact(path, "sources") as source:
        count = source.task_count
        if count < FEWEST_SOURCES:
            raise NotAllowed(
                f"{path} holds {count} source task; a fit needs at least {FEWEST_SOURCES}: ask for more with --tasks"
            )
        family = specs.family_of(source.spec)
        spec = specs.fit(source.spec, [source.content_sha256], fitting)
        schema = fit_schema(family.axes(), action_axis(family), min(count, fitting.library))
        target = target_path(output, "fit", f"{family.label}-{count}-{fitting.estimator}", spec)
        if output.dry_run:
            say_expected(Expected(str(target), count, 0, 0, 0.0, _bytes(schema)), output, display)
            return
        origin = provenance(path)
        with open_work(
            target, schema, spec, force=output.force, wait=output.wait, provenance=origin
        ) as artefact:
            tally = Tally(tasks=count, skipped=count if artefact.complete else 0)
            sentence = "fit: already complete"
            if not artefact.complete:
                blocks = source.blocks(("q", "td_var", "eopl"), stage.BLOCK)
                arrays = stage.fit(blocks, count, fitting)
                artefact.finish(statics=arrays, provenance=origin, inputs=[_input(source)])
                sentence = _summary(arrays, count)
    made = Made(target, describe(target).content_sha256, tally, artefact.complete)
    say_result(made, "qinit.fit/1", sentence, output, display)


def _bytes(schema: Schema) -> int:
    """The fit's size in memory; on disk it is compressed."""
    import math

    return sum(
        math.prod(schema.row_shape(column)) * column.little_endian.itemsize
        for column in schema.static_columns
    )


def _input(source: Artefact) -> dict[str, str]:
    return {"role": "sources", "name": source.path.stem, "content_sha256": source.content_sha256}


def _summary(arrays: dict[str, Any], count: int) -> str:
    unknown = int((arrays["n"] == 0).sum())
    masked = int(arrays["n_masked"].sum())
    return (
        f"{count} sources fitted over {arrays['n'].size} state-actions; {masked} entries masked (Q not positive), "
        f"{unknown} state-actions that no source knows"
    )
