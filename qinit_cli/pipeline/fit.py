"""Summarising source tables: moments per state-action in one pass, log-normal estimates, a library of whole tables."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from qinit_cli.environments.family import Family
from qinit_cli.environments.tiled import WEIGHTS
from qinit_cli.fitted import MASKED, UNKNOWN, FitOptions

if TYPE_CHECKING:
    from qinit_cli.analysis.moments import Moments, SourceMoments
    from qinit_cli.arrays import Flags, Tasks

BLOCK = 64  # tasks; a fixed partition in task order, else a fit's last bits would depend on how it was read

Block = dict[str, Any]  # "task", "q", "td_var" and "eopl" of up to BLOCK source tasks


@dataclass(frozen=True)
class Selection:
    """Which sources teach a fit."""

    kept: Flags  # (N,) in task order
    unsolvable: int  # cannot be solved at all: always left out
    unlearned: int  # could be solved, but their greedy path fails: kept unless that is excluded


def select(family: Family, tasks: Tasks, solved: Flags, horizon: int, options: FitOptions) -> Selection:
    """The sources to fit, of those drawn as `tasks` (N,) and `solved` (N,) by their own greedy paths."""
    solvable = family.solvable(tasks, solved, horizon)
    unlearned = solvable & ~solved
    kept = solvable & ~unlearned if options.exclude_unlearned else solvable
    return Selection(kept, int((~solvable).sum()), int(unlearned.sum()))


def hold_out(selection: Selection, count: int) -> tuple[Selection, Flags]:
    """The selection without the last `count` sources it keeps, and which these are, (N,)."""
    kept = np.flatnonzero(selection.kept)
    held = np.zeros_like(selection.kept)
    held[kept[max(0, len(kept) - count) :]] = True
    return replace(selection, kept=selection.kept & ~held), held


def fit(
    blocks: Iterable[Block], selection: Selection, options: FitOptions, *, estimates: bool = False
) -> dict[str, Any]:
    """The arrays of a fit, state axes as in the blocks; memory is that of a block and the library.

    `blocks` partitions the source tasks in task order, BLOCK in each but the last. `estimates`: values at or
    below 0 count too, but for their logarithms.
    """
    from qinit_cli.analysis.moments import source_moments

    library = _KeptTables(library_size(selection, options))
    kept = kept_of(blocks, selection.kept)
    read = ((block["q"], block["eopl"]) for block in library.reading(kept))
    moments = source_moments(read, estimates=estimates)
    return _tables(moments, options.estimator) | {
        "value_mean": moments.value.mean,
        "library_q": np.concatenate(library.q) if library.q else _no_tables(moments),
        "library_td_var": np.concatenate(library.td_var) if library.td_var else _no_tables(moments),
        **({"library_weights": np.concatenate(library.weights)} if library.weights else {}),
        "library_task": np.concatenate([np.empty(0, np.int64), *library.task]),
    }


def library_size(selection: Selection, options: FitOptions) -> int:
    """How many whole tables the fit keeps."""
    return min(int(selection.kept.sum()), options.library)


def kept_of(blocks: Iterable[Block], kept: Flags) -> Iterator[Block]:
    """The blocks, a partition of the tasks that `kept` (N,) is of, with only those; blocks without any are passed over."""
    first = 0
    for block in blocks:
        chosen = kept[first : first + len(block["task"])]
        first += len(block["task"])
        if chosen.any():
            yield {name: values[chosen] for name, values in block.items()}


class _KeptTables:
    """Keeps the first tables of the blocks that pass through."""

    def __init__(self, size: int) -> None:
        self._room = size
        self.q: list[Any] = []
        self.td_var: list[Any] = []
        self.task: list[Any] = []
        self.weights: list[Any] = []  # of tiles, where the blocks have them

    def reading(self, blocks: Iterable[Block]) -> Iterator[Block]:
        for block in blocks:
            if self._room > 0 or not self.q:  # none of the first block tells the shape of none
                wanted = (
                    (self.q, "q"),
                    (self.td_var, "td_var"),
                    (self.task, "task"),
                    (self.weights, WEIGHTS),
                )
                for kept, name in wanted:
                    if name in block:
                        kept.append(block[name][: self._room])
                self._room -= len(self.q[-1])
            yield block


def _no_tables(moments: SourceMoments) -> Any:
    return np.empty((0, *moments.q.n.shape))


def pair_statistics(log_q: Moments, q: Moments, estimator: str) -> dict[str, Any]:
    """The tables of a fit (Fit.TABLES) that the moments of ln Q and Q over the same tasks make, by the estimator."""
    from qinit_cli.analysis.estimators import MEDIANS, lognormal_mean, lognormal_median

    settled = (log_q.n, log_q.mean, log_q.squares)
    has_median = estimator in MEDIANS
    return {
        "mu": log_q.mean,
        "sigma": log_q.std,
        "lognormal_median": lognormal_median(*settled, estimator)
        if has_median
        else np.full(q.n.shape, np.nan),
        "lognormal_mean": lognormal_mean(*settled, estimator),
        "mean": q.mean,
        "std": q.std,
        "min": q.min,
        "max": q.max,
        "n": log_q.n.astype(np.int32),
    }


def _tables(moments: SourceMoments, estimator: str) -> dict[str, Any]:
    log_q, q, eopl = moments.log_q, moments.q, moments.eopl
    unknown = log_q.n == 0
    return pair_statistics(log_q, q, estimator) | {
        "n_masked": moments.n_masked.astype(np.int32),
        "eopl_mean": eopl.mean,
        "eopl_std": eopl.std,
        "eopl_n": eopl.n.astype(np.int32),
        "flags": (UNKNOWN * unknown + MASKED * (~unknown & (moments.n_masked > 0))).astype(np.uint8),
    }
