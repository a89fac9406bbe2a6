"""Tile coding: several grids over a box, each shifted by another part of a tile (Sutton & Barto, 2018, section 9.5.4)."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

from qinit_cli.errors import NotAllowed

if TYPE_CHECKING:
    from qinit_cli.arrays import Floats, Integers

MOST_DIMENSIONS = 4
MOST_WEIGHTS = 4_000_000  # of an action: 32 MB a task


@dataclass(frozen=True)
class TileCoding:
    """`tilings` grids of `tiles` tiles along each of D dimensions.

    Grid i is shifted by (2 d + 1) i / tilings of a tile along dimension d, modulo a tile. Shifted grids have one tile more, so
    that each covers the box. States beyond the box are in its outermost tiles, NaN in the
    lowest. NotAllowed where the weights would be too many.
    """

    low: tuple[float, ...]  # (D,)
    high: tuple[float, ...]  # (D,)
    tilings: int
    tiles: int

    def __post_init__(self) -> None:
        dimensions = len(self.low)
        told = f"{self.tilings} tilings of {self.tiles} tiles along {dimensions} dimensions"
        if dimensions > MOST_DIMENSIONS:
            raise NotAllowed(
                f"{told} are {self.weights} weights an action; tiles are for up to {MOST_DIMENSIONS} dimensions: "
                "name fewer of them, or learn a table"
            )
        if self.weights > MOST_WEIGHTS:
            raise NotAllowed(
                f"{told} are {self.weights} weights an action, and at most {MOST_WEIGHTS} are kept; ask for fewer --tiles"
            )

    @property
    def lengths(self) -> tuple[int, ...]:
        """Tiles of a grid along each dimension, (D,)."""
        return (self.tiles + (self.tilings > 1),) * len(self.low)

    @property
    def weights(self) -> int:
        """Tiles of all grids: the weights of an action."""
        return self.tilings * math.prod(self.lengths)

    def scales(self) -> Floats:
        """Tiles for a unit of each dimension, (D,)."""
        import numpy as np

        return np.array([self.tiles / (high - low) for low, high in zip(self.low, self.high, strict=True)])

    def offsets(self) -> Floats:
        """The shift of each grid along each dimension, (D, tilings), in tiles."""
        import numpy as np

        grid = np.arange(self.tilings)
        odd = 2 * np.arange(len(self.low))[:, None] + 1
        shifts: Floats = (odd * grid % self.tilings) / self.tilings
        return shifts

    def strides(self) -> Integers:
        """Tiles between neighbours along each dimension, (D,): the last dimension's are 1 apart."""
        import numpy as np

        return np.array([math.prod(self.lengths[place + 1 :]) for place in range(len(self.low))], np.int64)

    def first(self) -> Integers:
        """The first tile of each grid, (tilings,)."""
        import numpy as np

        return np.arange(self.tilings) * math.prod(self.lengths)

    def active(self, states: Floats) -> Integers:
        """The active tile of each grid in some states (N, D): (N, tilings)."""
        import numpy as np

        inside = (states - np.array(self.low)) * self.scales()
        # below the box's end, else the unshifted grids would have a tile for that alone; NaN counts as low
        inside = np.fmin(np.fmax(inside, 0.0), np.nextafter(self.tiles, 0.0))
        along = (inside[:, :, None] + self.offsets()).astype(np.int64)
        tiles: Integers = (along * self.strides()[:, None]).sum(axis=1) + self.first()
        return tiles
