"""What a fit says of its sources beyond their moments: tests, competing distributions, held-out errors, theory.

All of it comes from at most 5,000 of the fitted tasks, drawn from an address, and from the tables left out of the fit;
memory does not grow with the number of tasks.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, replace
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from qinit_cli.environments.family import Family
from qinit_cli.errors import NotAllowed
from qinit_cli.fitted import EOPL_TESTS, TESTS, FitOptions, FittedTables
from qinit_cli.methods.method import Method
from qinit_cli.methods.plus import initialisations
from qinit_cli.pipeline.fit import Block, kept_of
from qinit_cli.seeding import Stream, generator

if TYPE_CHECKING:
    from qinit_cli.arrays import Flags, Floats, Integers, Tasks
    from qinit_cli.artefacts.fit_columns import FitStatistics

    Parts = Callable[..., dict[str, Any]]

FOLDS = 10
MOST_LEARNED, MOST_SCORED = 1_000, 200  # tasks: each one scored is set against each one learned from
VALUES_AT_ONCE = 2**22  # of a table that are worked on together, which bounds the memory

# what is drawn from Stream.NORMALITY at each index
_TASKS, _TEST, _EOPL = range(3)


@dataclass(frozen=True)
class Origin:
    """What statistics need to know of the sources' making."""

    family: Family
    gamma: float
    seed: int


def columns(options: FitOptions, family: Family) -> tuple[str, ...]:
    """The sources' columns that the sample needs; none where nothing is asked of it."""
    wanted = {
        "q": options.normality != "none" or options.alternatives or options.check_theory,
        "eopl": options.eopl_normality != "none" or options.check_theory,
    }
    parameters = [column.name for column in family.parameters()] if options.check_theory else []
    return (*(name for name, asked in wanted.items() if asked), *parameters)


def contents(options: FitOptions) -> FitStatistics:
    """What the fit will hold of them."""
    from qinit_cli.analysis.alternatives import DENSITIES
    from qinit_cli.artefacts.fit_columns import FitStatistics

    return FitStatistics(
        normality=TESTS[options.normality],
        eopl_normality=EOPL_TESTS[options.eopl_normality],
        distributions=tuple(DENSITIES) if options.alternatives else (),
        initialisations=tuple(initialisations()) if options.holdout else (),
        held_out=options.holdout,
        theory=options.check_theory,
    )


class Sample:
    """The tasks that statistics are made of, kept from the blocks that pass through on their way to the fit."""

    def __init__(self, kept: Flags, seed: int, names: tuple[str, ...]) -> None:
        from qinit_cli.analysis.normality import tasks_tested

        places = np.flatnonzero(kept)
        self._wanted = places[tasks_tested(len(places), generator(seed, Stream.NORMALITY, _TASKS))]
        self._names = names
        self.columns: Block = {}

    def reading(self, blocks: Iterable[Block]) -> Iterator[Block]:
        """The same blocks, a partition of the tasks in their order."""
        first = filled = 0
        for block in blocks:
            last = first + len(block["task"])
            rows = self._wanted[(self._wanted >= first) & (self._wanted < last)] - first
            for name in self._names:
                values = block[name]
                if name not in self.columns:
                    self.columns[name] = np.empty((len(self._wanted), *values.shape[1:]), values.dtype)
                self.columns[name][filled : filled + len(rows)] = values[rows]
            first, filled = last, filled + len(rows)
            yield block


def statistics(sample: Block, origin: Origin, options: FitOptions) -> dict[str, Any]:
    """The arrays that `contents` describes but for the held-out errors, from a sample's `columns`."""
    arrays: dict[str, Any] = {}
    if options.normality != "none":
        test = partial(_normality, rng=_rng(origin, _TEST), test=options.normality)
        arrays |= _by_cells(test, sample["q"])
    if options.eopl_normality != "none":
        test = partial(_eopl_normality, rng=_rng(origin, _EOPL), how=options.eopl_normality)
        arrays |= _by_cells(test, sample["eopl"])
    if options.alternatives:
        learned, folds = _folds(len(sample["q"]), origin.seed)
        arrays |= _by_cells(partial(_alternatives, folds=folds), sample["q"][learned])
    if options.check_theory:
        log_path = _log_path(sample, origin.family)
        arrays |= _by_cells(partial(_theory, gamma=origin.gamma), sample["q"], sample["eopl"], log_path)
    return arrays


def held_out_errors(
    blocks: Iterable[Block], held: Flags, fit: FittedTables, origin: Origin
) -> dict[str, Any]:
    """How far each initialisation's start is from the tables of the tasks that are `held`, (I, H) each.

    `blocks` partitions the tasks that `held` is of. NaN where the fit's estimator has no such start.
    """
    from qinit_cli.analysis.held_out import held_out_error

    starts = _starts(fit, origin)
    task: list[Any] = []
    errors: dict[str, list[Floats]] = {}
    for block in kept_of(blocks, held):
        tables = block["q"].reshape(len(block["q"]), *fit.mean.shape)
        of_starts = [held_out_error(start, tables) for start in starts]
        task.append(block["task"])
        for name in ("absolute", "squared", "bias", "logarithmic", "log_share"):
            errors.setdefault(name, []).append(np.stack([getattr(one, name) for one in of_starts]))
    return {"held_out_task": np.concatenate(task)} | {
        f"held_out_{name}": np.concatenate(parts, axis=1) for name, parts in errors.items()
    }


def _rng(origin: Origin, index: int) -> Any:
    return generator(origin.seed, Stream.NORMALITY, index)


def _by_cells(of: Parts, *tables: Any) -> dict[str, Any]:
    """The arrays (..., C) that `of` makes of tables (N, C), as (..., STATE, A), from tables (N, STATE, A)."""
    shape = tables[0].shape[1:]
    flat = [table.reshape(len(table), -1) for table in tables]
    size = max(1, VALUES_AT_ONCE // max(1, len(tables[0])))
    parts = [
        of(*(table[:, first : first + size] for table in flat)) for first in range(0, flat[0].shape[1], size)
    ]
    joined = {name: np.concatenate([part[name] for part in parts], axis=-1) for name in parts[0]}
    return {name: values.reshape(*values.shape[:-1], *shape) for name, values in joined.items()}


def _normality(q: Floats, *, rng: Any, test: str) -> dict[str, Any]:
    from qinit_cli.analysis.normality import named_tests, normality
    from qinit_cli.elementary import ln

    positive = q > 0
    logarithms = ln(np.where(positive, q, 1.0))
    return _told("normality", normality(logarithms, positive, named_tests(rng)[TESTS[test].lower()]))


def _eopl_normality(eopl: Any, *, rng: Any, how: str) -> dict[str, Any]:
    from qinit_cli.analysis.normality import normality
    from qinit_cli.analysis.rounded_normal import dithered, rounded_normality

    arrives = eopl >= 0  # 0 at the goal is a length, by definition 1
    lengths = eopl.astype(np.float64)
    tested = (
        rounded_normality(lengths, arrives, rng)
        if how == "rounded"
        else normality(dithered(lengths, rng), arrives)
    )
    return _told("eopl_normality", tested)


def _told(prefix: str, tested: Any) -> dict[str, Any]:
    return {
        f"{prefix}_n": tested.n.astype(np.int32),
        f"{prefix}_w": tested.statistic,
        f"{prefix}_p": tested.p,
        f"{prefix}_skewness": tested.skewness,
        f"{prefix}_kurtosis": tested.kurtosis,
    }


def _folds(count: int, seed: int) -> tuple[Integers, Integers]:
    """Which of `count` tasks are learned from, ascending, and the fold of each; -1 for those that are not scored."""
    order = generator(seed, Stream.HOLDOUT, 0).permutation(count)[:MOST_LEARNED]
    fold = np.where(np.arange(len(order)) < MOST_SCORED, np.arange(len(order)) % FOLDS, -1)
    ascending = np.argsort(order)
    return order[ascending], fold[ascending]


def _alternatives(q: Floats, *, folds: Integers) -> dict[str, Any]:
    from qinit_cli.analysis.alternatives import akaike, held_out_scores

    aic, scored = akaike(q), held_out_scores(q, folds)
    by_aic = np.full_like(scored.scores, np.nan)  # the empirical distribution has none
    by_aic[[scored.names.index(name) for name in aic.names]] = aic.scores
    return {"alternative_aic": by_aic, "alternative_log_score": scored.scores}


def _log_path(sample: Block, family: Family) -> Floats:
    """ln of the probability of each path, (N, STATE, A)."""
    eopl = sample["eopl"]
    drawn = {column.name: column.dtype for column in family.parameters()}
    tasks: Tasks = np.empty(len(eopl), list(drawn.items()))
    for name in drawn:
        tasks[name] = sample[name]
    lengths = eopl.reshape(len(eopl), -1, eopl.shape[-1])
    return np.broadcast_to(family.log_path(tasks, lengths), lengths.shape).reshape(eopl.shape)


def _theory(q: Floats, eopl: Any, log_path: Floats, *, gamma: float) -> dict[str, Any]:
    from qinit_cli.analysis.theory import theory

    found = theory(q, eopl, gamma, log_path)
    told = {
        f"theory_{form}_{name}": getattr(getattr(found, form), name)
        for form in ("product", "length")
        for name in ("bias", "spread", "mean_ratio")
    }
    return told | {
        "theory_n": found.n.astype(np.int32),
        "theory_variance": found.variance,
        "theory_explained": found.explained,
        "theory_explained_by_gamma": found.explained_by_gamma,
    }


def start(method: Method, fit: FittedTables, family: Family, gamma: float) -> Floats:
    """What an initialisation starts from, (S, A), as shares; NotAllowed where the fit's estimator has no such start."""
    learning = replace(family.target_learning, gamma=gamma)
    return fit.bounds.shares(method.initial_of_all(fit, family, learning).start)


def _starts(fit: FittedTables, origin: Origin) -> list[Floats]:
    """Each initialisation's start, (S, A), with its default options; NaN where the fit's estimator has none."""
    starts = []
    for method in initialisations().values():
        try:
            starts.append(start(method(), fit, origin.family, origin.gamma))
        except NotAllowed:
            starts.append(np.full(fit.mean.shape, np.nan))
    return starts
