"""How values are spread: a bar for each of some equal bins, with its count."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from qinit_cli.plots.terminal.sheet import Sheet, labels, ticks

if TYPE_CHECKING:
    from rich.text import Text

    from qinit_cli.arrays import Floats

MOST_BINS = 14
EIGHTHS = " ▏▎▍▌▋▊▉"
COLOUR = "rgb(33,145,140)"


def histogram(values: Floats, unit: str, sheet: Sheet) -> list[Text]:
    """A line for each bin of `values` (n,), all finite: where it begins, its bar, how many lie in it."""
    from rich.text import Text

    edges = _edges(values)
    counts, _ = np.histogram(values, edges)
    texts = labels([float(edge) for edge in edges])
    margin = max(len(text) for text in texts)
    digits = len(str(counts.max()))
    room = sheet.width - 2 * margin - digits - 8
    lines = []
    for place, count in enumerate(counts):
        line = Text(f"{texts[place]:>{margin}} to {texts[place + 1]:>{margin}} ")
        line.append(_bar(count / counts.max() * room, sheet), style=COLOUR if sheet.colour else "")
        line.append(f" {count}")
        lines.append(line)
    lines.append(Text(f"{unit}; {len(values)} in all", style="dim" if sheet.colour else ""))
    return lines


def _edges(values: Floats) -> Floats:
    """Round edges of about as many bins as the square root of the number of values, over all of them."""
    low, high = float(values.min()), float(values.max())
    if low == high:
        return np.array([low - 0.5, high + 0.5])
    marks = ticks(low, high, max(2, min(MOST_BINS, round(len(values) ** 0.5))))
    step = marks[1] - marks[0] if len(marks) > 1 else high - low
    first = marks[0] - step if marks[0] > low else marks[0]
    count = int(np.ceil((high - first) / step - 1e-9))
    edges = np.array([first + step * place for place in range(count + 1)])
    edges[-1] = max(edges[-1], high)
    edges[0] = min(edges[0], low)
    return edges


def _bar(length: float, sheet: Sheet) -> str:
    if sheet.ascii_only:
        return "#" * (round(length) or (1 if length else 0))
    whole, eighths = divmod(round(length * 8), 8)
    return "█" * whole + (EIGHTHS[eighths] if eighths else "" if whole or not length else EIGHTHS[1])
