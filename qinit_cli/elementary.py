"""ln, exp and powers of arrays that do not depend on the processor's vector units.

numpy computes them with other instructions where there is AVX-512, and some last bits differ. What is stored or printed is
computed by these: value by value, by the C library, as numpy does elsewhere. The C library itself has two versions, for
processors with FMA (since 2013) and without.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from qinit_cli.arrays import Floats


def ln(x: Floats) -> Floats:
    """Natural logarithm, in the shape of `x`; -inf at 0, NaN below."""
    from scipy.special import xlogy

    return np.asarray(xlogy(1.0, x))


def ln1p(x: Floats) -> Floats:
    """ln(1 + x), in the shape of `x`, with its digits near 0."""
    from scipy.special import log1p

    return np.asarray(log1p(x))


def exp(x: Floats) -> Floats:
    """e to the `x`, in its shape; infinity on overflow."""
    from scipy.special import inv_boxcox

    return np.asarray(inv_boxcox(x, 0.0))  # a parameter of 0 is the exponential function by definition


def power(base: ArrayLike, exponent: ArrayLike) -> Floats:
    """`base` to the `exponent`, elementwise."""
    return np.asarray(np.float_power(base, exponent))  # numpy has no vector version of this one
