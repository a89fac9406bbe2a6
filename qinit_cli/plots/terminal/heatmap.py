"""A table of values as a map: one character, or one coloured cell, for each entry or for each block of entries."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from qinit_cli.plots.state_axes import without_closed
from qinit_cli.plots.style import CLOSED_COLOURS
from qinit_cli.plots.terminal.sheet import Sheet, label, shade

if TYPE_CHECKING:
    from numpy.typing import NDArray
    from rich.text import Text

    from qinit_cli.arrays import Flags, Floats

RAMP = " .:-=+*#%@"  # from the least value to the largest
UNKNOWN = "?"
CLOSED = {"wall": "X", "hole": "O"}  # what stands where no episode is
TALLEST = 32  # lines
LOG_RATIO = 30  # between the largest and the least value: above it a linear scale shows little but the peak


@dataclass(frozen=True)
class MapAxis:
    """A state axis: its name, and the value at each entry."""

    name: str
    values: Sequence[float]

    def at(self, position: int) -> str:
        """The label of the entry at `position`."""
        return label(self.values[min(position, len(self.values) - 1)])


class _Layout(NamedTuple):
    """How many entries one cell stands for, and how many characters wide it is."""

    rows: int
    columns: int
    width: int
    halves: bool  # two cells in one character, one above the other


def heatmap(
    values: Floats, rows: MapAxis, columns: MapAxis, sheet: Sheet, closed: Mapping[str, Flags] | None = None
) -> list[Text]:
    """The map of `values` (R, C), rows downwards, with its axes and scale; NaN is unknown.

    Entries that are `closed` (R, C) have a letter or a colour of their own, by what stands there.
    """
    from rich.text import Text

    margin = max(len(rows.at(position)) for position in range(len(rows.values))) + 1
    layout = _layout(values.shape, sheet.width - margin - 2, sheet)
    closed = closed or {}
    cells = _block_means(without_closed(values, closed), layout)
    stands = _blocks_closed(closed, cells.shape, layout)
    known = cells[np.isfinite(cells)]
    if not known.size:
        return [Text("no known value")]
    low, high = float(known.min()), float(known.max())
    log = low > 0 and high / low > LOG_RATIO
    shares = _shares(cells, low, high, log)
    lines = [Text(f"{'':{margin}} {rows.name} down, {columns.name} across")]
    bar = "|" if sheet.ascii_only else "│"
    every = max(1, -(-_height(shares, layout) // 8))  # lines between labels
    for line, position in enumerate(range(0, len(shares), 2 if layout.halves else 1)):
        tick = rows.at(position * layout.rows) if line % every == 0 else ""
        drawn = _line(shares, stands, position, layout, sheet)
        lines.append(Text(f"{tick:>{margin}}{bar}") + drawn + Text(bar))
    lines.append(Text(" " * (margin + 1) + _across(columns, layout, shares.shape[1])))
    lines += _scale(low, high, log, bool((np.isnan(cells) & (stands == "")).any()), layout, sheet)
    return [*lines, *_closed_notes(stands, sheet)]


def _layout(shape: tuple[int, ...], width: int, sheet: Sheet) -> _Layout:
    """The finest layout that fits; a character is about twice as high as wide, and cells are kept square."""
    factor = 1
    while True:
        choices = [_Layout(factor, factor, 2, False)]
        if sheet.colour and not sheet.ascii_only:
            choices.append(_Layout(factor, factor, 1, True))
        else:
            choices.append(_Layout(2 * factor, factor, 1, False))
        for layout in choices:
            high = -(-shape[0] // (layout.rows * (2 if layout.halves else 1)))
            if -(-shape[1] // layout.columns) * layout.width <= width and high <= TALLEST:
                return layout
        factor += 1


def _block_means(values: Floats, layout: _Layout) -> Floats:
    """Means over blocks of entries, of what is known in each; NaN where nothing is."""
    high, wide = (-(-length // block) for length, block in zip(values.shape, layout[:2], strict=True))
    padded = np.full((high * layout.rows, wide * layout.columns), np.nan)
    padded[: values.shape[0], : values.shape[1]] = values
    blocks = padded.reshape(high, layout.rows, wide, layout.columns)
    known = np.isfinite(blocks)
    count = known.sum(axis=(1, 3))
    total = np.where(known, blocks, 0.0).sum(axis=(1, 3))
    return np.where(count > 0, total / np.maximum(count, 1), np.nan)


def _blocks_closed(closed: Mapping[str, Flags], shape: tuple[int, ...], layout: _Layout) -> NDArray[np.str_]:
    """What stands in each block that is closed as a whole, "" elsewhere."""
    stands = np.full(shape, "", "U4")
    for name, entries in closed.items():
        high, wide = (length * block for length, block in zip(shape, layout[:2], strict=True))
        padded = np.ones((high, wide), np.bool_)
        padded[: entries.shape[0], : entries.shape[1]] = entries
        blocks = padded.reshape(shape[0], layout.rows, shape[1], layout.columns)
        stands[blocks.all(axis=(1, 3))] = name
    return stands


def _closed_notes(stands: NDArray[np.str_], sheet: Sheet) -> list[Text]:
    from rich.text import Text

    return [
        Text("  ")
        .append(CLOSED[name], style=f"on {CLOSED_COLOURS[name][1]}" if sheet.colour else "")
        .append(f" {name}")
        for name in CLOSED
        if (stands == name).any()
    ]


def _shares(cells: Floats, low: float, high: float, log: bool) -> Floats:
    """Where each value lies on the scale, 0 to 1; NaN is unknown."""
    if low == high:
        return np.where(np.isfinite(cells), 1.0, np.nan)
    if log:
        cells, low, high = np.log(cells), float(np.log(low)), float(np.log(high))
    return np.asarray((cells - low) / (high - low), dtype=np.float64)


def _height(shares: Floats, layout: _Layout) -> int:
    return -(-len(shares) // 2) if layout.halves else len(shares)


def _line(shares: Floats, stands: NDArray[np.str_], position: int, layout: _Layout, sheet: Sheet) -> Text:
    from rich.text import Text

    text = Text()
    for column in range(shares.shape[1]):
        share, there = float(shares[position, column]), str(stands[position, column])
        colour = _colour(share, there)
        if layout.halves:
            past = position + 1 == len(shares)
            below = (
                None
                if past
                else _colour(float(shares[position + 1, column]), str(stands[position + 1, column]))
            )
            text.append(*_half_cells(colour, below))
        elif colour is None:
            text.append(UNKNOWN * layout.width, style="dim" if sheet.colour else "")
        elif sheet.colour:
            text.append(CLOSED.get(there, " ") * layout.width, style=f"on {colour}")
        else:
            text.append((CLOSED.get(there) or _character(share)) * layout.width)
    return text


def _colour(share: float, there: str) -> str | None:
    """The colour of a cell: of what stands there, else of its value; None where that is unknown."""
    return CLOSED_COLOURS[there][1] if there else None if share != share else shade(share)


def _half_cells(above: str | None, below: str | None) -> tuple[str, str]:
    """A character for two cells of these colours, and its own; what is unknown or past the table's end stays dark."""
    colours = [above, below]
    match colours:
        case [None, None]:
            return UNKNOWN, "dim"
        case [str(upper), None]:
            return "▀", upper
        case [None, str(lower)]:
            return "▄", lower
        case _:
            return "▀", f"{colours[0]} on {colours[1]}"


def _character(share: float) -> str:
    return RAMP[min(int(share * len(RAMP)), len(RAMP) - 1)]


def _across(columns: MapAxis, layout: _Layout, count: int) -> str:
    """The labels beneath the map, as many as leave room between them."""
    widest = max(len(columns.at(position)) for position in range(len(columns.values)))
    every = max(-(-(widest + 2) // layout.width), -(-count // 6))
    line = ""
    for position in range(0, count, every):
        text = columns.at(position * layout.columns)
        if position == 0 or position * layout.width + len(text) <= count * layout.width:
            line = line.ljust(position * layout.width) + text
    return line


def _scale(low: float, high: float, log: bool, gaps: bool, layout: _Layout, sheet: Sheet) -> list[Text]:
    """What the shades mean, and how coarse the map is."""
    from rich.text import Text

    steps = max(len(RAMP), min(2 * len(RAMP), sheet.width - 18))  # room for both ends
    scale = Text(f"  {label(low)} ")
    for step in range(steps):
        share = (step + 0.5) / steps
        scale.append(*((" ", f"on {shade(share)}") if sheet.colour else (_character(share), "")))
    scale.append(f" {label(high)}")
    notes = {
        "log scale": log,
        f"{UNKNOWN} unknown": gaps,
        f"a cell: mean of {layout.rows} x {layout.columns}": layout.rows * layout.columns > 1,
    }
    return [scale, *(Text(f"  {note}") for note, holds in notes.items() if holds)]
