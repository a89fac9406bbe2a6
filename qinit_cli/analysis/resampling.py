"""Samples with replacement of source sets and targets, as counts: how often each sample holds a value (R, T).

One source set resamples its targets. Several sets that share their targets resample both independently (pigeonhole; Owen,
2007); sets with targets of their own are resampled, and the targets within each. Counts, so that every metric of a table is
one product; in blocks, so that memory is bounded.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from qinit_cli.analysis.weighted_sums import weighted_sums
from qinit_cli.arrays import Floats, Integers

RESAMPLES = 10_000

_VALUES_AT_ONCE = 1_000_000  # of one block of resamples: what bounds the memory


def units(sets: int, targets: int) -> int:
    """How many units a number over source sets and targets has: the targets of one set, else the sets, the fewest."""
    return targets if sets == 1 else sets


@dataclass(frozen=True)
class Crossed:
    """Samples of sets that share their targets, or of one set alone: its sets times its targets."""

    chosen: Floats  # (B, R) how often each holds a source set
    met: Floats  # (B, T) how often it holds a target

    def means(self, values: Floats) -> Floats:
        """Mean of `values` (R, T, M) in each sample, (B, M)."""
        sets, targets, metrics = values.shape
        over_targets = weighted_sums(self.met, values.transpose(1, 0, 2).reshape(targets, sets * metrics))
        by_set = over_targets.reshape(-1, sets, metrics)
        means: Floats = np.einsum("br,brm->bm", self.chosen, by_set, optimize=False) / (sets * targets)
        return means

    def pair_means(self, values: Floats) -> Floats:
        """Mean of `values` (R, R, T) over pairs of a sample's sets, and over its targets, (B,)."""
        sets, _, targets = values.shape
        pairs = weighted_sums(self.met, values.reshape(sets * sets, targets).T).reshape(-1, sets, sets)
        means: Floats = np.einsum("br,brs,bs->b", self.chosen, pairs, self.chosen, optimize=False) / (
            sets**2 * targets
        )
        return means

    def counts(self) -> Integers:
        """How often each sample holds each value, (B, R * T)."""
        held = self.chosen.astype(np.int16)[:, :, None] * self.met.astype(np.int16)[:, None, :]
        return held.reshape(len(held), -1)


@dataclass(frozen=True)
class Nested:
    """Samples of sets that have targets of their own."""

    held: Floats  # (B, R * T) how often each holds a value

    def means(self, values: Floats) -> Floats:
        """Mean of `values` (R, T, M) in each sample, (B, M)."""
        flat = values.reshape(-1, values.shape[2])
        means: Floats = weighted_sums(self.held, flat) / len(flat)
        return means

    def pair_means(self, values: Floats) -> Floats:
        """Mean of `values` (1, R, T) in each sample, (B,): sets that met other targets make no pairs."""
        means: Floats = weighted_sums(self.held, values.reshape(-1, 1))[:, 0] / values.size
        return means

    def counts(self) -> Integers:
        """How often each sample holds each value, (B, R * T)."""
        return self.held.astype(np.int16)


def of_targets(targets: int, rng: np.random.Generator, resamples: int = RESAMPLES) -> Iterator[Crossed]:
    """Samples of the targets of one source set; the same draws as scipy.stats.bootstrap makes from that generator."""
    for block in _blocks(resamples, targets):
        met = _counts(rng.integers(0, targets, (block, targets)), targets)
        yield Crossed(np.ones((block, 1)), met)


def crossed(
    sets: int, targets: int, rng: np.random.Generator, resamples: int = RESAMPLES
) -> Iterator[Crossed]:
    """Samples of the sets and, independently, of the targets that they share."""
    for block in _blocks(resamples, sets * targets):
        chosen = _counts(rng.integers(0, sets, (block, sets)), sets)
        yield Crossed(chosen, _counts(rng.integers(0, targets, (block, targets)), targets))


def nested(sets: int, targets: int, rng: np.random.Generator, resamples: int = RESAMPLES) -> Iterator[Nested]:
    """Samples of the sets, and of the targets within each set drawn."""
    for block in _blocks(resamples, sets * targets):
        chosen = rng.integers(0, sets, (block, sets, 1))
        met = rng.integers(0, targets, (block, sets, targets))
        yield Nested(_counts((chosen * targets + met).reshape(block, sets * targets), sets * targets))


def _counts(drawn: Integers, values: int) -> Floats:
    """How often each of `values` stands in each row of `drawn`, (rows, values)."""
    rows = len(drawn)
    places = drawn + values * np.arange(rows)[:, None]
    return np.bincount(places.ravel(), minlength=rows * values).reshape(rows, values).astype(np.float64)


def _blocks(resamples: int, values: int) -> Iterator[int]:
    most = max(1, _VALUES_AT_ONCE // values)
    for done in range(0, resamples, most):
        yield min(most, resamples - done)
