"""State axes as pictures have them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from qinit_cli.plots.style import plain_numbers

if TYPE_CHECKING:
    from matplotlib.axis import Axis as DrawnAxis

    from qinit_cli.arrays import Floats
    from qinit_cli.environments import Family
    from qinit_store.schema import Axis

ANY_SHAPE = (0.25, 4.0)  # of height to width; beyond, panels are stretched to be legible
SPELLED_OUT = {"col": "column"}  # what an axis is called in files and in pictures


@dataclass(frozen=True)
class Side:
    """A state axis as it is drawn."""

    label: str
    places: Floats  # (L,), evenly spaced
    downwards: bool = False  # where it stands upright: as the rows of a matrix are read

    @property
    def ends(self) -> tuple[float, float]:
        """The outer edges of the first and the last place."""
        half = (
            (self.places[-1] - self.places[0]) / (len(self.places) - 1) / 2 if len(self.places) > 1 else 0.5
        )
        return float(self.places[0] - half), float(self.places[-1] + half)


def axis_label(axis: Axis) -> str:
    """What stands along a state axis: its name and unit; whole numbers without one count cells."""
    unit = "cell" if axis.unit == "1" and axis.values.dtype.kind in "iu" else axis.unit
    name = SPELLED_OUT.get(axis.name, axis.name)
    return name if unit in ("", "1") else f"{name} ({unit})"


def sides(family: Family) -> tuple[Side, ...]:
    """The state axes as they are drawn; cells are counted downwards, as the rows of a matrix."""
    import numpy as np

    return tuple(
        Side(axis_label(axis), axis.values.astype(np.float64), downwards=axis.values.dtype.kind in "iu")
        for axis in family.axes()
    )


def ticks(axis: DrawnAxis, side: Side) -> None:
    """A few numbers along the axis; whole ones where the places are cells, between which nothing stands."""
    from matplotlib.ticker import MaxNLocator

    whole = bool((side.places % 1 == 0).all())
    axis.set_major_locator(MaxNLocator(5 if whole else 4, steps=[1, 2, 2.5, 5, 10], integer=whole))
    plain_numbers(axis)
