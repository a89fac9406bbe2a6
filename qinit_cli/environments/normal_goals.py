"""Goals around a mean: a normal rounded to the cells of a grid, redrawn where no goal may be: off the grid, and at starts."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache
from typing import TYPE_CHECKING

from qinit_cli.grid_map import GridMap

if TYPE_CHECKING:
    import numpy as np

    from qinit_cli.arrays import Floats

LEAST_MASS = (
    0.01  # of the normal that must lie on the grid: below it, redrawing would change the distribution
)


@dataclass(frozen=True)
class NormalGoals:
    """A normal around (row, column), with the same variance along both; ValueError if it hardly meets places for goals.

    As many as `several` goals are drawn for a task: it must meet places for goals without the likeliest ones as well.
    """

    grid: GridMap
    row: float
    column: float
    variance: float
    several: int = 1

    def __post_init__(self) -> None:
        if _left(self) < LEAST_MASS:
            mean = f"{self.row:g}" if self.row == self.column else f"{self.row:g}:{self.column:g}"
            rows, columns = self.grid.shape
            last = f" for the last of {self.several} goals" if self.several > 1 else ""
            remedy = "a larger variance or fewer goals" if last else "a mean on the grid"
            raise ValueError(
                f"goals with mean {mean} and variance {self.variance:g} fall on the {rows} x {columns} grid, "
                f"start and walls apart, less than once in 100 draws{last}; choose {remedy}"
            )

    def draw(self, rng: np.random.Generator) -> tuple[int, int]:
        """A goal's row and column."""
        while True:
            place = rng.normal((self.row, self.column), math.sqrt(self.variance))
            row, column = (round(float(coordinate)) for coordinate in place)
            if self.grid.is_goal_place(row, column):
                return row, column

    def probabilities(self) -> Floats:
        """How likely each cell is to be a goal, drawn alone, (S,)."""
        import numpy as np

        probabilities: Floats = np.zeros(len(self.grid.moves))
        places = list(self.grid.goal_places)
        probabilities[places] = np.outer(*self._along()).ravel()[places]
        probabilities /= probabilities.sum()
        return probabilities

    def _along(self) -> tuple[list[float], list[float]]:
        """The probability of each row and of each column."""
        rows, columns = (
            [self._within(mean, cell - 0.5, cell + 0.5) for cell in range(cells)]
            for mean, cells in zip((self.row, self.column), self.grid.shape, strict=True)
        )
        return rows, columns

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


@lru_cache(maxsize=64)
def _left(goals: NormalGoals) -> float:
    """The probability that one draw meets a place for goals that is none of the likeliest, as many as the other goals."""
    down, across = goals._along()
    places = (goals.grid.place(cell) for cell in goals.grid.goal_places)
    masses = [down[row] * across[column] for row, column in places]
    return math.fsum(masses) - math.fsum(sorted(masses)[len(masses) - goals.several + 1 :])
