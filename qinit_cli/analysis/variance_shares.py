"""What decides a number: the share of its variance by factor, from least squares on the levels of categories.

The share of a factor is what its levels add to R^2, averaged over all orders in which the factors may be taken in (Lindeman,
Merenda and Gold, 1980; the Shapley value of R^2). On a balanced grid every order gives the same, and it is the factor's sum of
squares over the total, as in any analysis of variance; where the grid has gaps factors share what they explain together.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from qinit_cli.arrays import Floats, Integers

MOST_FACTORS = 12  # of which all 4096 sets are fitted


@dataclass(frozen=True)
class VarianceShares:
    """Shares of the total sum of squares, which together are 1."""

    main: Floats  # (F,) of each factor
    interactions: float  # what combinations of factors add to them
    residual: float  # within combinations: source sets and targets
    replicated: bool  # whether any combination came more than once; else the residual is 0 by necessity


def variance_shares(values: Floats, levels: Sequence[Integers]) -> VarianceShares:
    """Shares of the variance of `values` (N,) by F factors, whose level numbers are (N,) each, -1 where a factor has none.

    Such an N is no level: a factor explains differences among those that have it alone. Without variance all are NaN.
    """
    centred = values - values.mean()
    total = float(centred @ centred)
    cells = np.unique(np.stack(levels, axis=1), axis=0, return_inverse=True)[1].ravel()
    replicated = bool(cells.max() + 1 < len(values))
    # what rounding alone leaves of equal values
    if total <= len(values) * (1e-12 * max(1.0, float(np.abs(values).max()))) ** 2:
        return VarianceShares(np.full(len(levels), math.nan), math.nan, math.nan, replicated)
    explained = _explained(centred, levels)
    main = _shapley(explained, len(levels)) / total
    means = np.bincount(cells, centred) / np.bincount(cells)
    residual = float(np.sum((centred - means[cells]) ** 2)) / total
    return VarianceShares(main, max(0.0, 1.0 - residual - float(main.sum())), residual, replicated)


def _explained(centred: Floats, levels: Sequence[Integers]) -> Floats:
    """The sum of squares that each set of factors explains, (2^F,): factor f is in the sets with bit f."""
    columns = [_dummies(own) for own in levels]
    found = np.zeros(1 << len(levels))
    for one in range(1, len(found)):
        design = np.concatenate([own for f, own in enumerate(columns) if one >> f & 1], axis=1)
        # not by normal equations: factors that differ together leave the design short of rank
        fitted = design @ np.linalg.lstsq(design, centred, rcond=None)[0]
        found[one] = fitted @ fitted
    return found


def _dummies(level: Integers) -> Floats:
    """A column for each level, (N, L), centred among those that have one and 0 elsewhere."""
    there = level >= 0
    columns: Floats = (level[:, None] == np.unique(level[there])).astype(np.float64)
    columns[there] -= columns[there].mean(axis=0)
    return columns


def _shapley(explained: Floats, factors: int) -> Floats:
    """What each factor adds, (F,), averaged over all orders."""
    found = np.zeros(factors)
    for one in range(len(explained)):
        before = one.bit_count()
        for f in range(factors):
            if not one >> f & 1:
                weight = (
                    math.factorial(before) * math.factorial(factors - before - 1) / math.factorial(factors)
                )
                found[f] += weight * (explained[one | 1 << f] - explained[one])
    return found
