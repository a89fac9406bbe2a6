"""Mean, median and quantiles of a log-normal variable from the moments of its logarithm.

Every function takes, per cell and in any common shape, n (how many logarithms), mu (their mean) and squares
(their sum of squares about the mean, SS), and is NaN where n is 0. Below n = 2 every estimator is the maximum
likelihood one. A mean overflows to infinity where the spread is absurd; whoever starts from it clips.
"""

from __future__ import annotations

from collections.abc import Callable
from statistics import NormalDist

import numpy as np

from qinit_cli.arrays import Floats, Integers
from qinit_cli.elementary import exp

Estimator = Callable[[Integers, Floats, Floats], Floats]


def lognormal_mean(n: Integers, mu: Floats, squares: Floats, estimator: str) -> Floats:
    """Estimate of E Q by "mle", "umvue" (Finney 1941), "zellner" (1971) or "shen" (Shen, Brown, Zhi 2006)."""
    return _estimate(MEANS[estimator], _mean_mle, n, mu, squares)


def lognormal_median(n: Integers, mu: Floats, squares: Floats, estimator: str) -> Floats:
    """Estimate of the median of Q by "mle", "umvue" or "zellner"; ValueError for "shen", which has none.

    For few tasks of large spread umvue can be negative: being unbiased leaves it no other way.
    """
    if estimator not in MEDIANS:
        raise ValueError(f"the estimator {estimator} has no median: choose one of {', '.join(MEDIANS)}")
    return _estimate(MEDIANS[estimator], _median_mle, n, mu, squares)


def lognormal_quantile(mu: Floats, sigma: Floats, quantile: float) -> Floats:
    """exp(mu + z sigma) with z = Phi^-1(quantile), 0 < quantile < 1: maximum likelihood only."""
    return exp(mu + NormalDist().inv_cdf(quantile) * sigma)


def _estimate(estimator: Estimator, few: Estimator, n: Integers, mu: Floats, squares: Floats) -> Floats:
    enough = n >= 2
    with np.errstate(over="ignore"):
        many = estimator(np.where(enough, n, 2), mu, np.where(enough, squares, 0.0))
        values = np.where(enough, many, few(np.maximum(n, 1), mu, squares))
    return np.where(n > 0, values, np.nan)


def _mean_mle(n: Integers, mu: Floats, squares: Floats) -> Floats:
    return exp(mu + squares / n / 2)


def _median_mle(n: Integers, mu: Floats, squares: Floats) -> Floats:
    return exp(mu)


def _mean_umvue(n: Integers, mu: Floats, squares: Floats) -> Floats:
    return exp(mu) * confluent_limit((n - 1) / 2, (n - 1) * squares / (4 * n))


def _median_umvue(n: Integers, mu: Floats, squares: Floats) -> Floats:
    return exp(mu) * confluent_limit((n - 1) / 2, -squares / (4 * n))


def _mean_zellner(n: Integers, mu: Floats, squares: Floats) -> Floats:
    variance = squares / (n - 1)
    return exp(mu + variance / 2 - 3 * variance / (2 * n))


def _median_zellner(n: Integers, mu: Floats, squares: Floats) -> Floats:
    variance = squares / (n - 1)
    return exp(mu - 3 * variance / (2 * n))


def _mean_shen(n: Integers, mu: Floats, squares: Floats) -> Floats:
    variance = squares / (n - 1)
    return exp(mu + (n - 1) * variance / (2 * (n + 4) + 3 * variance))


MEANS: dict[str, Estimator] = {
    "mle": _mean_mle,
    "umvue": _mean_umvue,
    "zellner": _mean_zellner,
    "shen": _mean_shen,
}
MEDIANS: dict[str, Estimator] = {
    "mle": _median_mle,
    "umvue": _median_umvue,
    "zellner": _median_zellner,
}


def confluent_limit(b: Floats, z: Floats) -> Floats:
    """The confluent hypergeometric limit function 0F1(; b; z) for b > 0, elementwise; infinity on overflow.

    scipy.special.hyp0f1 is NaN for large b and z < 0. There the plain series cancels once -z exceeds b, so we
    sum it at b + m and b + m + 1, with m large enough, and come down by
    0F1(b; z) = 0F1(b+1; z) + z / (b (b+1)) 0F1(b+2; z),
    which is stable in that direction (it is the recurrence of the Bessel functions J).
    """
    rises = np.where(z < 0, np.ceil(np.maximum(-z - b, 0.0)), 0.0)
    upper, value = _series(b + rises + 1, z), _series(b + rises, z)
    for height in range(int(rises.max(initial=0.0)) - 1, -1, -1):
        at = b + height
        lower = value + z / (at * (at + 1)) * upper
        falls = height < rises
        value, upper = np.where(falls, lower, value), np.where(falls, value, upper)
    return value


def _series(b: Floats, z: Floats) -> Floats:
    term = np.ones(np.broadcast_shapes(np.shape(b), np.shape(z)))
    total = term.copy()
    k = 0
    while np.any(np.abs(term) > 1e-17 * np.abs(total)):
        term = term * (z / ((b + k) * (k + 1)))
        total = total + term
        k += 1
    return total
