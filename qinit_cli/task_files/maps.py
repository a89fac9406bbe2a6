"""Text maps of grids as tasks: walls, holes, starts and goals, where steps lead where they are meant to."""

from __future__ import annotations

import numpy as np

from qinit_cli.errors import NotAllowed
from qinit_cli.grid_map import MOVES, read_map
from qinit_cli.kernels.worlds import GOAL, LOST
from qinit_cli.task_files.tables import OwnTask


def map_task(text: str, named: str) -> tuple[OwnTask, tuple[int, int]]:
    """The task of a map that is `named` so, and how many rows and columns it has; NotAllowed where it is none.

    A step off the map or into a wall stays; a hole ends the episode without the goal.
    """
    try:
        grid = read_map(text, named, connected=False)
    except ValueError as error:
        raise NotAllowed(str(error)) from error
    if not grid.has_goals:
        raise NotAllowed(f"{named} has no goal; mark one by G")
    states, closed = len(grid.moves), grid.walls | grid.holes
    closed[list(grid.goal_places)] = True
    after = np.where(grid.moves == states + 1, LOST, grid.moves)
    after[np.isin(after, grid.goal_places)] = GOAL
    after[closed] = LOST
    return OwnTask(
        after=after[..., None].astype(np.int32),
        probability=np.ones((states, len(MOVES), 1)),
        reward=None,
        start=np.bincount(grid.starts, minlength=states) / len(grid.starts),
        open=~closed,
    ), grid.shape
