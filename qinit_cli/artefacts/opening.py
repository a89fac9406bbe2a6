"""Artefacts as commands open them: what they hold fits the settings they were made with.

The store vouches for the bytes. Here the settings are checked by the dataclasses that make them, the axes by the family, and
each number, task parameters included, by the range of its column, before a kernel or a picture sees any of it.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from qinit_cli.artefacts.kinds import KINDS, read
from qinit_cli.artefacts.settings import RunSettings, Settings
from qinit_cli.artefacts.tile_columns import expected
from qinit_cli.environments import Family
from qinit_store import reading
from qinit_store.held import Held
from qinit_store.reading import Artefact, Description
from qinit_store.schema import Axis, Column

SETTINGS = {  # one of them makes an artefact ours
    "kind",
    "algorithm_version",
    "family",
    "learning",
    "learner",
    "sources",
    "source_set",
    "method",
    "grid",
}


def open_artefact(source: Path | Held, kind: str | None = None) -> Artefact:
    """The artefact at a path, or in memory, whose content hash holds and whose settings allow what it holds.

    NotFound; Refused if it is not of `kind`; Damaged if it is not as it was written, or holds what cannot be.
    """
    return _fitting(source.of_kind(kind) if isinstance(source, Held) else reading.open_artefact(source, kind))


def open_doubtful(path: Path) -> Artefact:
    """The same, though its content hash need not hold, and settings of another program's are left alone: for verify and salvage.

    Damaged where its settings cannot be.
    """
    artefact = reading.open_doubtful(path)
    return _fitting(artefact) if _ours(artefact.spec) else artefact


def describe(path: Path) -> Description:
    """What the artefact at `path` says of itself, its content not looked into; Damaged where its settings cannot be."""
    from qinit_store import reading
    from qinit_store.errors import Damaged

    found, _ = described(reading.describe(path))
    if found.problem:
        raise Damaged(found.problem)
    return found


def described(entry: Description) -> tuple[Description, Settings | None]:
    """The entry of a list and its settings, without them if they cannot be; it is then "damaged" if a command of ours made it."""
    if not entry.spec:
        return entry, None
    try:
        return entry, read(entry.kind, entry.spec)
    except ValueError as fault:
        unknown = replace(entry, spec={})
        if entry.state == "done" and _ours(entry.spec):
            return replace(unknown, state="damaged", problem=f"{entry.path} is damaged: {fault}"), None
        return unknown, None


def settings_of(entry: Description) -> Settings | None:
    """Its settings; None where these are unknown or invalid."""
    try:
        return read(entry.kind, entry.spec) if entry.spec else None
    except ValueError:
        return None


def family_in(artefact: Artefact) -> Family:
    """The family of its tasks; NotAllowed if that is not installed, or has other states here."""
    return KINDS[artefact.kind].family(artefact)


def action_axis(family: Family) -> Axis:
    """The axis of the family's actions, labelled by their names."""
    return Axis("action", np.array(family.actions, dtype="S"), "", "action")


def _fitting(artefact: Artefact) -> Artefact:
    try:
        _expect(artefact)
    except BaseException:
        artefact.close()
        raise
    return artefact


def _ours(spec: dict[str, Any]) -> bool:
    """Whether a command made it, or could take it for its own: what other programs put into a store has settings of its own."""
    return bool(SETTINGS & spec.keys())


def _expect(artefact: Artefact) -> None:
    try:
        drawn = read(artefact.kind, artefact.spec).sources
        axes, columns = _layout(artefact, drawn.family.here)
        artefact.expect(axes, columns)
        if not artefact.trouble:  # which is told as what it is
            KINDS[artefact.kind].check_values(artefact)
    except ValueError as fault:
        raise artefact.damage(str(fault)) from fault


def _layout(artefact: Artefact, family: Family | None) -> tuple[list[Axis], list[Column]]:
    """The axes and columns that the settings make, but for the axes of a family that depend on another package."""
    kind = KINDS[artefact.kind]
    for name, length in kind.lengths(artefact).items():
        if (there := artefact.schema.sizes.get(name, 0)) != length:
            raise ValueError(f"its axis {name} has {there} entries; its settings make {length}")
    axes = [
        _index(name, artefact.schema.sizes[name])
        for name in (*kind.indices, "byte")
        if name in artefact.schema.sizes
    ]
    if family is not None and kind.has_table(artefact.schema) and not getattr(family, "packages", ()):
        axes += [*family.axes(), action_axis(family)]
    _check_scales(artefact)
    parameters = family.parameters() if family is not None and kind.has_parameters else ()
    names = {
        *(column.name for column in parameters),
        *kind.asked(artefact.spec),
    }
    if lacking := names - {column.name for column in artefact.schema.columns}:
        raise ValueError(f"it lacks {min(lacking)}")
    if artefact.tasks.size and "tasks" in artefact.spec and artefact.tasks[-1] >= artefact.spec["tasks"]:
        raise ValueError(f"it holds task {artefact.tasks[-1]} of {artefact.spec['tasks']}, counted from 0")
    more, tiled = expected(family, artefact.schema.sizes)
    return [*axes, *more], kind.within((*kind.columns(artefact), *tiled, *parameters), artefact)


def _check_scales(artefact: Artefact) -> None:
    """ValueError where the axes of a table, or the moments of a run, are no scales whatever the family."""
    axes = {axis.name: axis.values for axis in artefact.schema.axes}
    if KINDS[artefact.kind].has_table(artefact.schema):
        table = next(one for one in artefact.schema.columns if one.name == KINDS[artefact.kind].table)
        *states, action = (name for name in table.dims if name != "task")
        if axes[action].dtype.kind != "S":
            raise ValueError(f"its axis {action} has no names")
        for name in states:
            if axes[name].dtype.kind != "S" and not (np.diff(axes[name]) > 0).all():
                raise ValueError(f"its axis {name} does not ascend")
    if "moment" in axes:
        moments, episodes = axes["moment"], RunSettings.read(artefact.spec).learning.episodes
        whole = moments.dtype.kind == "i" and moments.size > 0
        if not (whole and (np.diff(moments) > 0).all() and moments[0] >= 0 and moments[-1] <= episodes):
            raise ValueError("its axis moment is no row of ascending numbers of episodes")


def _index(name: str, length: int) -> Axis:
    return Axis(name, np.arange(length))
