# mypy: allow-untyped-defs, allow-untyped-calls
"""cos and sin, written so that eight are computed at once and every machine gives the same bits.

The C library's cosine takes four times as long, and its last bit depends on its version and on the processor.
These are fdlibm's (Sun Microsystems, 1993): reduced by the nearest multiple of pi/2, then the polynomial of
sine or cosine, summed in pairs; within 0.55 units in the last place for |y| below 100.
"""

from __future__ import annotations

import math

import numpy as np

from qinit_cli.kernels.compiled import inlined
from qinit_cli.kernels.parts import part
from qinit_cli.kernels.reals import chosen, nearest

TWO_OVER_PI = 2.0 / math.pi
# pi/2 in two parts; the first has 33 bits, so that its product with a small whole number is exact
HALF_PI, HALF_PI_REST = 1.57079632673412561417, 6.07710050650619224932e-11
C1, C2, C3 = 4.16666666666666019037e-02, -1.38888888888741095749e-03, 2.48015872894767294178e-05
C4, C5, C6 = -2.75573143513906633035e-07, 2.08757232129817482790e-09, -1.13596475577881948265e-11
S1, S2, S3 = -1.66666666666666324348e-01, 8.33333333332248946124e-03, -1.98412698298579493134e-04
S4, S5, S6 = 2.75573137070700676789e-06, -2.50507602534068634195e-08, 1.58969099521155010221e-10


@inlined
def cosine(y):
    """cos(y) for y from -2 pi to 2 pi, one number or eight."""
    turns, sin_r, cos_r = _reduced(y)
    odd = (turns == 1.0) | (turns == -1.0) | (turns == 3.0) | (turns == -3.0)
    magnitude = chosen(odd, sin_r, cos_r)
    kept = (turns == 0.0) | (turns == -1.0) | (turns == 3.0) | (turns == 4.0) | (turns == -4.0)
    return chosen(kept, magnitude, magnitude * -1.0)


@inlined
def sine_and_cosine(y):
    """sin(y) and cos(y) of one number, as `cosine` computes them, for |y| below 100."""
    turns, sin_r, cos_r = _reduced(y)
    quarter = np.int64(turns) & 3
    if quarter == 0:
        return sin_r, cos_r
    if quarter == 1:
        return cos_r, -sin_r
    if quarter == 2:
        return -sin_r, -cos_r
    return -cos_r, sin_r


@part  # as plain Python it takes arrays too
def _reduced(y):
    """The quarter turns next to y, a whole number but float64, and sine and cosine of what is left; one number or eight."""
    turns = nearest(y * TWO_OVER_PI)
    rough = y - turns * HALF_PI
    correction = turns * HALF_PI_REST
    r = rough - correction
    rest = (rough - r) - correction
    z = r * r
    square = z * z

    half = 0.5 * z
    head = 1.0 - half
    tail = z * ((C1 + z * C2) + square * ((C3 + z * C4) + square * (C5 + z * C6)))
    cos_r = head + (((1.0 - head) - half) + (z * tail - r * rest))

    cube = z * r
    tail = (S2 + z * S3) + square * ((S4 + z * S5) + square * S6)
    sin_r = r - ((z * (0.5 * rest - cube * tail) - rest) - cube * S1)
    return turns, sin_r, cos_r
