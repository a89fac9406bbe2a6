"""Text maps of grids as tasks: walls, holes, one start and goals, where steps lead where they are meant to."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from qinit_cli.errors import NotAllowed
from qinit_cli.kernels.worlds import GOAL, LOST
from qinit_cli.task_files.tables import OwnTask

MOVES = {"up": (-1, 0), "down": (1, 0), "left": (0, -1), "right": (0, 1)}
WALL, HOLE, GOALS, START, FREE = "#", "H", "G", "S", ".F "
CELLS = "S (start), G (goal), H (hole), # (wall), and F, . or a space (free)"


def map_task(text: str, named: str) -> tuple[OwnTask, tuple[int, int]]:
    """The task of a map that is `named` so, and how many rows and columns it has; NotAllowed where it is none.

    A step off the map or into a wall stays; a hole ends the episode without the goal.
    """
    rows = text.rstrip("\r\n").splitlines()
    across = len(rows[0]) if rows else 0
    if not across or any(len(row) != across for row in rows):
        lengths = ", ".join(sorted({str(len(row)) for row in rows}, key=int)) or "no"
        raise NotAllowed(f"{named} has rows of {lengths} cells; the rows of a map are of one length")
    known = {*WALL, *HOLE, *GOALS, *START, *FREE}
    for row, cells in enumerate(rows):
        if unknown := next((cell for cell in cells if cell not in known), None):
            raise NotAllowed(
                f"{named} has {unknown!r} in row {row}, column {cells.index(unknown)}; a cell is {CELLS}"
            )
    grid = np.array([list(row) for row in rows])
    starts = np.flatnonzero(grid == START)
    if len(starts) != 1:
        raise NotAllowed(f"{named} has {len(starts)} starts; a map has one, marked by S")
    return OwnTask(
        after=_after(grid),
        probability=np.ones((grid.size, len(MOVES), 1)),
        reward=None,
        start=np.eye(grid.size)[starts[0]],
        open=~np.isin(grid, (WALL, HOLE, GOALS)).ravel(),
    ), (len(rows), across)


def _after(cells: NDArray[np.str_]) -> NDArray[np.int32]:
    """Where each move leads from each cell, (S, 4, 1)."""
    down, across = cells.shape
    row, column = np.divmod(np.arange(cells.size), across)
    moves = np.array(list(MOVES.values()))
    below = np.clip(row[:, None] + moves[:, 0], 0, down - 1)
    beside = np.clip(column[:, None] + moves[:, 1], 0, across - 1)
    to = below * across + beside
    there = cells.ravel()[to]
    here = np.arange(cells.size)[:, None]
    after = np.select([there == GOALS, there == HOLE, there == WALL], [GOAL, LOST, here], to)
    after[np.isin(cells.ravel(), (WALL, HOLE, GOALS))] = LOST
    return after[..., None].astype(np.int32)
