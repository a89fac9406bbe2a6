"""The tables that heatmaps show, as fits and runs hold them, reduced over the actions."""

from __future__ import annotations

import difflib
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from qinit_cli.errors import NotAllowed, UsageError
from qinit_cli.methods import METHODS
from qinit_cli.methods.method import Initialisation
from qinit_cli.pictures.names import marked

if TYPE_CHECKING:
    from qinit_cli.arrays import Floats
    from qinit_cli.environments import Family
    from qinit_cli.methods import Method

START_LABEL = "initial value, largest over actions (discounted return)"


@dataclass(frozen=True)
class Panels:
    """One column of panels: what comes of one fit."""

    family: Family
    fit: str  # its content hash
    origin: str  # what tells it from another of the same family
    label: str  # what the tables hold, with its unit
    tables: dict[str, Floats] = field(default_factory=dict)  # (S,) by method, or by the quantity's name


def read_panels(
    paths: Sequence[Path], methods: Sequence[str] | None, quantity: str
) -> tuple[list[Panels], list[str]]:
    """The panels of each fit and of the runs that started from it, in the order of the artefacts; and what was left out.

    UsageError for methods that have no start in a fit; NotAllowed where an artefact does not hold what is asked for.
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
                panels = _starts(path, chosen, notes if methods is None else None)
            case "fit", _:
                panels = _table(path, quantity)
            case "run", "start":
                panels = _start(path)
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


def _starts(path: Path, methods: list[type[Method]], notes: list[str] | None) -> Panels:
    """The start of each method, largest over the actions; those that the fit does not allow are noted, if anywhere."""
    import numpy as np

    from qinit_cli.stages.knowledge import Knowledge
    from qinit_cli.stages.transfer import TargetTasks

    known = Knowledge.read(path)
    learning = known.family.target_learning
    # initialisations look at no target
    nobody = TargetTasks(known.family, learning, seed=0, keep_q=False).targets(
        0, partial(np.empty, (0, *known.fit.mu.shape))
    )
    tables = {}
    for method in methods:
        try:
            start = method().initial(known.fit, nobody).start
        except NotAllowed as refusal:
            if notes is None:
                raise
            notes.append(f"{method.name} is left out: {refusal}")
        else:
            tables[marked(method.name, method.name)] = start.max(axis=-1)
    seed = known.spec["sources"]["seed"]
    return Panels(known.family, known.content_sha256, f"seed {seed}", START_LABEL, tables)


def _table(path: Path, quantity: str) -> Panels:
    """One table of the fit at the action of the largest mean, the first where several are, NaN where no source knows."""
    import numpy as np

    from qinit_cli.environments import family_of
    from qinit_store.reading import open_artefact

    name = quantity.replace("-", "_")
    with open_artefact(path, "fit") as artefact:
        [column] = [column for column in artefact.schema.static_columns if column.name == name]
        values = artefact.read(name).astype(np.float64)
        mean = artefact.read("mean")
        sources = artefact.spec["sources"]
        greedy = np.where(np.isnan(mean), -np.inf, mean).argmax(axis=-1)
        table = np.take_along_axis(values, greedy[..., None], axis=-1).ravel()
        unit = "" if column.unit == "1" else f" ({column.unit}s)"
        label = f"{column.long_name}{unit}, action of the largest mean"
        return Panels(
            family_of(sources, artefact.provenance),
            artefact.content_sha256,
            f"seed {sources['seed']}",
            label,
            {quantity: table},
        )


def _start(path: Path) -> Panels:
    """The start of a run, largest over the actions; that of a method which has one for each target is their mean."""
    from qinit_cli.environments import family_of
    from qinit_store.reading import open_artefact

    with open_artefact(path, "run") as artefact:
        fit, method = artefact.spec["inputs"][0], artefact.spec["method"]
        label = marked(method["label"], method["name"])
        start = artefact.read("start").max(axis=-1)
        if any(column.name == "start" for column in artefact.schema.task_columns):
            start, label = start.mean(axis=0), f"{label}, mean of targets"
        return Panels(
            family_of(artefact.spec, artefact.provenance),
            fit,
            f"fit {fit[:8]}",
            START_LABEL,
            {label: start.ravel()},
        )


def _add(column: Panels, more: Panels, path: Path) -> None:
    """Adds the tables of `more`, what stands there already but once, and other tables of the same name under the artefact's."""
    import numpy as np

    for name, table in more.tables.items():
        if name not in column.tables:
            column.tables[name] = table
        elif not np.array_equal(column.tables[name], table):
            column.tables[f"{name} {path.stem[-8:]}"] = table
