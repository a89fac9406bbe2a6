"""Goals around a mean: a normal rounded to the cells of a grid, redrawn off the grid and at the target start (0, 0)."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import numpy as np

    from qinit_cli.arrays import Floats

LEAST_MASS = (
    0.01  # of the normal that must lie on the grid: below it, redrawing would change the distribution
)


@dataclass(frozen=True)
class NormalGoals:
    """A normal around (row, column), with the same variance along both; ValueError if it hardly meets the grid."""

    size: int
    row: float
    column: float
    variance: float

    def __post_init__(self) -> None:
        if self._mass_on_grid() < LEAST_MASS:
            mean = f"{self.row:g}" if self.row == self.column else f"{self.row:g}:{self.column:g}"
            raise ValueError(
                f"goals with mean {mean} and variance {self.variance:g} fall on the {self.size} x {self.size} grid, "
                f"start apart, less than once in 100 draws; choose a mean on the grid"
            )

    def draw(self, rng: np.random.Generator) -> tuple[int, int]:
        """A goal's row and column."""
        row, column = 0, 0
        while (row, column) == (0, 0) or not (0 <= row < self.size and 0 <= column < self.size):
            place = rng.normal((self.row, self.column), math.sqrt(self.variance))
            row, column = (round(float(coordinate)) for coordinate in place)
        return row, column

    def probabilities(self) -> Floats:
        """How likely each cell is to be the goal, (S,)."""
        import numpy as np

        down, across = (
            np.array([self._within(mean, cell - 0.5, cell + 0.5) for cell in range(self.size)])
            for mean in (self.row, self.column)
        )
        probabilities: Floats = np.outer(down, across).ravel()
        probabilities[0] = 0.0
        probabilities /= probabilities.sum()
        return probabilities

    def _mass_on_grid(self) -> float:
        """The probability that one draw is on the grid and not the target start."""
        on_grid, at_start = (
            self._within(self.row, -0.5, edge) * self._within(self.column, -0.5, edge)
            for edge in (self.size - 0.5, 0.5)
        )
        return on_grid - at_start

    def _within(self, mean: float, low: float, high: float) -> float:
        deviation = math.sqrt(self.variance)
        if mean + deviation == mean:  # every draw is the mean, rounded as draws are
            return float(low < round(mean) < high)
        near, far = sorted((high - mean, low - mean), key=abs)
        if near * far > 0:  # on one side of the mean, where differences of erf would lose the tails
            tails = [math.erfc(abs(edge) / deviation / math.sqrt(2)) for edge in (near, far)]
            return (tails[0] - tails[1]) / 2
        return (
            math.erf((high - mean) / deviation / math.sqrt(2))
            - math.erf((low - mean) / deviation / math.sqrt(2))
        ) / 2
