"""Moments of the source tables per state-action, in one pass and in memory that does not grow with the tasks.

The blocks are merged with Chan, Golub and LeVeque's (1983) form of Welford's update. Merging rounds, so the
caller passes blocks of a fixed partition in task order: then the last bits do not depend on how the tables
were learned.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, fields
from functools import reduce

import numpy as np
from numpy.typing import NDArray

from qinit_cli.arrays import Flags, Floats, Integers
from qinit_cli.elementary import ln


@dataclass(frozen=True)
class Moments:
    """Count, mean, spread and range of one quantity per cell, any shape; cells are independent of each other.

    A cell that was never counted holds the neutral element of `merged`; its statistics are NaN.
    """

    n: Integers
    running_mean: Floats  # 0 where n is 0
    squares: Floats  # sum of squares about the mean
    smallest: Floats  # +inf where n is 0
    largest: Floats  # -inf where n is 0

    @property
    def mean(self) -> Floats:
        return np.where(self.n > 0, self.running_mean, np.nan)

    @property
    def std(self) -> Floats:
        """Standard deviation with divisor n (ddof 0)."""
        return np.where(self.n > 0, np.sqrt(self.squares / np.maximum(self.n, 1)), np.nan)

    @property
    def min(self) -> Floats:
        return np.where(self.n > 0, self.smallest, np.nan)

    @property
    def max(self) -> Floats:
        return np.where(self.n > 0, self.largest, np.nan)


@dataclass(frozen=True)
class SourceMoments:
    """What a fit knows of its sources; cells are (STATE, A), those of `value` (STATE)."""

    log_q: Moments  # of ln Q over the tasks with Q > 0
    q: Moments  # of Q over the same tasks, or over all
    eopl: Moments  # over the tasks whose path arrives
    value: Moments  # of max_a Q, over all tasks, nothing masked

    @property
    def n_masked(self) -> Integers:
        """Tasks left out of `log_q` because Q <= 0 there, (STATE, A)."""
        return self.value.n[..., None] - self.log_q.n


def moments(values: Floats, counted: Flags) -> Moments:
    """Moments over the first axis of `values` (N, ...), of the entries that are `counted`, in two passes."""
    n = np.count_nonzero(counted, axis=0).astype(np.int64)
    mean = np.sum(values, axis=0, where=counted) / np.maximum(n, 1)
    deviations = np.where(counted, values - mean, 0.0)
    return Moments(
        n=n,
        running_mean=mean,
        squares=np.sum(deviations**2, axis=0),
        smallest=np.min(values, axis=0, where=counted, initial=np.inf),
        largest=np.max(values, axis=0, where=counted, initial=-np.inf),
    )


def merged(first: Moments, second: Moments) -> Moments:
    """The moments of both blocks together (Chan, Golub and LeVeque, 1983)."""
    n = first.n + second.n
    share = second.n / np.maximum(n, 1)
    step = second.running_mean - first.running_mean
    return Moments(
        n=n,
        # a first block that counted nothing holds 0 and a share of exactly 1: the second mean comes out whole
        running_mean=first.running_mean + step * share,
        squares=first.squares + second.squares + step**2 * (first.n * share),
        smallest=np.minimum(first.smallest, second.smallest),
        largest=np.maximum(first.largest, second.largest),
    )


def block_moments(q: Floats, eopl: NDArray[np.integer], *, estimates: bool = False) -> SourceMoments:
    """Moments of one block of tasks: `q` and `eopl` are (N, STATE, A).

    Entries with Q <= 0 are masked, never floored: one floored 1e-10 among 100 inflates exp(mu + sigma^2/2)
    sixfold. In a table they are unknown and count nowhere; `estimates` (sums of weights) count in `q`, and have no logarithm.
    An EOPL of -1 (never arrives) is no length; 0 (the state is the goal) is one, by definition 1.
    """
    positive = q > 0
    value = q.max(axis=-1)
    return SourceMoments(
        log_q=moments(ln(np.where(positive, q, 1.0)), positive),
        q=moments(q, np.ones(q.shape, dtype=np.bool_) if estimates else positive),
        eopl=moments(eopl.astype(np.float64), eopl >= 0),
        value=moments(value, np.ones(value.shape, dtype=np.bool_)),
    )


def source_moments(
    blocks: Iterable[tuple[Floats, NDArray[np.integer]]], *, estimates: bool = False
) -> SourceMoments:
    """Moments over all tasks of the blocks (q, eopl), each (N, STATE, A) with N free to differ.

    One block is in memory at a time.
    """
    return reduce(_merged_sources, (block_moments(q, eopl, estimates=estimates) for q, eopl in blocks))


def _merged_sources(first: SourceMoments, second: SourceMoments) -> SourceMoments:
    names = [field.name for field in fields(SourceMoments)]
    return SourceMoments(**{name: merged(getattr(first, name), getattr(second, name)) for name in names})
