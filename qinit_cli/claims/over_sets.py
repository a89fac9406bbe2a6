"""One number of each source set as one number of all: their mean, or how many a test rejects, with an interval over the sets."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from qinit_cli.analysis import intervals
from qinit_cli.analysis.intervals import Estimate, over_targets
from qinit_cli.analysis.permutation import LEVEL
from qinit_cli.arrays import Floats
from qinit_cli.seeding import Stream, generator

_TAIL = (1 - intervals.LEVEL) / 2


@dataclass(frozen=True)
class OverSets(Estimate):
    """An estimate, and over how many source sets."""

    sets: int = 0  # 0 where none is read


def mean(values: Floats) -> OverSets:
    """Mean of the known values of the source sets (R,), with its bootstrap interval over them."""
    known = values[np.isfinite(values)]
    if not known.size:
        return OverSets(np.nan)
    found = over_targets(known[:, None], generator(0, Stream.BOOTSTRAP, 0)).at(0)
    return OverSets(**vars(found), sets=known.size)


def share_rejected(p: Floats) -> OverSets:
    """Share of the source sets, by their p (R,), that a test at 5 % rejects, with Clopper and Pearson's interval."""
    from scipy.special import betaincinv

    known = p[np.isfinite(p)]
    n, rejected = known.size, int((known <= LEVEL).sum())
    if not n:
        return OverSets(np.nan)
    low = float(betaincinv(rejected, n - rejected + 1, _TAIL)) if rejected else 0.0
    high = float(betaincinv(rejected + 1, n - rejected, 1 - _TAIL)) if rejected < n else 1.0
    return OverSets(rejected / n, low, high, n)


def beyond_chance(p: Floats, rows: int) -> bool:
    """Whether more of the source sets reject at 5 % than the null hypothesis lets them.

    One-sided exact binomial test at 5 %, shared by Bonferroni among the `rows` that a claim asks it of.
    """
    from scipy.special import betainc

    known = p[np.isfinite(p)]
    rejected = int((known <= LEVEL).sum())
    return rejected > 0 and float(betainc(rejected, known.size - rejected + 1, LEVEL)) <= LEVEL / rows


def above(values: Floats, bound: float, rows: int) -> bool:
    """Whether the mean of the source sets (R,) lies above a bound: one-sided t test at 5 %, shared likewise among `rows`.

    A single set has no test, and lies above where it does.
    """
    from scipy.special import stdtr

    known = values[np.isfinite(values)]
    excess, freedom = float(known.mean()) - bound, known.size - 1
    error = float(known.std(ddof=1)) / known.size**0.5 if freedom else 0.0
    if excess <= 0 or error == 0:
        return excess > 0
    return float(stdtr(freedom, -excess / error)) <= LEVEL / rows
