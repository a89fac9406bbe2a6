"""One curve over an axis of numbers, in braille dots or in asterisks."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from qinit_cli.plots.terminal.sheet import Sheet, labels, ticks

if TYPE_CHECKING:
    from rich.text import Text

    from qinit_cli.arrays import Floats, Integers

HEIGHT = 12  # lines
BRAILLE = 0x2800
DOTS = ((0x01, 0x08), (0x02, 0x10), (0x04, 0x20), (0x40, 0x80))  # of a braille cell, by row and column
COLOUR = "rgb(33,145,140)"  # the middle of the maps' scale


def curve(values: Floats, ends: tuple[str, str], xlabel: str, sheet: Sheet) -> list[Text]:
    """The curve of `values` (P,), NaN where unknown, evenly spaced between labels at both ends; the vertical axis contains 0."""
    from rich.text import Text

    known = values[np.isfinite(values)]
    if not known.size:
        return [Text("no known value")]
    low, high = min(0.0, float(known.min())), max(0.0, float(known.max()))
    high = high if high > low else low + 1.0
    marks = ticks(low, high, 5)
    texts = labels(marks)
    margin = max(len(text) for text in texts) + 1
    dots = (1, 1) if sheet.ascii_only else (4, 2)
    filled = _filled(values, low, high, HEIGHT * dots[0], (sheet.width - margin - 2) * dots[1])
    rows = _asterisks(filled) if sheet.ascii_only else _braille(filled)
    at = {
        round((high - mark) / (high - low) * (HEIGHT - 1)): text
        for mark, text in zip(marks, texts, strict=True)
    }
    bar, corner, dash = ("|", "+", "-") if sheet.ascii_only else ("│", "└", "─")
    lines = []
    for line, row in enumerate(rows):
        lines.append(
            Text(f"{at.get(line, ''):>{margin}}{bar}") + Text(row, style=COLOUR if sheet.colour else "")
        )
    lines.append(Text(f"{'':{margin}}{corner}" + dash * (sheet.width - margin - 2)))
    lines.append(Text(" " * (margin + 1) + _beneath(ends, xlabel, sheet.width - margin - 2)))
    return lines


def _filled(values: Floats, low: float, high: float, height: int, width: int) -> Integers:
    """Which dots are set, (height, width): the mean of the known values that fall into each column, joined to the next one.

    Where there are fewer values than columns, those between two known values are on the line between them, and a known value
    between unknown ones is a dot.
    """
    heights = _means(values, width) if len(values) >= width else _interpolated(values, width)
    known = np.flatnonzero(np.isfinite(heights))
    rows = np.rint((high - heights[known]) / (high - low) * (height - 1)).astype(np.int64)
    filled = np.zeros((height, width), dtype=np.int64)
    for place, (column, row) in enumerate(zip(known, rows, strict=True)):
        joined = place > 0 and known[place - 1] == column - 1
        before = rows[place - 1] if joined else row
        # up to, and not with, the dot before: a steep piece stays one dot wide
        start, stop = (row, max(row, before - 1)) if row < before else (min(row, before + 1), row)
        filled[start : stop + 1, column] = 1
    return filled


def _means(values: Floats, width: int) -> Floats:
    starts = np.arange(width) * len(values) // width
    known = np.isfinite(values)
    sums = np.add.reduceat(np.where(known, values, 0.0), starts)
    counts = np.add.reduceat(known.astype(np.int64), starts)
    means: Floats = np.where(counts > 0, sums / np.maximum(counts, 1), np.nan)
    return means


def _interpolated(values: Floats, width: int) -> Floats:
    places = np.linspace(0, len(values) - 1, width)
    heights: Floats = np.interp(places, np.arange(len(values)), values)
    for place in np.flatnonzero(
        np.isfinite(values)
    ):  # else one without known neighbours could fall between columns
        nearest = int(np.abs(places - place).argmin())
        if np.isnan(heights[nearest]):
            heights[nearest] = values[place]
    return heights


def _braille(filled: Integers) -> list[str]:
    lines = []
    for top in range(0, len(filled), 4):
        cells = [BRAILLE] * (filled.shape[1] // 2)
        for row, dots in enumerate(DOTS):
            for side, dot in enumerate(dots):
                cells = [
                    cell + dot * int(set_)
                    for cell, set_ in zip(cells, filled[top + row, side::2], strict=True)
                ]
        lines.append("".join(map(chr, cells)).replace(chr(BRAILLE), " "))
    return lines


def _asterisks(filled: Integers) -> list[str]:
    return ["".join("*" if dot else " " for dot in row) for row in filled]


def _beneath(ends: tuple[str, str], xlabel: str, width: int) -> str:
    """The labels at the ends, the axis' name between them."""
    first, last = ends
    return f"{first}{xlabel:^{max(len(xlabel) + 2, width - len(first) - len(last))}}{last}"
