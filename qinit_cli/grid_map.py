"""The cells of a gridworld: which are free, where episodes start and where goals may be; an open square, or a map in text.

A map has a letter for each cell: # a wall, which keeps the agent in place; . or F or a space a free cell; S a start, 2 to 9 a
start that is drawn so many times as often; G a place for goals; H a hole, which ends the episode without the goal.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from functools import cached_property, lru_cache
from hashlib import sha256
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from qinit_cli.arrays import Flags

MOVES = ("up", "down", "left", "right")  # in the order of GridMap.moves
FREE, WALL, HOLE, GOAL = ".", "#", "H", "G"
STARTS = "S123456789"
LETTERS = f"{FREE}F {WALL}{HOLE}{GOAL}{STARTS}"
SAME = str.maketrans({"F": FREE, " ": FREE, "1": "S"})
NAMED = "# (wall), . or F (free), S or 1 to 9 (start), G (goal) or H (hole)"
LEAST, MOST = 2, 1000  # cells along a side, as of open grids
INLINE = re.compile(f"[{re.escape(LETTERS)}]{{2,}}(/[{re.escape(LETTERS)}]{{2,}})+")  # rows, and no path


@dataclass(frozen=True)
class GridMap:
    """Cells, numbered row * columns + column. Made by `open_map` and `read_map`, which check it."""

    rows: tuple[str, ...]  # as many letters each, of # . H G S 2-9

    @property
    def shape(self) -> tuple[int, int]:
        """How many rows and columns."""
        return len(self.rows), len(self.rows[0])

    @property
    def text(self) -> str:
        """The rows with / between them."""
        return "/".join(self.rows)

    @property
    def label(self) -> str:
        """What tells it from other maps in names of artefacts."""
        return f"map-{sha256(self.text.encode()).hexdigest()[:8]}"

    @cached_property
    def starts(self) -> tuple[int, ...]:
        """The cells where a target's episode may start, those drawn oftener as often."""
        return tuple(
            cell
            for cell, letter in enumerate("".join(self.rows))
            if letter in STARTS
            for _ in range(1 if letter == "S" else int(letter))
        )

    @property
    def start(self) -> int:
        """The likeliest start, the first of equals."""
        return max(self.starts, key=self.starts.count)

    @cached_property
    def goal_places(self) -> tuple[int, ...]:
        """The cells where goals may be: those marked, or every free one that is no start."""
        return tuple(cell for cell, letter in enumerate("".join(self.rows)) if letter == self._goal_letter)

    def is_goal_place(self, row: int, column: int) -> bool:
        """Whether a goal may be there, on the grid or off it."""
        down, across = self.shape
        return 0 <= row < down and 0 <= column < across and self.rows[row][column] == self._goal_letter

    @cached_property
    def _goal_letter(self) -> str:
        return GOAL if self.has_goals else FREE

    @cached_property
    def has_goals(self) -> bool:
        """Whether places for goals are marked."""
        return any(GOAL in row for row in self.rows)

    @property
    def walls(self) -> Flags:
        """Whether each cell is a wall, (S,)."""
        return self._are(WALL)

    @property
    def holes(self) -> Flags:
        """Whether each cell is a hole, (S,)."""
        return self._are(HOLE)

    @cached_property
    def moves(self) -> NDArray[np.int32]:
        """The cell that each of up, down, left and right leads to, (S, 4): itself at a wall, S + 1 into a hole."""
        import numpy as np

        down, across = self.shape
        row, column = np.divmod(np.arange(down * across), across)
        to = np.stack(
            [
                np.maximum(row - 1, 0) * across + column,
                np.minimum(row + 1, down - 1) * across + column,
                row * across + np.maximum(column - 1, 0),
                row * across + np.minimum(column + 1, across - 1),
            ],
            axis=1,
        )
        here = np.arange(len(to))[:, None]
        moves = np.where(self.walls[to] | (self.walls | self.holes)[:, None], here, to).astype(np.int32)
        moves[self.holes[moves] & (moves != here)] = len(to) + 1
        return moves

    def place(self, cell: int) -> tuple[int, int]:
        """A cell's row and column."""
        return divmod(cell, self.shape[1])

    def _are(self, letter: str) -> Flags:
        import numpy as np

        there: Flags = np.frombuffer("".join(self.rows).encode(), np.uint8) == ord(letter)
        return there


@lru_cache(maxsize=16)
def open_map(size: int) -> GridMap:
    """A square of free cells that starts in a corner."""
    row = FREE * size
    return GridMap(("S" + row[1:], *[row] * (size - 1)))


@lru_cache(maxsize=16)
def read_map(text: str, named: str = "--map", *, connected: bool = True) -> GridMap:
    """The map of rows with line breaks or / between them, `named` so in ValueError, one sentence, where it is none.

    `connected`: every free cell must have a way to every other.
    """
    rows = text.replace("/", "\n").rstrip("\r\n").splitlines()
    across = len(rows[0]) if rows else 0
    for at, row in enumerate(rows):
        if unknown := next((letter for letter in row if letter not in LETTERS), None):
            raise ValueError(
                f"{named} has {unknown!r} in row {at}, column {row.index(unknown)}; a cell is {NAMED}"
            )
        if len(row) != across:
            raise ValueError(
                f"{named} has {across} cells in row 0 and {len(row)} in row {at}; give all rows as many"
            )
    if not (LEAST <= len(rows) <= MOST and LEAST <= across <= MOST):
        raise ValueError(
            f"{named} has {len(rows)} rows of {across} cells; it takes {LEAST} to {MOST} of both"
        )
    rows = [row.translate(SAME) for row in rows]
    if not any(letter in STARTS for row in rows for letter in row):
        if rows[0][0] != FREE:
            raise ValueError(f"{named} has no start, and its first cell is not free; mark a start by S")
        rows[0] = "S" + rows[0][1:]
    found = GridMap(tuple(rows))
    if not found.goal_places:
        raise ValueError(f"{named} has no free cell for a goal beside its starts; mark one by . or G")
    if connected:
        _check_connected(found, named)
    return found


def map_text(given: Path) -> str:
    """What a map's file holds; rows with / between them, as the command line takes them too, stand for themselves."""
    if INLINE.fullmatch(given.as_posix()):
        return given.as_posix()
    try:
        with given.open(encoding="ascii", newline="") as file:
            return file.read(MOST * (MOST + 2) + 1)
    except OSError as error:
        raise ValueError(f"--map {given} cannot be read: {error.strerror or error}") from error
    except UnicodeDecodeError as error:
        raise ValueError(f"--map {given} is no text of a map; a cell is {NAMED}") from error


def _check_connected(found: GridMap, named: str) -> None:
    """ValueError where no way leads to a cell."""
    letters = "".join(found.rows)
    reached = _reached(found, letters)
    cut = next(
        (cell for cell, known in enumerate(reached) if not known and letters[cell] not in (WALL, HOLE)), None
    )
    if cut is not None:
        start, there = found.place(found.starts[0]), found.place(cut)
        raise ValueError(
            f"{named} has no way from the start {start} to the cell {there}; open one, or make it a wall"
        )


def _reached(found: GridMap, letters: str) -> list[bool]:
    """Whether a way leads from the first start to each cell; back it leads as well."""
    down, across = found.shape
    reached = [False] * len(letters)
    reached[found.starts[0]] = True
    left = [found.starts[0]]
    while left:
        row, column = found.place(left.pop())
        for r, c in ((row - 1, column), (row + 1, column), (row, column - 1), (row, column + 1)):
            cell = r * across + c
            if 0 <= r < down and 0 <= c < across and not reached[cell] and letters[cell] not in (WALL, HOLE):
                reached[cell] = True
                left.append(cell)
    return reached
