"""Are path lengths normal but for being whole numbers?

Plain Shapiro-Wilk rejects them for the rounding alone. Here the null hypothesis is the rounded normal
itself: the one whose mean and variance are the sample's, and p is the share of its samples whose W is as
low (a parametric bootstrap). Two values are always some rounded normal, so a cell of few lengths is hardly
ever rejected: the smaller the spread, the more conservative the test.
"""

from __future__ import annotations

import numpy as np

from qinit_cli.analysis.normality import Normality, is_testable, normality, samples
from qinit_cli.analysis.shapiro import lack_of_fit, weights
from qinit_cli.arrays import Flags, Floats

RESAMPLES = 999

_VALUES_AT_ONCE = 2_000_000  # of one block of bootstrap samples: what bounds the memory
_SMOOTH = 0.7  # deviation above which rounding adds 1/12 to the variance, to better than 1e-3 of it
_REACH = 6  # whole numbers on either side that a deviation below _SMOOTH can matter to
_HALVINGS = 40


def rounded_normality(
    lengths: Floats, counted: Flags, rng: np.random.Generator, resamples: int = RESAMPLES
) -> Normality:
    """W and its bootstrap p per cell of whole `lengths` (N, STATE, A), of the entries that are `counted`."""
    plain = normality(lengths, counted)
    p = np.full(plain.p.size, np.nan)
    for at, ordered in samples(lengths, counted):
        spread = is_testable(ordered)
        p[at[spread]] = _bootstrap_p(ordered[spread], rng, resamples)
    return Normality(plain.n, plain.statistic, p.reshape(plain.p.shape), plain.skewness, plain.kurtosis)


def dithered(lengths: Floats, rng: np.random.Generator) -> Floats:
    """`lengths` plus U(-1/2, 1/2): whole numbers made continuous; a spread below 1 stays far from normal."""
    return lengths + rng.uniform(-0.5, 0.5, lengths.shape)


def rounded_parameters(mean: Floats, variance: Floats) -> tuple[Floats, Floats]:
    """Mean and deviation of the normal whose rounding has `mean` and `variance` (ddof 0), elementwise."""
    deviation = np.sqrt(np.maximum(variance - 1 / 12, 0.0))
    coarse = deviation < _SMOOTH
    centre = mean.copy()
    centre[coarse], deviation[coarse] = _coarse_parameters(mean[coarse], variance[coarse])
    return centre, deviation


def _bootstrap_p(ordered: Floats, rng: np.random.Generator, resamples: int) -> Floats:
    cells, n = ordered.shape
    if cells == 0:
        return np.zeros(0)
    weight = weights(n)
    observed = lack_of_fit(ordered, weight)
    centre, deviation = rounded_parameters(ordered.mean(axis=1), ordered.var(axis=1))
    # the same normal draws for every cell: rounding keeps their order, so they are sorted once
    draws = np.sort(rng.standard_normal((resamples, n)), axis=1)
    as_bad = np.zeros(cells)
    block = max(1, _VALUES_AT_ONCE // (resamples * n))
    for first in range(0, cells, block):
        part = slice(first, first + block)
        drawn = np.rint(centre[part, None, None] + deviation[part, None, None] * draws)
        as_bad[part] = np.count_nonzero(
            _lack_of_whole(drawn, weight) >= observed[part, None] * (1 - 1e-9), axis=1
        )
    return (as_bad + 1) / (resamples + 1)


def _lack_of_whole(drawn: Floats, weight: Floats) -> Floats:
    """1 - W of whole samples (C, B, n) in order; 0 for one without range, never worse than the observed."""
    constant = drawn[..., -1] == drawn[..., 0]
    drawn[constant, -1] += 1.0
    return np.where(constant, 0.0, lack_of_fit(drawn, weight))


def _coarse_parameters(mean: Floats, variance: Floats) -> tuple[Floats, Floats]:
    """By bisection of the deviation, and of the centre within it, about the whole part of the mean."""
    whole = np.floor(mean)
    low, high = np.full_like(mean, 1e-3), np.full_like(mean, 1.0)
    for _ in range(_HALVINGS // 2):
        deviation = (low + high) / 2
        _, spread = _rounded_moments(_centre(mean - whole, deviation), deviation)
        low, high = np.where(spread < variance, deviation, low), np.where(spread < variance, high, deviation)
    return whole + _centre(mean - whole, low), low


def _centre(mean: Floats, deviation: Floats) -> Floats:
    low, high = mean - 1.0, mean + 1.0
    for _ in range(_HALVINGS):
        middle = (low + high) / 2
        rounded, _ = _rounded_moments(middle, deviation)
        low, high = np.where(rounded < mean, middle, low), np.where(rounded < mean, high, middle)
    return (low + high) / 2


def _rounded_moments(centre: Floats, deviation: Floats) -> tuple[Floats, Floats]:
    from scipy.special import ndtr

    levels = np.arange(-_REACH, _REACH + 2)[:, None]
    edges = ndtr((levels[:-1] + 0.5 - centre) / deviation)
    # of the interior levels; what lies beyond the outer edges is below 1e-12
    chance = np.diff(edges, axis=0)
    inner = levels[1:-1]
    mean = np.sum(inner * chance, axis=0)
    return mean, np.sum((inner - mean) ** 2 * chance, axis=0)
