"""The probability of a gridworld's path, against a walk through its transition matrix."""

from __future__ import annotations

import numpy as np
import pytest

from qinit_cli.environments.gridworld import Gridworld
from qinit_cli.environments.mountain_car import MountainCar
from qinit_cli.errors import NotAllowed

MOVES = ((-1, 0), (1, 0), (0, -1), (0, 1))


def _after(size: int, cell: int, direction: int) -> int:
    row, column = cell // size + MOVES[direction][0], cell % size + MOVES[direction][1]
    return row * size + column if 0 <= row < size and 0 <= column < size else cell


def _chances(size: int, p: float, cell: int, action: int) -> dict[int, float]:
    """The probability of each next cell."""
    found: dict[int, float] = {}
    for direction in range(4):
        there = _after(size, cell, direction)
        found[there] = found.get(there, 0.0) + (p if direction == action else (1 - p) / 3)
    return found


@pytest.mark.parametrize("p", [0.25, 0.3, 0.39, 0.45, 0.75, 1.0])
def test_the_chance_of_a_path_is_the_product_of_its_steps(p: float) -> None:
    family = Gridworld(size=4, goals="uniform", p_low=0.25, p_high=1)
    tasks = np.array([(2, 1, p), (0, 3, p)], [("goal_row", "i4"), ("goal_col", "i4"), ("p", "f8")])
    q, _ = family.solve(tasks, 0.9)
    lengths = family.path_lengths(tasks, q, 1_000)
    found = family.log_path(tasks, lengths)
    walked = 0
    for task, goal in enumerate((9, 3)):
        for cell, action in np.ndindex(16, 4):
            if lengths[task, cell, action] < 1:
                continue
            total, at, act = 0.0, cell, action
            for _ in range(lengths[task, cell, action]):
                probabilities = _chances(4, p, at, act)
                most = max(probabilities.values())
                total += np.log(most)
                meant = _after(4, at, act)
                likely = [there for there, probability in probabilities.items() if probability > most - 1e-9]
                at = meant if meant in likely else min(likely)
                act = int(q[task, at].argmax())
            assert at == goal
            assert found[task, cell, action] == pytest.approx(total, abs=1e-9), (cell, action)
            walked += 1
    assert walked > 10  # where all ways are equal few paths arrive


def test_pushes_of_every_step_give_a_path_no_chance() -> None:
    tasks = np.array([(0.0,)], [("eta", "f8")])
    with pytest.raises(NotAllowed, match="no path has a probability"):
        MountainCar(noise_per="step").log_path(tasks, np.ones((1, 900, 3), int))
