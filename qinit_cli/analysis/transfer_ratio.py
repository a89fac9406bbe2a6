"""How many times the return of learning from zero a method earns, where that has a meaning."""

from __future__ import annotations

import numpy as np

from qinit_cli.analysis.intervals import Interval, percentiles, unknown
from qinit_cli.arrays import Floats


def transfer_ratio(mean: float, baseline: float, means: Floats, baselines: Floats, units: int) -> Interval:
    """Ratio of two means and its interval, each (), from the same means in the same samples of `units`, each (B,).

    NaN where the interval of the baseline's mean touches 0: dividing by next to nothing tells nothing, so there the
    difference stands alone.
    """
    against = percentiles(np.asarray(baseline), baselines, units)
    if not against.low > 0:
        return unknown(np.asarray(np.nan))
    some = baselines > 0  # but for a few samples beyond the interval
    return percentiles(np.asarray(mean / baseline), means[some] / baselines[some], units)
