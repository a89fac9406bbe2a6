"""`qinit show`: one artefact, what it was made with and what it holds."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import typer

from qinit_cli.artefacts.kinds import KINDS
from qinit_cli.commands.console import console, note
from qinit_cli.commands.option_groups import (
    DISPLAY,
    IMPORTS,
    READING,
    TABULAR,
    Display,
    Group,
    Reading,
    Tabular,
)
from qinit_cli.commands.typer_commands import Reference, add_command
from qinit_cli.errors import UsageError
from qinit_cli.options import option
from qinit_cli.plots.plot import SLICE, UNSLICED

if TYPE_CHECKING:
    from rich.console import Console

    from qinit_cli.arrays import Flags, Floats
    from qinit_cli.artefacts.kind import Shown
    from qinit_cli.artefacts.settings import Settings
    from qinit_store.reading import Artefact
    from qinit_store.schema import Axis

SCHEMA = "qinit.show/1"
LISTED = 12  # labels of an axis that are listed one by one


@dataclass(frozen=True)
class Picturing:
    """What the map of a fit shows."""

    slice_: list[str] | None = option(None, SLICE, metavar="NAME=VALUE", default_text=UNSLICED)


def add_to(app: typer.Typer) -> None:
    """Adds the command."""
    add_command(
        app,
        "show",
        show,
        {
            "picturing": Group(Picturing, "Picture"),
            "tabular": TABULAR,
            "reading": READING,
            "display": DISPLAY,
        },
        imports=IMPORTS,
        references=(Reference("artefact", "A path, a name in the store, or - for stdin."),),
        help="Show an artefact: settings, origin, numbers, datasets, and a picture of it for people.",
    )


def show(artefact: str, picturing: Picturing, tabular: Tabular, reading: Reading, display: Display) -> None:
    """Prints what one artefact holds: sections and a picture for people, key and value for programs."""
    from qinit_cli.artefacts.opening import open_artefact
    from qinit_cli.artefacts.settings import outdated
    from qinit_cli.commands import references
    from qinit_cli.commands.show_sections import print_sections
    from qinit_cli.commands.tables import TableColumn, print_table

    slices = picturing.slice_ or []
    if slices and tabular.chosen != "table":
        raise UsageError(f"--slice {slices[0]} is of the picture, which --format table alone draws")
    with open_artefact(references.one(artefact, reading.store)) as opened:
        shown = KINDS[opened.kind].shown(opened)
        told = finite(_told(opened, shown))
        settings = KINDS[opened.kind].read(opened.spec)
        mapped = _map(opened, shown, settings, slices)
    warnings = outdated(settings)
    for warning in warnings:
        note(display, f"warning: {warning}")
    match tabular.chosen:
        case "table":
            terminal = _terminal(display)
            print_sections(told, terminal)
            _print_picture(shown, mapped, terminal)
        case "json":
            print(json.dumps({"schema": SCHEMA, **told}, allow_nan=False))
        case _:
            rows = [{"key": key, "value": value} for key, value in flat(told)]
            print_table(SCHEMA, [TableColumn("key"), TableColumn("value")], rows, tabular, display)


def _terminal(display: Display) -> Console:
    """The console of stdout, as wide as it is: of one that calls itself dumb, rich believes 80 columns."""
    import shutil

    terminal = console(display)
    if terminal.is_dumb_terminal:
        terminal.size = shutil.get_terminal_size()
    return terminal


def _told(artefact: Artefact, shown: Shown) -> dict[str, Any]:
    """All that is told of an artefact, as JSON would have it but for NaN."""
    return {
        "kind": artefact.kind,
        "name": artefact.path.stem,
        "path": str(artefact.path),
        "bytes": artefact.path.stat().st_size,
        "content_sha256": artefact.content_sha256,
        "spec_sha256": artefact.spec_sha256,
        "spec": artefact.spec,
        "numbers": shown.numbers,
        "provenance": artefact.provenance,
        "inputs": list(artefact.inputs),
        "axes": {name: _axis(artefact.axes[name]) for name in _axis_names(artefact)},
        "datasets": _datasets(artefact),
    }


def _axis_names(artefact: Artefact) -> list[str]:
    """The axes in the order in which tables have them."""
    widest = sorted(artefact.schema.columns, key=lambda column: -len(column.dims))
    return list(dict.fromkeys(dim for column in widest for dim in column.dims))


def _axis(axis: Axis) -> dict[str, Any]:
    ends = [_label(axis.values[place]) for place in (0, -1)] if axis.values.size else [None, None]
    told = {
        "length": int(axis.values.size),
        "first": ends[0],
        "last": ends[1],
        "dtype": axis.values.dtype.str,
        "unit": axis.unit,
        "long_name": axis.long_name,
    }
    if axis.values.dtype.kind == "S" and axis.values.size <= LISTED:
        told["labels"] = [_label(value) for value in axis.values]
    return told


@dataclass(frozen=True)
class TerminalMap:
    """What is drawn of a table over states: its axes, its values over them, and what stands where it is closed."""

    axes: tuple[Axis, ...]
    values: Floats
    closed: Mapping[str, Flags]
    told: str


def _map(artefact: Artefact, shown: Shown, settings: Settings, slices: list[str]) -> TerminalMap | None:
    """The map of an artefact over its states; None where it has none.

    Without slices that is so of a table of one axis or of more than two, too, and of tiles of a family that is not installed.

    UsageError for slices of what is no map.
    """
    from qinit_cli.artefacts.slices import MOST_DRAWN, slice_of, slice_of_axes
    from qinit_cli.plots.state_axes import closed_states

    if shown.drawn != "heatmap":
        if slices:
            raise UsageError(
                f"--slice {slices[0]}: show draws a {shown.drawn} of {artefact.kind} and no map; "
                "a slice is of fits, and `qinit plot heatmaps` has one of runs"
            )
        return None
    family = settings.sources.family.here
    if settings.sources.family.tiled:
        if family is None and not slices:
            return None
        sliced = slice_of(KINDS[artefact.kind].family(artefact), slices)
    else:
        states, _ = KINDS[artefact.kind].axes(artefact)
        if not slices and len(states) != MOST_DRAWN:
            return None
        sliced = slice_of_axes(settings.sources.family.name, states, slices)
    closed = {} if family is None else closed_states(family)
    return TerminalMap(
        sliced.axes,
        sliced.known_values(shown.picture.reshape(-1, 1))[..., 0],
        {name: sliced.of_states(there) for name, there in closed.items()},
        sliced.told,
    )


def _label(value: Any) -> Any:
    return value.decode() if isinstance(value, bytes) else value.item()


def _datasets(artefact: Artefact) -> dict[str, Any]:
    """Dimensions, shape, dtype and unit of each dataset, scales apart."""
    tasks = (artefact.task_count,)
    return {
        column.name: {
            "dims": list(column.dims),
            "shape": [*(tasks if column.per_task else ()), *artefact.schema.row_shape(column)],
            "dtype": column.little_endian.str,
            "unit": column.unit,
            "long_name": column.long_name,
        }
        for column in artefact.schema.columns
    }


def finite(value: Any) -> Any:
    """The same without NaN and infinities, which JSON has no words for: None in their place."""
    if isinstance(value, dict):
        return {key: finite(part) for key, part in value.items()}
    if isinstance(value, list | tuple):
        return [finite(part) for part in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value


def flat(told: Any, above: str = "") -> list[tuple[str, Any]]:
    """Nested settings as lines: "spec.family.size" and its value, a list of plain values joined by commas."""
    parts: list[tuple[str, Any]]
    if isinstance(told, dict):
        parts = list(told.items())
    elif isinstance(told, list) and any(isinstance(part, dict | list) for part in told):
        parts = [(str(place), part) for place, part in enumerate(told)]
    elif isinstance(told, list):
        return [(above, ",".join(map(str, told)))]
    else:
        return [(above, told)]
    return [line for key, part in parts for line in flat(part, f"{above}.{key}" if above else str(key))]


def _print_picture(shown: Shown, mapped: TerminalMap | None, terminal: Console) -> None:
    """The picture of an artefact, with a line that says what it is."""
    from qinit_cli.plots.terminal.curve import curve
    from qinit_cli.plots.terminal.heatmap import MapAxis, heatmap
    from qinit_cli.plots.terminal.histogram import histogram
    from qinit_cli.plots.terminal.sheet import Sheet

    sheet, title = Sheet.of(terminal), shown.title
    if not shown.picture.size:
        return
    if mapped is not None:
        title += mapped.told
        first, *second = (MapAxis(axis.name, axis.values.tolist()) for axis in mapped.axes)
        if second:
            lines = heatmap(mapped.values, first, second[0], sheet, mapped.closed)
        else:
            ends = (first.at(0), first.at(len(first.values) - 1))
            lines = curve(mapped.values, ends, first.name, sheet)
    elif shown.drawn == "histogram":
        lines = histogram(shown.picture, shown.label, sheet)
    elif shown.drawn == "curve":
        lines = curve(shown.picture, ("1", str(len(shown.picture))), shown.label, sheet)
    else:
        return  # a table over one state axis, or over more than two, has no map
    terminal.print(f"\n{title}", style="bold")
    for line in lines:
        terminal.print(line, no_wrap=True, overflow="crop")
