"""Do path lengths explain the values, as the paper's propositions 1 to 5 say?

Equation (1) says Q = gamma^H times the probability of the most likely path. Two things are off: with the
reward paid on entering the goal a certain path of H steps is worth gamma^(H-1); and the product counts only
the tries in which nothing slips, though a slip is recovered from. So ln Q is predicted twice, by the
product form as printed and by the length alone, and both are set beside the actual value.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from qinit_cli.arrays import Flags, Floats, Integers
from qinit_cli.elementary import exp, ln

FEWEST_TASKS = 3  # two points lie on a line whatever they are


@dataclass(frozen=True)
class Prediction:
    """Predicted against actual values per state-action, (STATE, A); NaN where no task has both."""

    bias: Floats  # mean over tasks of predicted - actual ln Q
    spread: Floats  # root mean square of predicted - actual ln Q
    mean_ratio: Floats  # mean predicted over mean actual Q: what propositions 2 to 4 are about


@dataclass(frozen=True)
class Theory:
    """Both predictions, and how much of the variance of ln Q over tasks the path length explains, (STATE, A).

    Shares are NaN for fewer than three tasks or where ln Q does not vary.
    """

    n: Integers  # tasks with Q > 0 and a path of at least one step
    variance: Floats  # of ln Q over these tasks, ddof 0; NaN where there is none
    product: Prediction  # gamma^H times the path's probability: equation (1)
    length: Prediction  # gamma^(H-1)
    explained: Floats  # by the best straight line in H: the squared correlation; 0 where H does not vary
    explained_by_gamma: Floats  # by the slope ln gamma itself; below 0 where it explains less than nothing

    @property
    def pooled(self) -> float:
        """`explained` over all cells together."""
        return pooled_share(self.explained, self.n * self.variance)


def pooled_share(explained: Floats, squares: Floats) -> float:
    """1 - sum of residual over sum of total `squares`, of the cells whose share is known; NaN where none is."""
    known = ~np.isnan(explained)
    total = squares[known]
    return float(np.sum(explained[known] * total) / total.sum()) if known.any() else float("nan")


def theory(q: Floats, eopl: NDArray[np.integer], gamma: float, log_path: Floats) -> Theory:
    """What `eopl` (N, STATE, A) says of `q` (N, STATE, A), where Q > 0 and H >= 1.

    `log_path` is ln of the probability of the path of most likely steps, (N, STATE, A) or anything that
    stretches to it; where every step has the same probability p that is H ln p.
    """
    counted = (q > 0) & (eopl >= 1)
    logs = ln(np.where(counted, q, 1.0))
    lengths = np.where(counted, eopl, 1).astype(np.float64)
    n = counted.sum(axis=0)
    slope = math.log(gamma)
    length_form = (lengths - 1) * slope
    product_form = lengths * slope + np.where(counted, log_path, 0.0)
    total = _squares(logs, counted)
    line = np.maximum(total - _explained_squares(logs, lengths, counted), 0.0)
    varies = (n >= FEWEST_TASKS) & (total > 1e-20 * np.maximum(1.0, n))
    return Theory(
        n=n,
        variance=np.where(n > 0, total / np.maximum(n, 1), np.nan),
        product=_prediction(product_form, logs, counted),
        length=_prediction(length_form, logs, counted),
        explained=_share(line, total, varies),
        explained_by_gamma=_share(_squares(logs - lengths * slope, counted), total, varies),
    )


def _prediction(predicted: Floats, actual: Floats, counted: Flags) -> Prediction:
    error = predicted - actual
    return Prediction(
        bias=_mean(error, counted),
        spread=np.sqrt(_mean(error**2, counted)),
        mean_ratio=_mean(exp(predicted), counted) / _mean(exp(actual), counted),
    )


def _mean(values: Floats, counted: Flags) -> Floats:
    n = counted.sum(axis=0)
    return np.where(n > 0, np.sum(values, axis=0, where=counted) / np.maximum(n, 1), np.nan)


def _centred(values: Floats, counted: Flags) -> Floats:
    mean = np.sum(values, axis=0, where=counted) / np.maximum(counted.sum(axis=0), 1)
    return np.where(counted, values - mean, 0.0)


def _squares(values: Floats, counted: Flags) -> Floats:
    return np.asarray(np.sum(_centred(values, counted) ** 2, axis=0))


def _explained_squares(values: Floats, by: Floats, counted: Flags) -> Floats:
    """Sum of squares of `values` on the regression line in `by`; 0 where `by` does not vary."""
    against = _centred(by, counted)
    spread = np.sum(against**2, axis=0)
    covariance = np.sum(against * _centred(values, counted), axis=0)
    return np.asarray(covariance**2 / np.where(spread > 0, spread, 1.0))


def _share(residual: Floats, total: Floats, varies: Flags) -> Floats:
    return np.where(varies, 1 - residual / np.where(varies, total, 1.0), np.nan)
