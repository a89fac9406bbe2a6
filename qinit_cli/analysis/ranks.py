"""Methods over several distributions by their ranks: Friedman's test, and Wilcoxon's of each pair, corrected by Holm.

After Demsar (JMLR 7, 2006), with pairs as in Garcia and Herrera (JMLR 9, 2008): the critical difference of Nemenyi's test has
less power, and depends on which other methods are there.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from qinit_cli.analysis.multiplicity import holm
from qinit_cli.arrays import Floats

LEVEL = 0.05
MOST_EXACT = 50  # differences, as scipy has it


@dataclass(frozen=True)
class RankComparison:
    """How M methods rank over B blocks, rank 1 the best; p are NaN where there is nothing to test."""

    mean_ranks: Floats  # (M,)
    friedman: float  # chi-squared, corrected for ties; NaN for two methods
    friedman_p: float
    pairs: Floats  # (M, M) p of each pair, adjusted by Holm over all pairs; NaN on the diagonal
    blocks: int
    fewest_blocks: int  # with which the least p of a pair comes to LEVEL after Holm

    @property
    def tested(self) -> bool:
        """Whether the blocks are enough for any pair to be distinguished."""
        return self.blocks >= self.fewest_blocks

    def distinguished(self, first: int, second: int) -> bool:
        """Whether two methods are shown to differ: Friedman's test rejects, and the pair's p is small."""
        rejects = math.isnan(self.friedman_p) or self.friedman_p < LEVEL
        return self.tested and rejects and bool(self.pairs[first, second] < LEVEL)

    def alike(self) -> list[list[int]]:
        """The groups of which no pair is distinguished, as large as they can be, each by rising rank."""
        order = [int(at) for at in np.argsort(self.mean_ranks, kind="stable")]
        groups: list[list[int]] = []
        for first in range(len(order)):
            last = first
            while last + 1 < len(order) and not any(
                self.distinguished(own, order[last + 1]) for own in order[first : last + 1]
            ):
                last += 1
            group = order[first : last + 1]
            if len(group) > 1 and not any(set(group) <= set(other) for other in groups):
                groups.append(group)
        return groups


def rank_comparison(values: Floats, *, fewest: bool = False) -> RankComparison:
    """Ranks of `values` (B, M) within each block, the largest first, or the `fewest`; ValueError for one method or no block."""
    from scipy.stats import friedmanchisquare, rankdata

    blocks, methods = values.shape
    if methods < 2 or not blocks:
        raise ValueError(f"values are {values.shape}; ranks need two methods and a block at least")
    ranks: Floats = rankdata(values if fewest else -values, axis=1)
    statistic, p = math.nan, math.nan
    if methods > 2 and blocks > 1:
        # where every block has one rank for all there is no difference to test: 0 over 0
        tied = bool((ranks == ranks[:, :1]).all())
        statistic, p = (0.0, 1.0) if tied else map(float, friedmanchisquare(*ranks.T))
    pairs = np.full((methods, methods), math.nan)
    which = list(combinations(range(methods), 2))
    found = holm(np.array(list(_signed_ranks(values))))
    for (first, second), adjusted in zip(which, found, strict=True):
        pairs[first, second] = pairs[second, first] = adjusted
    return RankComparison(ranks.mean(axis=0), statistic, p, pairs, blocks, _fewest_blocks(len(which)))


def _signed_ranks(values: Floats) -> Iterator[float]:
    """Two-sided p of Wilcoxon's signed-rank test for each pair of columns; 1 where no block tells them apart."""
    for first, second in combinations(range(values.shape[1]), 2):
        apart = values[:, first] - values[:, second]
        yield signed_rank_p(apart[apart != 0])


def signed_rank_p(apart: Floats) -> float:
    """Two-sided p of Wilcoxon's signed-rank test of differences (B,), none of them 0; 1 where there are none.

    Exact up to MOST_EXACT differences, equal ones among them: the normal approximation comes under the least p that so few
    blocks can have.
    """
    from scipy.stats import rankdata, wilcoxon

    if not len(apart):
        return 1.0
    if len(apart) > MOST_EXACT:
        return float(wilcoxon(apart, method="asymptotic").pvalue)
    twice = np.rint(2 * rankdata(np.abs(apart))).astype(np.int64)  # ranks of equal ones end in a half
    ways = np.zeros(
        int(twice.sum()) + 1
    )  # to choose ranks of that sum: below 2^53, so that floats count them
    ways[0] = 1.0
    for rank in twice:
        ways[rank:] += ways[:-rank].copy()
    positive = int(twice[apart > 0].sum())
    least = min(positive, len(ways) - 1 - positive)
    return min(1.0, 2 * float(ways[: least + 1].sum()) / 2.0 ** len(apart))


def _fewest_blocks(pairs: int) -> int:
    """Of B blocks the least two-sided p is 2^(1-B), and Holm multiplies the least of all by the number of pairs."""
    return 1 + math.ceil(math.log2(pairs / LEVEL))
