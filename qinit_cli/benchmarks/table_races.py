"""Exact tables, fits and comparisons, beside what one writes with scipy and numpy."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from qinit_cli.analysis.intervals import over_targets, tails
from qinit_cli.analysis.resampling import RESAMPLES
from qinit_cli.arrays import Floats, Tasks
from qinit_cli.benchmarks.race import Race, Runner
from qinit_cli.environments.family import draw_tasks
from qinit_cli.environments.gridworld import Gridworld
from qinit_cli.fitted import FitOptions
from qinit_cli.pipeline import fit as stage
from qinit_cli.seeding import Stream

TASKS = 100  # that are fitted
TARGETS, METRICS = 200, 5  # that are compared: the paper's targets, and what a row of compare averages

Tables = dict[str, Any]


def exact(tasks: int) -> Race:
    """Q* of gridworlds by Gauss-Seidel sweeps, against policy iteration with a sparse LU factorisation."""
    family, size = Gridworld(), 30
    drawn = draw_tasks(family, 0, Stream.SOURCE_TASK, np.arange(tasks))
    gamma = family.source_learning.gamma

    def ours() -> float:
        family.solve(drawn, gamma)
        return float(tasks)

    def theirs() -> float:
        for row, column, p in drawn.tolist():
            policy_iteration(size, row * size + column, p, gamma)
        return float(tasks)

    case = f"a {size} x {size} gridworld"
    return Race("exact", case, "ms", Runner("qinit", ours), [Runner("scipy sparse policy iteration", theirs)])


def policy_iteration(size: int, goal: int, p: float, gamma: float) -> Floats:
    """Q* of a gridworld, (S, 4), each policy's value by one sparse solve."""
    from scipy.sparse import csc_matrix, identity
    from scipy.sparse.linalg import spsolve

    cells, slip = size * size, (1 - p) / 3
    moves = _moves(size)
    probabilities = np.full((cells, 4, 4), slip)  # of each way, by action
    probabilities[:, np.arange(4), np.arange(4)] = p
    probabilities[goal] = 0.0
    reward = (probabilities * (moves == goal)[:, None, :]).sum(axis=2)
    every, policy = np.arange(cells), np.zeros(cells, np.int64)
    while True:
        chosen = probabilities[every, policy].ravel()
        step = csc_matrix((chosen, (np.repeat(every, 4), moves.ravel())), shape=(cells, cells))
        value = spsolve(identity(cells, format="csc") - gamma * step, reward[every, policy])
        value[goal] = 0.0
        q: Floats = reward + gamma * (probabilities * value[moves][:, None, :]).sum(axis=2)
        better = q.max(axis=1) > q[every, policy] + 1e-13  # else equals take turns for ever
        if not better.any():
            return q
        policy = np.where(better, q.argmax(axis=1), policy)


def fit() -> Race:
    """The moments, log-normal parameters and library of 100 tables, against numpy over the whole stack, twice."""
    blocks = list(_blocks())
    options = FitOptions()
    selection = stage.Selection(np.ones(TASKS, np.bool_), 0, 0)
    q = np.concatenate([block["q"] for block in blocks])
    eopl = np.concatenate([block["eopl"] for block in blocks])

    def ours() -> float:
        stage.fit(blocks, selection, options)
        return 1.0

    def theirs() -> float:
        two_passes(q, eopl)
        return 1.0

    return Race("fit", f"{TASKS} tables", "ms", Runner("qinit", ours), [Runner("numpy, two passes", theirs)])


def two_passes(q: Floats, eopl: Floats) -> Tables:
    """Statistics of tables (N, S, A) per state-action, the unknown masked by NaN."""
    import warnings

    with warnings.catch_warnings(), np.errstate(divide="ignore"):
        warnings.simplefilter("ignore", RuntimeWarning)  # of state-actions that no table knows
        known = np.where(q > 0, q, np.nan)
        log_q = np.log(known)
        arrived = np.where(eopl >= 0, eopl, np.nan)
        return {
            "mu": np.nanmean(log_q, axis=0),
            "sigma": np.nanstd(log_q, axis=0),
            "mean": np.nanmean(known, axis=0),
            "std": np.nanstd(known, axis=0),
            "min": np.nanmin(known, axis=0),
            "max": np.nanmax(known, axis=0),
            "n": np.isfinite(log_q).sum(axis=0),
            "eopl_mean": np.nanmean(arrived, axis=0),
            "eopl_std": np.nanstd(arrived, axis=0),
            "value_mean": q.max(axis=2).mean(axis=0),
        }


def compare() -> Race:
    """Bootstrap intervals of one row of a comparison, against a Python loop of numpy resamples."""
    values = np.random.default_rng(0).normal(size=(TARGETS, METRICS))

    def ours() -> float:
        over_targets(values, np.random.default_rng(0))
        return 1.0

    def theirs() -> float:
        bootstrap(values, np.random.default_rng(0))
        return 1.0

    case = f"{RESAMPLES} resamples of {TARGETS} targets"
    return Race("compare", case, "ms", Runner("qinit", ours), [Runner("a loop of numpy resamples", theirs)])


def bootstrap(values: Floats, rng: np.random.Generator) -> tuple[Floats, Floats]:
    """95 % percentile bounds of the means of `values` (T, M), (M,) each."""
    count = len(values)
    means = [values[rng.integers(0, count, count)].mean(axis=0) for _ in range(RESAMPLES)]
    low, high = np.quantile(means, tails(len(values)), axis=0)
    return low, high


def _blocks() -> Iterator[stage.Block]:
    """Exact tables as the fit reads them."""
    family = Gridworld()
    drawn: Tasks = draw_tasks(family, 0, Stream.SOURCE_TASK, np.arange(TASKS))
    for first in range(0, TASKS, stage.BLOCK):
        tasks = drawn[first : first + stage.BLOCK]
        q, td_var = family.solve(tasks, family.source_learning.gamma)
        eopl = family.path_lengths(tasks, q, family.source_learning.horizon)
        ids = np.arange(first, first + len(tasks))
        yield {"task": ids, "q": q, "td_var": td_var, "eopl": eopl}


def _moves(size: int) -> np.ndarray[tuple[int, int], np.dtype[np.int64]]:
    """The cell that each way leads to, (S, 4): up, down, left, right."""
    row, column = np.divmod(np.arange(size * size), size)
    last = size - 1
    ways = [(np.maximum(row - 1, 0), column), (np.minimum(row + 1, last), column)]
    ways += [(row, np.maximum(column - 1, 0)), (row, np.minimum(column + 1, last))]
    return np.stack([down * size + across for down, across in ways], axis=1)
