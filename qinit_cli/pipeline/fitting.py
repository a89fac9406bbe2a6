"""Fitting sources: which of them, the artefact that holds the fit, and making it."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from qinit_cli.artefacts.fit import fit_schema
from qinit_cli.artefacts.fit_columns import fit_statistics
from qinit_cli.artefacts.opening import open_artefact
from qinit_cli.artefacts.settings import FitSettings, SourcesSettings
from qinit_cli.artefacts.sources import Shares, blocks_in_shares
from qinit_cli.artefacts.tile_columns import fit_columns
from qinit_cli.environments import Family
from qinit_cli.environments.family import bounds_of
from qinit_cli.environments.tiled import PROBES, WEIGHTS, TiledFamily
from qinit_cli.errors import NotAllowed
from qinit_cli.fitted import FitOptions, FittedTables, in_returns
from qinit_cli.options import flag
from qinit_cli.pipeline import fit as stage
from qinit_cli.pipeline import fit_statistics as statistics
from qinit_cli.pipeline.fit import Selection
from qinit_cli.pipeline.job import Made, Tally, made
from qinit_cli.pipeline.keeping import LONGEST_STEM, Keeping, target_path, working
from qinit_cli.pipeline.origin import provenance
from qinit_cli.pipeline.reporter import SILENT, Progress, Reporter
from qinit_cli.watch import Watch
from qinit_store.schema import Axis, Schema
from qinit_store.wording import counted

if TYPE_CHECKING:
    from qinit_cli.arrays import Flags
    from qinit_store.held import Held
    from qinit_store.reading import Artefact, Description

FEWEST_SOURCES = 2  # a spread needs two
ENDING = len("-01234567.h5")  # of a name in the store: eight digits of the settings' hash


@dataclass(frozen=True)
class Asked:
    """A fit that is to be made of some sources."""

    family: Family
    stem: str  # of its default name
    settings: FitSettings
    schema: Schema
    selection: Selection
    held: Flags  # (N,) the sources that are held out

    @property
    def count(self) -> int:
        """How many sources are fitted."""
        return int(self.selection.kept.sum())


def look(sources: Description, fitting: FitOptions, keeping: Keeping) -> tuple[Path | None, FitSettings]:
    """Where in the store a fit of these sources stands, None where there is none, and its settings.

    By their description alone, with nothing of the sources read: whoever fits them verifies them.
    """
    settings = FitSettings.of(SourcesSettings.read(sources.spec), sources.content_sha256, fitting)
    label = settings.sources.family.installed(sources.provenance).label
    # how many sources are fitted, which the name has, would take reading them; the hash behind it tells fits apart
    named = target_path(keeping, f"{label}-", settings)
    ending = named.name[-ENDING:]
    beginning = f"{label}-"[:LONGEST_STEM].rstrip("-._")
    there = (path for path in named.parent.glob(f"*{ending}") if path.name.startswith(beginning))
    return min(there, default=None), settings


def asked_of(source: Path | Held, fitting: FitOptions) -> Asked:
    """The fit of these sources, which are verified; NotAllowed where they cannot be fitted."""
    with open_artefact(source, "sources") as sources:
        asked = _asked(sources, fitting)
        sources.check_tasks()
    return asked


def make_fit(
    source: Path | Held, fitting: FitOptions, keeping: Keeping, reporter: Reporter = SILENT
) -> tuple[Made, dict[str, Any], Asked]:
    """The fit of the sources, made if need be, with its arrays by name."""
    with open_artefact(source, "sources") as sources:
        asked = _asked(sources, fitting)
        origin = provenance(keeping.command, source, asked.settings)
        target = target_path(keeping, asked.stem, asked.settings)
        with working(target, asked.schema, asked.settings, keeping, origin) as artefact:
            complete = artefact.complete
            if complete:
                sources.check_tasks()  # which are fitted was read ahead
            else:
                with reporter.progress("fit", 0, sources.task_count, Watch()) as progress:
                    arrays = _arrays(sources, asked, fitting, progress)
                artefact.finish(statics=arrays, provenance=origin, inputs=[_input(sources)])
        tally = Tally(
            tasks=asked.count,
            skipped=asked.count if complete else 0,
            extra={
                "unsolvable": asked.selection.unsolvable,
                "unlearned": asked.selection.unlearned,
                "held_out": int(asked.held.sum()),
            },
        )
        found = made(target, artefact, tally, complete)
    if complete:
        with open_artefact(found.source, "fit") as there:
            arrays = {column.name: there.read(column.name) for column in there.schema.static_columns}
    return found, arrays, asked


def _asked(source: Artefact, fitting: FitOptions) -> Asked:
    """What a fit of these sources is; NotAllowed where they are target tasks, or too few."""
    settings = SourcesSettings.read(source.spec)
    if settings.role != "source":
        raise NotAllowed(
            f"{source.path} holds target tasks, learned for `optimal`; fit sources, or nothing is transferred"
        )
    family = settings.family.installed(source.provenance)
    if fitting.check_theory and family.payment(settings.learning.gamma) is not None:
        raise NotAllowed(
            f"--check-theory is of a reward of 1 at the goal, and steps of {source.path} pay otherwise; leave it out"
        )
    lengths = [
        name for name in ("eopl_normality", "check_theory") if getattr(fitting, name) not in ("none", False)
    ]
    if settings.imported and lengths:
        raise NotAllowed(
            f"{flag(lengths[0])} is of path lengths, which are unknown of the imported tables in {source.path}; leave it out"
        )
    selection, held = stage.hold_out(selection_of(source, family, fitting), fitting.holdout)
    return Asked(
        family,
        f"{family.label}-{int(selection.kept.sum())}-{fitting.estimator}",
        FitSettings.of(settings, source.content_sha256, fitting),
        _schema(source, family, fitting, stage.library_size(selection, fitting)),
        selection,
        held,
    )


def _schema(source: Artefact, family: Family, fitting: FitOptions, library: int) -> Schema:
    """The fit's layout, over the sources' own axes: looking at an environment again would need its module."""
    *states, action = _axes(source)
    state_action = (*(axis.name for axis in states), action.name)
    settings = SourcesSettings.read(source.spec)
    bounds = settings.bounds
    more_axes, more_columns = fit_statistics(statistics.contents(fitting), state_action)
    axes, columns = fit_columns(family, source.axes)
    return fit_schema(
        tuple(states),
        action,
        library,
        (*axes, *more_axes),
        (*columns, *more_columns),
        bounds,
        settings.varied,
        tiled=settings.family.tiled,
    )


def _axes(source: Artefact) -> list[Axis]:
    """The state axes of the sources' tables, and that of the actions."""
    [q] = [column for column in source.schema.columns if column.name == "q"]
    return [source.axes[name] for name in q.dims[1:]]


def _arrays(source: Artefact, asked: Asked, fitting: FitOptions, progress: Progress) -> dict[str, Any]:
    """All that the fit holds, by name; `progress` counts the sources as they are read."""
    family, selection, held = asked.family, asked.selection, asked.held
    sources = asked.settings.sources
    origin = statistics.Origin(family, sources.learning.gamma, sources.seed)
    names = statistics.columns(fitting, family)
    sample = statistics.Sample(selection.kept, origin.seed, names)
    of_tiles = (WEIGHTS,) if sources.family.tiled else ()
    wanted = tuple(dict.fromkeys(("q", "td_var", "eopl", *of_tiles, *names)))
    blocks, bounds = blocks_in_shares(source, wanted, stage.BLOCK), bounds_of(family, origin.gamma)
    read = sample.reading(progress.counting(blocks))
    arrays = stage.fit(read, selection, fitting, estimates=sources.family.tiled)
    arrays = in_returns(arrays, bounds)
    if isinstance(family, TiledFamily):
        arrays[PROBES] = source.read(PROBES)
    arrays |= statistics.statistics(sample.columns, origin, fitting)
    if held.any():
        *states, _ = _axes(source)
        entries = math.prod(len(axis.values) for axis in states)
        fitted = FittedTables.from_arrays(arrays, entries, fitting.estimator, bounds)
        first = int(held.argmax())
        arrays |= statistics.held_out_errors(_rows(source, first), held[first:], fitted, origin)
    return arrays


def _rows(source: Artefact, first: int) -> Iterator[dict[str, Any]]:
    """The tasks from the `first` on, in blocks, with shares in the place of returns."""
    shares = Shares.of(source)
    for start in range(first, source.task_count, stage.BLOCK):
        yield shares.block(source.rows(start, min(start + stage.BLOCK, source.task_count)))


def selection_of(source: Artefact, family: Family, fitting: FitOptions) -> Selection:
    """Which sources are fitted; NotAllowed where they are too few. Read ahead: verified once all rows have been read."""
    columns = family.parameters()
    tasks = np.empty(source.task_count, [(column.name, column.dtype) for column in columns])
    settings = SourcesSettings.read(source.spec)
    found = source.read_ahead(
        [*(column.name for column in columns), *([] if settings.imported else ["solved"])]
    )
    for column in columns:
        tasks[column.name] = found[column.name]
    # which imported tables solve their tasks is unknown: all teach
    solved = np.ones(len(tasks), bool) if settings.imported else found["solved"].astype(bool)
    selection = stage.select(family, tasks, solved, settings.learning.horizon, fitting)
    count = int(selection.kept.sum())
    if count - fitting.holdout < FEWEST_SOURCES:
        source.check_tasks()
        more = "import more tables" if settings.imported else "ask train-sources for more --tasks"
        left_out = f" and --holdout {fitting.holdout} leaves them out" if fitting.holdout else ""
        raise NotAllowed(
            f"{source.path} has {counted(count, 'source')} to fit{left_out} ({selection.unsolvable} cannot be solved, "
            f"{selection.unlearned} {unlearned(settings)}); "
            f"a fit needs at least {FEWEST_SOURCES}: {more}"
        )
    return selection


def bytes_of(schema: Schema) -> int:
    """The fit's size in memory; on disk it is compressed."""
    return sum(
        math.prod(schema.row_shape(column)) * column.little_endian.itemsize
        for column in schema.static_columns
    )


def _input(source: Artefact) -> dict[str, str]:
    return {"role": "sources", "name": source.path.stem, "content_sha256": source.content_sha256}


def unlearned(sources: SourcesSettings) -> str:
    """What is said, behind their number, of sources that could be solved but whose greedy path fails."""
    if sources.learner == "exact":  # there was nothing to learn
        return f"have a best policy that reaches the goal within {sources.learning.horizon} steps less than every other time"
    return "could be solved but were not learned"
