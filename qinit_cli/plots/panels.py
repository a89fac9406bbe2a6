"""The tables that heatmaps show, as fits and runs hold them, reduced over the actions."""

from __future__ import annotations

import difflib
import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from qinit_cli.artefacts.settings import FitSettings, RunSettings, SourceSet
from qinit_cli.artefacts.slices import GridSlice, Slice, slice_of
from qinit_cli.comparison.distinctions import distinctions, with_words
from qinit_cli.environments.tiled import TiledFamily
from qinit_cli.errors import NotAllowed, UsageError
from qinit_cli.methods import METHODS
from qinit_cli.methods.method import Initialisation
from qinit_cli.plots.names import marked

if TYPE_CHECKING:
    from qinit_cli.arrays import Flags, Floats, Integers
    from qinit_cli.environments import Family
    from qinit_cli.methods import Method
    from qinit_store.reading import Artefact

START_LABEL = "initial value, largest over actions (discounted return)"


@dataclass(frozen=True)
class Panels:
    """One column of panels: what comes of one fit."""

    family: Family
    fit: str  # its content hash
    settings: FitSettings | SourceSet  # its settings, as far as they are known
    label: str  # what the tables hold, with its unit
    shown: Slice  # of the states
    tables: dict[str, Floats]  # over its axes, by method, or by the quantity's name
    runs: dict[str, RunSettings] = field(default_factory=dict)  # the settings of the runs that brought tables


def read_panels(
    paths: Sequence[Path], methods: Sequence[str] | None, quantity: str, fixed: Sequence[str] = ()
) -> tuple[list[Panels], list[str]]:
    """The panels of each fit and of the runs that started from it, in the order of the artefacts; and what was left out.

    State axes are `fixed`, see artefacts.slices. UsageError for methods that have no start in a fit; NotAllowed where an artefact
    does not hold what is asked for.
    """
    from qinit_store.reading import describe

    chosen = _methods(methods)
    found: dict[str, Panels] = {}
    notes: list[str] = []
    kinds = [describe(path).kind for path in paths]
    if methods and "fit" not in kinds:
        raise UsageError("--method draws starts from fits, and none is given; runs bring their own start")
    for path, kind in zip(paths, kinds, strict=True):
        match kind, quantity:
            case "fit", "start":
                panels = _starts(path, chosen, fixed, notes if methods is None else None)
            case "fit", _:
                panels = _table(path, quantity, fixed)
            case "run", "start":
                fits = [other for other, its in zip(paths, kinds, strict=True) if its == "fit"]
                panels = _start(path, fits, fixed, notes)
            case _:
                wanted = "a fit or a run" if quantity == "start" else f"a fit, which alone has {quantity}"
                raise NotAllowed(f"{path} holds {kind}; wanted {wanted}")
        first = found.setdefault(panels.fit, panels)
        if first is not panels:
            _add(first, panels, path)
    return list(found.values()), list(dict.fromkeys(notes))


def _methods(names: Sequence[str] | None) -> list[type[Method]]:
    """The methods by these names; else every initialisation that needs the fit alone."""
    if names is None:
        return [
            method
            for method in METHODS.values()
            if issubclass(method, Initialisation) and not method.privileged
        ]
    for name in names:
        if name not in METHODS:
            near = difflib.get_close_matches(name, METHODS, n=1)
            hint = f"did you mean {near[0]}?" if near else f"there are {', '.join(METHODS)}"
            raise UsageError(f"there is no method {name}; {hint}")
        if METHODS[name].privileged:
            raise UsageError(
                f"{name} starts from the target itself, not from a fit; draw a run of it instead"
            )
    return [METHODS[name] for name in names]


def _starts(path: Path, methods: list[type[Method]], fixed: Sequence[str], notes: list[str] | None) -> Panels:
    """The start of each method, largest over the actions; those that the fit does not allow are noted, if anywhere."""
    from qinit_cli.pipeline.knowledge import Knowledge

    known = Knowledge.read(path)
    shown = slice_of(known.family, fixed)
    sourced = shown.known(known.fit.n > 0)
    tables = {}
    for method in methods:
        try:
            found = method()
            start = found.initial_of_all(known.fit, known.family, known.learning).start
        except NotAllowed as refusal:
            if notes is None:
                raise
            notes.append(f"{method.name} is left out: {refusal}")
        else:
            tables[marked(method.name, method.name)] = _largest(
                shown.values(start), sourced, reads_sources=found.reads_sources
            )
    return Panels(known.family, known.content_sha256, known.settings, START_LABEL, shown, tables)


def _largest(start: Floats, sourced: Flags, *, reads_sources: bool) -> Floats:
    """The start (*axes, A) of a method, largest over the actions, (*axes).

    NaN where it is not `sourced` (*axes, A): no source has a value, and a method that reads sources starts from a bound.
    """
    largest: Floats = start.max(axis=-1)
    if not reads_sources:
        return largest
    known = ((start == largest[..., None]) & sourced).any(axis=-1)
    return np.where(known, largest, np.nan)


def _table(path: Path, quantity: str, fixed: Sequence[str]) -> Panels:
    """One table of the fit at the action of the largest mean, the first where several are, NaN where no source knows."""
    from qinit_cli.artefacts.opening import family_in, open_artefact

    name = quantity.replace("-", "_")
    with open_artefact(path, "fit") as artefact:
        [column] = [column for column in artefact.schema.static_columns if column.name == name]
        family = family_in(artefact)
        if column.little_endian.kind != "f" and isinstance(family, TiledFamily):
            raise NotAllowed(
                f"{quantity} counts sources at each of {family.cut.probes} probes, which make no map; write the counts with "
                f"`qinit export {path} --what state-actions`"
            )
        shown = slice_of(family, fixed)
        actions = len(family.actions)
        values, mean = (
            shown.known_values(artefact.read(each).astype(np.float64).reshape(-1, actions))
            for each in (name, "mean")
        )
        greedy = np.where(np.isnan(mean), -np.inf, mean).argmax(axis=-1)
        table = np.take_along_axis(values, greedy[..., None], axis=-1)[..., 0]
        unit = "" if column.unit == "1" else f" ({column.unit}s)"
        label = f"{column.long_name}{unit}, action of the largest mean"
        return Panels(
            family,
            artefact.content_sha256,
            FitSettings.read(artefact.spec),
            label,
            shown,
            {quantity: table},
        )


def _start(path: Path, fits: Sequence[Path], fixed: Sequence[str], notes: list[str]) -> Panels:
    """The start of a run, largest over the actions; that of a method which has one for each target is their mean.

    What no source knows stands in its fit, which is looked for among `fits` and in the run's store; a note reports its absence.
    """
    from qinit_cli.artefacts.opening import family_in, open_artefact

    with open_artefact(path, "run") as artefact:
        settings = RunSettings.read(artefact.spec)
        method = settings.method
        label = marked(method.label, method.name, blended=method.blended)
        family = family_in(artefact)
        shown = slice_of(family, fixed)
        start = artefact.read("start")
        if any(column.name == "start" for column in artefact.schema.task_columns):
            largest, label = shown.of_states(start.max(axis=-1).mean(axis=0)), f"{label}, mean of targets"
        else:
            values = _initial_values(artefact, shown, start)
            n = _sources_with_a_value(artefact, fits, notes)
            sourced = shown.known(np.broadcast_to(n > 0, (math.prod(family.shape), len(family.actions))))
            largest = _largest(values, sourced, reads_sources=method.reads_sources)
        return Panels(
            family,
            settings.content,
            settings.source_set,
            START_LABEL,
            shown,
            {label: largest},
            {label: settings},
        )


def _initial_values(run: Artefact, shown: Slice, start: Floats) -> Floats:
    """The start (S, A) of a run on a slice; of tiles the sums of the weights that its targets had first."""
    if isinstance(shown, GridSlice):
        return shown.of_weights(run.read("start_weights"))
    values: Floats = shown.values(start)
    return values


def _sources_with_a_value(run: Artefact, fits: Sequence[Path], notes: list[str]) -> Integers:
    """How many sources know each entry of the fit that a run started from, (S, A); 1 of each, and a note, where there is none."""
    from qinit_cli.artefacts.kinds import KINDS
    from qinit_cli.artefacts.opening import open_artefact
    from qinit_store.catalog import NAME
    from qinit_store.reading import describe

    settings = RunSettings.read(run.spec)
    name = next((str(one["name"]) for one in run.inputs if one.get("role") == "fit"), "")
    beside = [run.path.with_name(f"{name}.h5"), run.path.parent.parent / KINDS["fit"].folder / f"{name}.h5"]
    for path in (*fits, *(beside if NAME.fullmatch(name) else ())):
        if path.is_file() and describe(path).content_sha256 == settings.content:
            with open_artefact(path, "fit") as fit:
                n = fit.read("n")
                return n.reshape(-1, n.shape[-1])
    if settings.method.reads_sources:
        notes.append(
            f"{run.path}: what no source knows is not grey, for its fit is neither given nor beside it"
        )
    return np.ones(1, np.int32)


def _add(column: Panels, more: Panels, path: Path) -> None:
    """Adds the tables of `more`, what stands there already but once, and other tables of the same name under what differs.

    Where no setting does, under the end of the artefact's name.
    """
    for name, table in more.tables.items():
        if name not in column.tables:
            column.tables[name] = table
            column.runs.update(more.runs)
        elif not np.array_equal(column.tables[name], table, equal_nan=True):
            words = name in column.runs and distinctions([column.runs[name], more.runs[name]])[1]
            column.tables[with_words(name, words) if words else f"{name} {path.stem[-8:]}"] = table
