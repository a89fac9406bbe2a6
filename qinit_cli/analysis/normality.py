"""Is a quantity normal over the tasks, cell by cell? Tests, effect sizes, and how many tasks had a say.

"Not rejected" is no evidence of normality: statistic, skewness, kurtosis and n stand beside every p.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial

import numpy as np

from qinit_cli.analysis.empirical_tests import anderson_darling, lilliefors
from qinit_cli.analysis.shapiro import shapiro_wilk
from qinit_cli.arrays import Flags, Floats, Integers

FEWEST_TASKS = 8
MOST_TASKS = 5_000  # beyond, the approximation of W's distribution was not fitted

NormalityTest = Callable[[Floats], tuple[Floats, Floats]]


@dataclass(frozen=True)
class Normality:
    """A test per cell, (STATE, A); NaN where it is not testable: fewer than 8 tasks, or all of them equal."""

    n: Integers
    statistic: Floats
    p: Floats  # raw: see multiplicity for the corrections
    skewness: Floats
    kurtosis: Floats  # excess over the normal's 3


def named_tests(rng: np.random.Generator) -> dict[str, NormalityTest]:
    """Every test by its name; `rng` draws the null distribution of the one that has no formula."""
    return {
        "shapiro-wilk": shapiro_wilk,
        "anderson-darling": anderson_darling,
        "lilliefors": partial(lilliefors, rng=rng),
    }


def normality(values: Floats, counted: Flags, test: NormalityTest = shapiro_wilk) -> Normality:
    """`test` over the first axis of `values` (N, ...), of the entries that are `counted`, in every cell."""
    cells = values.shape[1:]
    n, statistic, p, skewness, kurtosis = (np.full(cells, np.nan).ravel() for _ in range(5))
    for at, ordered in samples(values, counted):
        n[at] = ordered.shape[1]
        spread = is_testable(ordered)
        if not spread.any():  # no test has weights for samples of any size
            continue
        statistic[at[spread]], p[at[spread]] = test(ordered[spread])
        skewness[at[spread]], kurtosis[at[spread]] = _shape(ordered[spread])
    return Normality(
        n=n.reshape(cells).astype(np.int64),
        statistic=statistic.reshape(cells),
        p=p.reshape(cells),
        skewness=skewness.reshape(cells),
        kurtosis=kurtosis.reshape(cells),
    )


def samples(values: Floats, counted: Flags) -> Iterator[tuple[Integers, Floats]]:
    """The cells' samples, those of one size together: flat cell indices (C,) and values (C, n), ascending."""
    tasks = len(values)
    ordered = np.sort(np.where(counted, values, np.inf).reshape(tasks, -1).T, axis=1)
    n = np.count_nonzero(counted.reshape(tasks, -1), axis=0)
    for size in np.unique(n):
        at = np.flatnonzero(n == size)
        yield at, ordered[at, :size]


def is_testable(ordered: Floats) -> Flags:
    """Which samples (C, n) have enough tasks and any spread, (C,)."""
    if ordered.shape[1] < FEWEST_TASKS:
        return np.zeros(len(ordered), dtype=np.bool_)
    return np.asarray(ordered[:, -1] > ordered[:, 0])


def tasks_tested(tasks: int, rng: np.random.Generator, most: int = MOST_TASKS) -> Integers:
    """Indices of the tasks that are tested, ascending: all, or `most` of them drawn without replacement."""
    if tasks <= most:
        return np.arange(tasks)
    return np.sort(rng.choice(tasks, most, replace=False))


def _shape(ordered: Floats) -> tuple[Floats, Floats]:
    deviations = ordered - ordered.mean(axis=1, keepdims=True)
    deviations /= deviations.std(axis=1, keepdims=True)
    squares = deviations**2  # products alone: a power's last bit depends on the processor
    return np.mean(squares * deviations, axis=1), np.mean(squares**2, axis=1) - 3
