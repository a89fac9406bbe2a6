"""Summarising source tables: moments per state-action in one pass, log-normal estimates, a library of whole tables."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import TYPE_CHECKING, Any

from qinit_cli.fitted import FitOptions

if TYPE_CHECKING:
    from qinit_cli.analysis.moments import SourceMoments

BLOCK = 64  # tasks; a fixed partition in task order, else a fit's last bits would depend on how it was read

UNKNOWN = 1  # a flag: no source has a positive value there
MASKED = 2  # a flag: some sources have none, and are left out

Block = dict[str, Any]  # "task", "q", "td_var" and "eopl" of up to BLOCK source tasks


def fit(blocks: Iterable[Block], tasks: int, options: FitOptions) -> dict[str, Any]:
    """The arrays of a fit, state axes as in the blocks; memory is that of a block and the library.

    `blocks` partitions `tasks` source tasks in task order, BLOCK in each but the last.
    """
    import numpy as np

    from qinit_cli.analysis.moments import source_moments

    library = _Library(min(tasks, options.library))
    moments = source_moments((block["q"], block["eopl"]) for block in library.reading(blocks))
    return _tables(moments, options.estimator) | {
        "value_mean": moments.value.mean,
        "library_q": np.concatenate(library.q) if library.q else _no_tables(moments),
        "library_td_var": np.concatenate(library.td_var) if library.td_var else _no_tables(moments),
        "library_task": np.concatenate([np.empty(0, np.int64), *library.task]),
    }


class _Library:
    """Keeps the first tables of the blocks that pass through."""

    def __init__(self, size: int) -> None:
        self._room = size
        self.q: list[Any] = []
        self.td_var: list[Any] = []
        self.task: list[Any] = []

    def reading(self, blocks: Iterable[Block]) -> Iterator[Block]:
        for block in blocks:
            if self._room > 0:
                for kept, name in ((self.q, "q"), (self.td_var, "td_var"), (self.task, "task")):
                    kept.append(block[name][: self._room])
                self._room -= len(self.q[-1])
            yield block


def _no_tables(moments: SourceMoments) -> Any:
    import numpy as np

    return np.empty((0, *moments.q.n.shape))


def _tables(moments: SourceMoments, estimator: str) -> dict[str, Any]:
    import numpy as np

    from qinit_cli.analysis.estimators import MEDIANS, lognormal_mean, lognormal_median

    log_q, q, eopl = moments.log_q, moments.q, moments.eopl
    settled = (log_q.n, log_q.mean, log_q.squares)
    unknown = q.n == 0
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
        "n": q.n.astype(np.int32),
        "n_masked": moments.n_masked.astype(np.int32),
        "eopl_mean": eopl.mean,
        "eopl_std": eopl.std,
        "eopl_n": eopl.n.astype(np.int32),
        "flags": (UNKNOWN * unknown + MASKED * (~unknown & (moments.n_masked > 0))).astype(np.uint8),
    }
