"""What things are called in pictures."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from qinit_cli.environments import Family
    from qinit_cli.figures.heatmaps import Side
    from qinit_store.schema import Axis

METRIC_LABELS = {
    "return": "discounted return",
    "success": "share of episodes at the goal",
    "steps": "steps, at most the horizon",
}
SPELLED_OUT = {"col": "column"}  # what an axis is called in files and in pictures
MINUS = "\N{MINUS SIGN}"


def marked(label: str, method: str) -> str:
    """The label of a method's line, bar or panel, with what a reader must know of it."""
    from qinit_cli.comparison.rows import remark

    known = remark(method)
    return legible(f"{label} ({known})" if known else label)


def legible(label: str) -> str:
    """The label with a blank before an underscore, which keeps a line out of a legend."""
    return f"\N{NO-BREAK SPACE}{label}" if label.startswith("_") or not label else label


def distribution(family: Family) -> str:
    """The distribution as a picture names it: the family's label without the family's name."""
    return shortened(family.label, family.name)


def shortened(label: str, family: str) -> str:
    """A distribution's label without its family's name."""
    return label.removeprefix(f"{family}-").replace("-", " ")


def distinct(names: Sequence[str], *additions: Sequence[str]) -> list[str]:
    """The names; those that stand there twice with the first addition, on a line of its own, that tells all of them apart."""
    for addition in ((), *additions):
        longer = list(names)
        if addition:
            longer = [
                f"{name}\n{more}" if names.count(name) > 1 else name
                for name, more in zip(names, addition, strict=True)
            ]
        if len(set(longer)) == len(longer):
            return longer
    return longer


def place(coordinates: Sequence[float]) -> str:
    """A state by its coordinates, such as (0, 0)."""
    return "(" + ", ".join(f"{each:g}" for each in coordinates).replace("-", MINUS) + ")"


def axis_label(axis: Axis) -> str:
    """What stands along a state axis: its name and unit; whole numbers without one count cells."""
    unit = "cell" if axis.unit == "1" and axis.values.dtype.kind in "iu" else axis.unit
    name = SPELLED_OUT.get(axis.name, axis.name)
    return name if unit in ("", "1") else f"{name} ({unit})"


def sides(family: Family) -> tuple[Side, ...]:
    """The state axes as they are drawn; cells are counted downwards, as the rows of a matrix."""
    from qinit_cli.figures.heatmaps import Side

    return tuple(
        Side(axis_label(axis), axis.values.astype(np.float64), downwards=axis.values.dtype.kind in "iu")
        for axis in family.axes()
    )


def number(value: float) -> str:
    """Four decimals, or one beyond 10: as it is read out, never as a power."""
    return f"{value:.4f}" if abs(value) < 10 else f"{value:.1f}"


def listed(parts: Sequence[str], most: int = 12) -> str:
    """The parts as one stretch of a sentence; beyond `most` the rest is counted."""
    shown = list(parts[:most])
    return "; ".join(shown + ([f"and {len(parts) - most} more"] if len(parts) > most else []))
