"""What stands where no source knows a state-action: stated and counted, never silent."""

from __future__ import annotations

import numpy as np

from qinit_cli.arrays import Flags, Floats


def filled(values: Floats, known: Flags, fallback: float) -> tuple[Floats, int]:
    """`values` with `fallback` where not `known`, and how many entries that is; all arrays of one shape."""
    return np.where(known, values, fallback), int(known.size - np.count_nonzero(known))


def largest_known(values: Floats, known: Flags) -> float:
    """The largest of the `known` values, the fallback of optimistic methods; 0 where nothing is known."""
    return float(np.max(values, where=known, initial=-np.inf)) if known.any() else 0.0
