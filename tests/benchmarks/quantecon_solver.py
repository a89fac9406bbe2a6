"""Q* of the gridworld with quantecon, to the tolerance that qinit has; building its model is not counted."""

from __future__ import annotations

from functools import cache

import numpy as np
import scipy.sparse
from quantecon.markov import DiscreteDP

SIZE, GOAL, P, GAMMA, TOLERANCE = 30, 20 * 30 + 20, 0.75, 0.95, 1e-12
TASKS = 50  # of a turn


def solve() -> float:
    """Tables made in a turn."""
    model = _model()
    for _ in range(TASKS):
        model.solve(method="modified_policy_iteration", epsilon=TOLERANCE)
    return float(TASKS)


@cache
def _model() -> DiscreteDP:
    cells = SIZE * SIZE
    row, column = np.divmod(np.arange(cells), SIZE)
    last = SIZE - 1
    ways = [(np.maximum(row - 1, 0), column), (np.minimum(row + 1, last), column)]
    ways += [(row, np.maximum(column - 1, 0)), (row, np.minimum(column + 1, last))]
    moves = np.stack([down * SIZE + across for down, across in ways], axis=1)  # (S, 4)
    probabilities = np.full((cells, 4, 4), (1 - P) / 3)
    probabilities[:, np.arange(4), np.arange(4)] = P
    reward = (probabilities * (moves == GOAL)[:, None, :]).sum(axis=2)
    reward[GOAL] = 0.0
    after = np.broadcast_to(moves[:, None, :], probabilities.shape).copy()
    after[GOAL] = GOAL  # and stays there, for nothing
    pairs = np.repeat(np.arange(cells * 4), 4)
    steps = scipy.sparse.csr_matrix((probabilities.ravel(), (pairs, after.ravel())), shape=(cells * 4, cells))
    return DiscreteDP(
        reward.ravel(), steps, GAMMA, np.repeat(np.arange(cells), 4), np.tile(np.arange(4), cells)
    )
