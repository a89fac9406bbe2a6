"""p-values adjusted for how many were asked; NaN (not testable) is left out of the count and stays NaN."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from qinit_cli.arrays import Floats


def holm(p: Floats) -> Floats:
    """Family-wise error by Holm's (1979) step-down, any dependence; same shape as `p`."""
    return _adjusted(p, lambda sorted_p: np.maximum.accumulate(sorted_p * np.arange(len(sorted_p), 0, -1)))


def benjamini_hochberg(p: Floats) -> Floats:
    """False discovery rate by Benjamini and Hochberg (1995), independent or positively dependent tests."""
    return _adjusted(p, _step_up)


def benjamini_yekutieli(p: Floats) -> Floats:
    """False discovery rate by Benjamini and Yekutieli (2001), any dependence: about ln m times BH."""
    return _adjusted(p, lambda sorted_p: _step_up(sorted_p) * np.sum(1.0 / np.arange(1, len(sorted_p) + 1)))


def _step_up(sorted_p: Floats) -> Floats:
    share = np.arange(1, len(sorted_p) + 1) / len(sorted_p)
    return np.minimum.accumulate((sorted_p / share)[::-1])[::-1]


def _adjusted(p: Floats, adjust: Callable[[Floats], Floats]) -> Floats:
    tested = ~np.isnan(p)
    asked = p[tested]
    order = np.argsort(asked)
    values = np.empty_like(asked)
    values[order] = np.minimum(adjust(asked[order]), 1.0)
    adjusted = np.full(p.shape, np.nan)
    adjusted[tested] = values
    return adjusted
