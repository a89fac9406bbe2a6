"""Learning sources in the place of targets: what `qinit tune` chooses a method's parameters by."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from itertools import product
from typing import TYPE_CHECKING, Any

import numpy as np

from qinit_cli.analysis import returns
from qinit_cli.artefacts.choice import FOLDS, folds
from qinit_cli.artefacts.opening import family_in
from qinit_cli.artefacts.settings import SourcesSettings, TuningSettings
from qinit_cli.artefacts.sources import blocks_in_shares
from qinit_cli.artefacts.tuning import tuning_schema
from qinit_cli.environments.family import bounds_of
from qinit_cli.environments.tiled import WEIGHTS
from qinit_cli.errors import NotAllowed, UsageError
from qinit_cli.fitted import FitOptions, FittedTables, in_returns
from qinit_cli.methods import Method
from qinit_cli.pipeline import fit as stage
from qinit_cli.pipeline.asked import CrossValidating
from qinit_cli.pipeline.fitting import selection_of
from qinit_cli.pipeline.job import Plan, Prepared
from qinit_cli.pipeline.sources import by_learner, check_learned, in_names
from qinit_cli.pipeline.transfer import check_counted, check_together, learn_targets, learning_bytes
from qinit_cli.pipeline.tuning import Grid, with_parameters
from qinit_cli.tasks import VALIDATION, TargetTasks
from qinit_store.held import Held
from qinit_store.wording import counted

if TYPE_CHECKING:
    from qinit_cli.arrays import Floats, Integers
    from qinit_cli.pipeline.sources import Rows
    from qinit_cli.watch import Watch
    from qinit_store.reading import Artefact

# with 100 sources a candidate takes 0.1 to 10 s of one core: hours where steps are dear
MOST_CANDIDATES = 2_000


def tried(method: Method, values: Grid) -> list[Method]:
    """The candidates, whole numbers where the method takes such; UsageError for a value or a number of them that cannot be.

    NotAllowed for a privileged method.
    """
    if method.privileged:
        raise NotAllowed(f"{method.name} reads the target itself, so that no source can stand in for one")
    try:
        typed = {
            name: tuple(getattr(with_parameters(method, {name: value}), name) for value in asked)
            for name, asked in values.items()
        }
        several = candidates(method, typed)
    except ValueError as error:
        raise UsageError(str(error)) from error
    if len(several) > MOST_CANDIDATES:
        raise UsageError(
            f"these are {len(several)} combinations; at most {MOST_CANDIDATES} are tried at once, give fewer values"
        )
    return several


def plan_for(source: Artefact, method: Method, values: Grid, validating: CrossValidating) -> Plan:
    """The artefact of how a method's parameters fare on the sources."""
    several = tried(method.on(family_in(source)), values)
    return plan_of(source, method, cross_validation_of(source, several, validating), values)


def plan_of(source: Artefact, method: Method, validation: CrossValidation, values: Grid) -> Plan:
    """The artefact of how every candidate fares on every source."""
    family, tried = validation.targets.family, validation.candidates
    learning = validation.targets.learning
    sources = SourcesSettings.read(source.spec)
    settings = TuningSettings.of(
        method, values, validation.targets, sources, source.content_sha256, source.task_count
    )
    return Plan(
        stem=f"{family.label}-{method.name}{in_names(learning.learner.name)}-{source.task_count}",
        settings=settings,
        family=family,
        schema=tuning_schema(tuple(values), len(tried), bounds_of(family, learning.gamma)),
        prepare=lambda: Prepared(
            learn=validation,
            kernel=f"{family.name} targets{by_learner(learning)}",
            inputs=[{"role": "sources", "name": source.path.stem, "content_sha256": source.content_sha256}],
            statics=parameters_of(tried, tuple(values)),
        ),
        what=counted(len(tried), "candidate"),
        read=source if isinstance(source, Held) else source.path,
        learning_bytes=learning_bytes(learning.episodes),
    )


def cross_validation_of(
    source: Artefact, tried: list[Method], validating: CrossValidating
) -> CrossValidation:
    """The learner, with a fit of all other sources for each fold."""
    family, fitting, settings = family_in(source), FitOptions(), SourcesSettings.read(source.spec)
    learning = validating.learning(family, settings.learning)
    check_learned(family, learning)
    check_together(tried[0], learning.learner)
    check_counted(tried[0], family)
    selection = selection_of(source, family, fitting)
    if int(selection.kept.sum()) < 2 * FOLDS:
        raise NotAllowed(
            f"{source.path} has {counted(int(selection.kept.sum()), 'source')} to learn from; tune needs at least {2 * FOLDS}: "
            "ask train-sources for more --tasks"
        )
    fold = folds(selection.kept)
    states, bounds = int(np.prod(family.shape)), bounds_of(family, settings.learning.gamma)
    of_tiles = (WEIGHTS,) if settings.family.tiled else ()
    fits = []
    for number in range(FOLDS):
        others = replace(selection, kept=selection.kept & (fold != number))
        blocks = blocks_in_shares(source, ("q", "td_var", "eopl", *of_tiles), stage.BLOCK)
        arrays = in_returns(stage.fit(blocks, others, fitting, estimates=settings.family.tiled), bounds)
        fits.append(FittedTables.from_arrays(arrays, states, fitting.estimator, bounds))
    targets = TargetTasks(family, learning, settings.seed, False, streams=VALIDATION)
    return CrossValidation(targets, tried, fits, fold)


def candidates(method: Method, grid: Grid) -> list[Method]:
    """The method with every combination of the grid's values, and first as it is; ValueError for a value out of its range."""
    others = [
        replace(method, **dict(zip(grid, values, strict=True)))  # type: ignore[type-var]  # every concrete method is a dataclass
        for values in product(*grid.values())
    ]
    return [method, *(other for other in others if other != method)]


@dataclass(frozen=True)
class CrossValidation:
    """Learns sources in the place of targets, under every candidate; called as any learner is, with ids of sources."""

    targets: TargetTasks  # whose tasks are the sources
    candidates: Sequence[Method]
    fits: Sequence[FittedTables]  # of all sources but those of a fold
    fold: Integers  # (N,)

    def __call__(self, indices: Integers, watch: Watch) -> tuple[Integers, Rows]:
        """The ids of the sources that were finished under every candidate, and a row for each column of the artefact."""
        rows: Rows = {
            "average": np.full((len(indices), len(self.candidates)), np.nan),
            "steps": np.zeros(len(indices), np.int64),
            "seconds": np.zeros(len(indices)),
        }
        finished = self.fold[indices] < 0  # what cannot be fitted is not tried
        for number in np.unique(self.fold[indices][~finished]):
            places = np.flatnonzero(self.fold[indices] == number)
            finished[places] = self._fold(indices[places], self.fits[number], watch, rows, places)
        return indices[finished], {name: values[finished] for name, values in rows.items()}

    def _fold(self, ids: Integers, fit: FittedTables, watch: Watch, rows: Rows, places: Integers) -> bool:
        """Fills the rows at these places; whether all was learned before the watch stopped."""
        for column, method in enumerate(self.candidates):
            initial = method.initial_of_all(fit, self.targets.family, self.targets.learning)
            done, learned = learn_targets(self.targets, initial, ids, watch.part(1 / len(self.candidates)))
            if len(done) < len(ids):
                return False
            paid = self.targets.family.payment(self.targets.learning.gamma)
            earned = returns.earned(learned, paid, self.targets.learning.gamma)
            rows["average"][places, column] = earned.mean(axis=1)
            rows["steps"][places] += learned["steps"].sum(axis=1, dtype=np.int64)
            rows["seconds"][places] += learned["seconds"]
        return True


def parameters_of(methods: Sequence[Method], names: Sequence[str]) -> dict[str, Floats]:
    """The named parameters of each method, (C,)."""
    told: list[dict[str, Any]] = [asdict(method) for method in methods]  # type: ignore[call-overload]  # dataclasses
    return {name: np.array([float(one[name]) for one in told]) for name in names}
