"""The gridworld once more, in plain numpy: what the compiled solvers are compared with."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest

from qinit_cli.environments.gridworld import Gridworld

MOVES = ((-1, 0), (1, 0), (0, -1), (0, 1))  # up, down, left, right


@dataclass(frozen=True)
class Model:
    """One task as arrays: probabilities of the next cell, and the reward of entering the goal, which absorbs."""

    size: int
    goal: tuple[int, int]
    p: float

    @property
    def goal_cell(self) -> int:
        return self.goal[0] * self.size + self.goal[1]

    def next_cells(self) -> Any:
        """Where each move leads, (S, 4)."""
        rows, columns = np.divmod(np.arange(self.size**2), self.size)
        return np.stack(
            [
                np.clip(rows + down, 0, self.size - 1) * self.size
                + np.clip(columns + right, 0, self.size - 1)
                for down, right in MOVES
            ],
            axis=1,
        )

    def transitions(self) -> Any:
        """(S, 4, S)."""
        cells = self.size**2
        found = np.zeros((cells, 4, cells))
        for cell, following in enumerate(self.next_cells()):
            for action in range(4):
                for direction, there in enumerate(following):
                    found[cell, action, there] += self.p if direction == action else (1 - self.p) / 3
        found[self.goal_cell] = 0
        found[self.goal_cell, :, self.goal_cell] = 1
        return found

    def rewards(self) -> Any:
        """(S, 4)."""
        found = self.transitions()[:, :, self.goal_cell].copy()
        found[self.goal_cell] = 0
        return found


def _tasks(family: Gridworld, *drawn: tuple[int, int, float]) -> Any:
    dtype = [(column.name, column.dtype) for column in family.parameters()]
    return np.array(list(drawn), dtype=dtype)


@pytest.fixture
def tasks_of():  # type: ignore[no-untyped-def]
    """Makes tasks by hand: `tasks_of(family, (row, column, p), ...)`."""
    return _tasks


@pytest.fixture
def model():  # type: ignore[no-untyped-def]
    """The class Model."""
    return Model
