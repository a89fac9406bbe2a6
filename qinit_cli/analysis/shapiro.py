"""Shapiro-Wilk's test of normality for many samples of one size at once.

Royston's algorithm AS R94 (Applied Statistics 44, 1995), sizes 4 to 5,000. The normal quantiles and tails
are exact here; scipy.stats.shapiro approximates them, so that the two agree to about 1e-8.
"""

from __future__ import annotations

import math

import numpy as np

from qinit_cli.arrays import Floats
from qinit_cli.elementary import ln

# Royston's polynomials, lowest power first: in 1/sqrt(n) the two outer weights, in n the small samples'
# bound, location and log scale, in ln n the larger samples' location and log scale.
_OUTER = (0.0, 0.221157, -0.147981, -2.071190, 4.434685, -2.706056)
_SECOND = (0.0, 0.042981, -0.293762, -1.752461, 5.682633, -3.582633)
_SMALL_BOUND = (-2.273, 0.459)
_SMALL_LOCATION = (0.5440, -0.39978, 0.025054, -6.714e-4)
_SMALL_SCALE = (1.3822, -0.77857, 0.062767, -0.0020322)
_LOCATION = (-1.5861, -0.31082, -0.083751, 0.0038915)
_SCALE = (-0.4803, -0.082676, 0.0030302)

_SMALL = 11  # the largest size with a transformation of its own


def shapiro_wilk(ordered: Floats) -> tuple[Floats, Floats]:
    """W and p of samples (C, n) in ascending order, none of zero range; each (C,)."""
    from scipy.special import ndtr

    lack = lack_of_fit(ordered, weights(ordered.shape[1]))
    n = float(ordered.shape[1])
    logarithm = ln(lack)
    if n > _SMALL:
        normal = (logarithm - _polynomial(_LOCATION, math.log(n))) / math.exp(
            _polynomial(_SCALE, math.log(n))
        )
        return 1 - lack, ndtr(-normal)
    # W has a lower bound, so that the bound on its logarithm is out of reach for every size from 4 on
    transformed = -ln(_polynomial(_SMALL_BOUND, n) - logarithm)
    normal = (transformed - _polynomial(_SMALL_LOCATION, n)) / math.exp(_polynomial(_SMALL_SCALE, n))
    return 1 - lack, ndtr(-normal)


def lack_of_fit(ordered: Floats, weight: Floats) -> Floats:
    """1 - W, (...,), of samples (..., n) in ascending order: taken directly, it keeps its digits near 0."""
    deviations = ordered - ordered.mean(axis=-1, keepdims=True)
    deviations /= ordered[..., -1:] - ordered[..., :1]
    fitted = np.sum(deviations * weight, axis=-1)
    size = np.sqrt(np.sum(deviations**2, axis=-1) * np.sum(weight**2))
    lack: Floats = (size - fitted) * (size + fitted) / size**2
    return lack


def weights(n: int) -> Floats:
    """Weights of the order statistics, (n,), antisymmetric, their squares summing to 1."""
    from scipy.special import ndtri

    scores = ndtri((np.arange(1, n + 1) - 0.375) / (n + 0.25))
    size = np.sqrt(np.sum(scores**2))
    outer = _polynomial(_OUTER, n**-0.5) + scores[-1] / size
    second = _polynomial(_SECOND, n**-0.5) + scores[-2] / size
    replaced = [outer, second] if n > 5 else [outer]
    ends = len(replaced)
    rest = np.sum(scores[ends:-ends] ** 2) / (1 - 2 * np.sum(np.square(replaced)))
    weight = scores / np.sqrt(rest)
    weight[-ends:] = replaced[::-1]
    weight[:ends] = -weight[: -ends - 1 : -1]
    return np.asarray(weight)


def _polynomial(coefficients: tuple[float, ...], at: float) -> float:
    return float(np.polynomial.polynomial.polyval(at, coefficients))
