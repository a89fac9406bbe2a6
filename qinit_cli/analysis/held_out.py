"""How far an initial table is from the tables of tasks it was not fitted on: the deciding figure of a fit."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from qinit_cli.arrays import Floats
from qinit_cli.elementary import ln


@dataclass(frozen=True)
class HeldOutError:
    """Errors per held-out task, (N,), over its state-actions: methods compare in pairs on the same tasks."""

    absolute: Floats  # mean |start - Q|
    squared: Floats  # root of the mean square
    bias: Floats  # mean start - Q: above 0 is optimism
    logarithmic: Floats  # mean |ln start - ln Q|; NaN where no entry has both above 0
    log_share: Floats  # the share of entries that have, so that `logarithmic` can be judged


def held_out_error(start: Floats, q: Floats) -> HeldOutError:
    """Errors of the initial table `start` (STATE, A) against each of the tables `q` (N, STATE, A)."""
    tables = q.reshape(len(q), -1)
    table = start.ravel()
    error = table - tables
    both = (table > 0) & (tables > 0)
    ratio = ln(np.where(both, table, 1.0)) - ln(np.where(both, tables, 1.0))
    n = both.sum(axis=1)
    return HeldOutError(
        absolute=np.abs(error).mean(axis=1),
        squared=np.sqrt(np.mean(error**2, axis=1)),
        bias=error.mean(axis=1),
        logarithmic=np.where(n > 0, np.abs(ratio).sum(axis=1) / np.maximum(n, 1), np.nan),
        log_share=n / tables.shape[1],
    )
