"""State axes as pictures have them."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

from qinit_cli.plots.style import CLOSED_COLOURS, plain_numbers

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.axis import Axis as DrawnAxis

    from qinit_cli.arrays import Flags, Floats
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


def shown_states(family: Family) -> tuple[tuple[float, ...], ...]:
    """Coordinates of a few states to be shown, the target start first; of tiles those of the continuous states."""
    from qinit_cli.environments.tiled import TiledFamily

    return (family.family if isinstance(family, TiledFamily) else family).shown_states()


def sides(axes: Iterable[Axis]) -> tuple[Side, ...]:
    """The axes as they are drawn; cells are counted downwards, as the rows of a matrix."""
    import numpy as np

    return tuple(
        Side(axis_label(axis), axis.values.astype(np.float64), downwards=axis.values.dtype.kind in "iu")
        for axis in axes
    )


def closed_states(family: Family) -> dict[str, Flags]:
    """The states that no episode is in, (upright, across), by what stands there."""
    return {name: states.reshape(family.shape) for name, states in family.closed().items()}


def without_closed(table: Floats, closed: Mapping[str, Flags]) -> Floats:
    """A table (upright, across) with NaN in the closed states."""
    import numpy as np

    return np.where(np.any(list(closed.values()), axis=0), np.nan, table) if closed else table


def draw_closed(axes: Axes, closed: Mapping[str, Flags], sides: tuple[Side, Side]) -> None:
    """Covers the closed states (upright, across) with the colour of what stands there."""
    import numpy as np
    from matplotlib.colors import ListedColormap

    upright, across = sides
    bottom, top = reversed(upright.ends) if upright.downwards else upright.ends
    for name, states in closed.items():
        axes.imshow(
            np.ma.masked_equal(states, False),
            cmap=ListedColormap([CLOSED_COLOURS[name][1]]),
            origin="upper" if upright.downwards else "lower",
            extent=(*across.ends, bottom, top),
            aspect="auto",
            interpolation="none",
        )


def closed_words(names: Iterable[str]) -> str:
    """What the colours of closed states mean, to follow the label of a scale."""
    there = set(names)
    return "".join(f"; {colour}: {name}" for name, (colour, _) in CLOSED_COLOURS.items() if name in there)


def ticks(axis: DrawnAxis, side: Side) -> None:
    """A few numbers along the axis; whole ones where the places are cells, between which nothing stands."""
    from matplotlib.ticker import MaxNLocator

    whole = bool((side.places % 1 == 0).all())
    axis.set_major_locator(MaxNLocator(5 if whole else 4, steps=[1, 2, 2.5, 5, 10], integer=whole))
    plain_numbers(axis)
