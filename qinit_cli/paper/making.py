"""Artefacts of experiments: where each belongs in the store, whether it stands there, and making it as the plain commands do."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from qinit_cli.errors import TasksFailed
from qinit_cli.paper.experiments import Artefact, PlannedFit, PlannedRun, PlannedSources
from qinit_cli.paper.words import fit_command, run_command, sources_command
from qinit_cli.pipeline.keeping import Keeping, target_path
from qinit_cli.pipeline.machine import Machine
from qinit_cli.pipeline.reporter import Reporter

if TYPE_CHECKING:
    from pathlib import Path

    from qinit_cli.artefacts.settings import Settings, SourcesSettings
    from qinit_cli.pipeline.job import Made, Plan
    from qinit_cli.pipeline.knowledge import Knowledge
    from qinit_cli.tasks import TargetTasks


def ordered(artefacts: Iterable[Artefact]) -> tuple[Artefact, ...]:
    """These artefacts and all that they are made from, each once: sources, their fit, and all its runs, set after set."""
    needed: dict[PlannedSources, dict[PlannedFit, dict[PlannedRun, None]]] = {}
    for artefact in artefacts:
        match artefact:
            case PlannedSources():
                needed.setdefault(artefact, {})
            case PlannedFit():
                needed.setdefault(artefact.sources, {}).setdefault(artefact, {})
            case PlannedRun():
                fits = needed.setdefault(artefact.fit.sources, {})
                fits.setdefault(artefact.fit, {})[artefact] = None
    in_order: list[Artefact] = []
    for sources, fits in needed.items():
        in_order.append(sources)
        for fit, runs in fits.items():
            in_order += [fit, *runs]
    return tuple(in_order)


def inputs(artefact: Artefact) -> tuple[Artefact, ...]:
    """What it is made of."""
    match artefact:
        case PlannedSources():
            return ()
        case PlannedFit():
            return (artefact.sources,)
        case PlannedRun():
            return (artefact.fit,)


@dataclass(frozen=True)
class Place:
    """Where an artefact belongs."""

    path: Path
    settings: Settings

    @property
    def complete(self) -> bool:
        """Whether it stands there, whole and with these settings."""
        from qinit_cli.artefacts.settings import FitSettings
        from qinit_store.errors import StoreError
        from qinit_store.reading import describe
        from qinit_store.spec import canonical_json

        if not self.path.is_file():
            return False
        try:
            there = describe(self.path)
        except StoreError:
            return False
        same = canonical_json(there.spec) == canonical_json(self.settings.spec())
        return same and (isinstance(self.settings, FitSettings) or there.tasks == self.settings.sources.tasks)


@dataclass
class Maker:
    """Finds and makes artefacts in one store."""

    keeping: Keeping
    machine: Machine
    _read: Knowledge | None = None  # the fit that was read last: runs of one fit follow each other

    def place(self, artefact: Artefact, paths: Mapping[Artefact, Path]) -> Place:
        """Where it belongs, given the `paths` of what it is made from, which must stand there."""
        from qinit_cli.artefacts.settings import FitSettings, RunSettings
        from qinit_cli.pipeline import fitting
        from qinit_cli.pipeline.job import place
        from qinit_cli.pipeline.transfer import stem_of
        from qinit_store.reading import describe

        match artefact:
            case PlannedSources():
                plan = sources_plan(artefact)
                return Place(place(plan, self.keeping, self.machine), plan.settings)
            case PlannedFit():
                return Place(*fitting.place(paths[artefact.sources], artefact.options, self.keeping))
            case PlannedRun():
                fit = describe(paths[artefact.fit])
                fitted = FitSettings.read(fit.spec)
                targets = targets_of_run(artefact, fitted.sources)
                settings = RunSettings.of(
                    artefact.method, targets, artefact.tasks, fit.content_sha256, fitted
                )
                stem = stem_of(artefact.method, targets, artefact.tasks)
                return Place(target_path(self.keeping, stem, settings), settings)

    def make(self, artefact: Artefact, paths: Mapping[Artefact, Path], reporter: Reporter) -> Made:
        """The artefact, made as far as it is missing; TasksFailed where a task failed."""
        from qinit_cli.pipeline.fitting import make_fit
        from qinit_cli.pipeline.job import make

        store = str(self.keeping.store)
        match artefact:
            case PlannedSources():
                keeping = replace(self.keeping, command=tuple(sources_command(artefact, store)))
                made = make(sources_plan(artefact), keeping, self.machine, reporter)
            case PlannedFit():
                sources = paths[artefact.sources]
                keeping = replace(self.keeping, command=tuple(fit_command(artefact, sources, store)))
                made, _, _ = make_fit(sources, artefact.options, keeping, reporter)
            case PlannedRun():
                made = self._run(artefact, paths[artefact.fit], reporter)
        if made.tally.failed:
            raise TasksFailed(
                f"{made.tally.failed} of {made.tally.tasks} tasks of {made.path} failed, the rest are saved; the same "
                "command tries them again"
            )
        return made

    def _run(self, run: PlannedRun, fit: Path, reporter: Reporter) -> Made:
        from qinit_cli.pipeline.job import make
        from qinit_cli.pipeline.optimal_tables import beginning_of
        from qinit_cli.pipeline.transfer import plan_of

        known = self._knowledge(fit)
        keeping = replace(self.keeping, command=tuple(run_command(run, fit, str(self.keeping.store))))
        targets = targets_of_run(run, known.settings.sources)
        beginning = beginning_of(run.method, known, targets, run.tasks, keeping, self.machine, reporter)
        plan = plan_of(run.method, targets, beginning, run.tasks, known)
        return make(plan, keeping, self.machine, reporter)

    def _knowledge(self, fit: Path) -> Knowledge:
        from qinit_cli.pipeline.knowledge import Knowledge

        if self._read is None or self._read.path != fit:
            self._read = Knowledge.read(fit)
        return self._read


def sources_plan(sources: PlannedSources) -> Plan:
    """The artefact of these sources, as `qinit train-sources` makes it."""
    from qinit_cli.pipeline.asked import LearningSources
    from qinit_cli.pipeline.sources import plan_of, tasks_of

    learning = LearningSources(tasks=sources.tasks, seed=sources.seed, episodes=sources.episodes)
    return plan_of(tasks_of(sources.family, learning), sources.tasks)


def targets_of_run(run: PlannedRun, sources: SourcesSettings) -> TargetTasks:
    """Its targets, as `qinit transfer` has them, given the sources of the fit."""
    from qinit_cli.pipeline.asked import LearningTargets
    from qinit_cli.pipeline.transfer import targets_of

    targets, _ = targets_of(run.method, LearningTargets(tasks=run.tasks, episodes=run.episodes), sources)
    return targets
