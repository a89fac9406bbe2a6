"""Sign-flip permutation test of paired differences: if two methods were equal, every sign was a coin's."""

from __future__ import annotations

import numpy as np

from qinit_cli.analysis.multiplicity import holm
from qinit_cli.analysis.weighted_sums import weighted_sums
from qinit_cli.arrays import Flags, Floats, Integers

RESAMPLES = 10_000
LEVEL = 0.05  # of all tests together

_VALUES_AT_ONCE = 1_000_000  # of one block of sign patterns: what bounds the memory
_ROUNDING = 1e-12  # sums of the same numbers in another order count as equal


def sign_flip_p(differences: Floats, rng: np.random.Generator, resamples: int = RESAMPLES) -> Floats:
    """Two-sided p of a mean difference of 0, (M,), from `differences` (T, M) on the same targets.

    All 2^T patterns where they are no more than `resamples`: then p is exact. Else that many random ones, and
    the observed one counts among them (Phipson and Smyth, 2010), so that p is never 0.
    """
    targets = len(differences)
    scale = np.abs(differences).sum(axis=0)
    observed = np.abs(differences.sum(axis=0)) - _ROUNDING * scale
    exact = 2**targets <= resamples
    patterns = 2**targets if exact else resamples
    extreme = np.zeros(differences.shape[1:])
    block = max(1, _VALUES_AT_ONCE // targets)
    for first in range(0, patterns, block):
        size = min(block, patterns - first)
        bits = (
            _all_bits(first, size, targets) if exact else rng.integers(0, 2, (size, targets), dtype=np.int8)
        )
        extreme += np.count_nonzero(np.abs(weighted_sums(2.0 * bits - 1.0, differences)) >= observed, axis=0)
    return extreme / patterns if exact else (extreme + 1) / (patterns + 1)


def paired_p(differences: Floats, rng: np.random.Generator) -> float:
    """p of a mean difference of 0 from `differences` (R, T): targets flip where there is one source set, else whole sets."""
    flipped = differences.T if len(differences) == 1 else differences.mean(axis=1, keepdims=True)
    return float(sign_flip_p(flipped, rng)[0])


def adjusted(p: Floats, units: Integers) -> Floats:
    """Holm's p of M tests of so many units each, (M,); NaN where it could not come to LEVEL, whatever the differences."""
    return np.where(can_be_small(units), holm(p), np.nan)


def least_p(units: int, resamples: int = RESAMPLES) -> float:
    """The smallest p that `sign_flip_p` can give of so many units: 2 / 2^n, as both signs of all of them are as extreme."""
    return 2.0 / 2**units if 2**units <= resamples else 1.0 / (resamples + 1)


def can_be_small(units: Integers) -> Flags:
    """Whether each of M tests, of so many units (M,), could come to LEVEL at all after Holm's correction, (M,)."""
    return holm(np.array([least_p(int(each)) for each in units])) <= LEVEL


def fewest_units(tests: int) -> int:
    """How many units each of so many tests needs to be able to come to LEVEL after Holm's correction; 0 if none is enough."""
    enough = (units for units in range(1, RESAMPLES.bit_length() + 1) if tests * least_p(units) <= LEVEL)
    return next(enough, 0)


def _all_bits(first: int, size: int, targets: int) -> Floats:
    numbers = np.arange(first, first + size)[:, None]
    return ((numbers >> np.arange(targets)) & 1).astype(np.float64)
