"""The legend of methods, beneath the axes and never over them."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from qinit_cli.plots.style import LETTER

if TYPE_CHECKING:
    from matplotlib.figure import Figure

LINE = 0.16  # inches
MOST = 4  # columns
HANDLE = 0.62  # inches, beside each label
SWATCH = 2.6  # of a line or a patch, in letters: dashes and hatching need room to be told
SIZE = 7 / 8  # of the legend's letters to the others


def columns(labels: Sequence[str], width: float) -> int:
    """How many columns of labels, filled one after the other, are as wide as the picture."""
    return next(
        (count for count in range(min(MOST, len(labels)), 1, -1) if _taken(labels, count) <= width), 1
    )


def _taken(labels: Sequence[str], count: int) -> float:
    """The width of that many columns, in inches; the first are longer by one where they are not of one length."""
    short, longer = divmod(len(labels), count)
    ends = [at * short + min(at, longer) for at in range(count + 1)]
    widest = [max(map(len, labels[first:last])) for first, last in itertools.pairwise(ends)]
    return sum(letters * LETTER * SIZE + HANDLE for letters in widest)


def height(labels: Sequence[str], width: float, title: str = "") -> float:
    """What it takes, in inches."""
    return LINE * (-(-len(labels) // columns(labels, width)) + bool(title))


def legend(figure: Figure, labels: Sequence[str], width: float, title: str = "") -> None:
    """Each label once, in their order, with the first line or bar of that name."""
    handles: dict[str, Any] = {}
    for axes in figure.axes:
        for handle, label in zip(*axes.get_legend_handles_labels(), strict=True):
            handles.setdefault(label, handle)
    figure.legend(
        [handles[label] for label in labels],
        labels,
        loc="outside lower center",
        ncols=columns(labels, width),
        handlelength=SWATCH,
        title=title or None,
        title_fontsize=7,
    )
