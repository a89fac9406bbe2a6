"""Products of a matrix of counts and a table, without BLAS: its order of summation depends on the processor."""

from __future__ import annotations

from typing import Any

import numpy as np

from qinit_cli.arrays import Floats

_WIDE = 32  # columns from which a loop over them is worth its start


def weighted_sums(counts: Any, values: Floats) -> Floats:
    """Sums of `values` (V, M) weighted by each row of `counts` (B, V), (B, M); the same bits on every processor."""
    if values.shape[1] >= _WIDE:
        wide: Floats = np.einsum("bv,vm->bm", counts, values, optimize=False)
        return wide
    narrow: Floats = np.einsum("bv,mv->bm", counts, np.ascontiguousarray(values.T), optimize=False)
    return narrow
