"""Planned artefacts in a store: where each belongs, whether it stands there, and making it as the plain command does."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TYPE_CHECKING

from qinit_cli.environments.family import task_count
from qinit_cli.errors import TasksFailed
from qinit_cli.pipeline.keeping import Keeping, target_path
from qinit_cli.pipeline.machine import Machine
from qinit_cli.pipeline.reporter import Reporter
from qinit_cli.study.planned import Artefact, PlannedFit, PlannedRun, PlannedSources, PlannedTuning
from qinit_cli.study.words import command
from qinit_store.wording import counted

if TYPE_CHECKING:
    from pathlib import Path

    from qinit_cli.artefacts.settings import FitSettings, Settings, SourcesSettings
    from qinit_cli.methods import Method
    from qinit_cli.pipeline.job import Made, Plan
    from qinit_cli.pipeline.knowledge import Knowledge
    from qinit_cli.tasks import TargetTasks
    from qinit_store.reading import Description

Paths = Mapping[Artefact, "Path"]
Found = Mapping[Artefact, "Description"]


@dataclass(frozen=True)
class Place:
    """Where an artefact belongs."""

    path: Path | None  # None: a fit that is not there, whose name says how many sources are fitted
    settings: Settings
    tasks: int | None = None  # that it has; None: those of its inputs

    @cached_property
    def there(self) -> Description | None:
        """What stands there, if it is whole and has these settings; looked for once."""
        from qinit_store.errors import StoreError
        from qinit_store.reading import describe
        from qinit_store.spec import canonical_json

        if self.path is None or not self.path.is_file():
            return None
        try:
            there = describe(self.path)
        except StoreError:
            return None
        same = canonical_json(there.spec) == canonical_json(self.settings.spec())
        return there if same and self.tasks in (None, there.tasks) else None

    @property
    def saved(self) -> int:
        """Tasks that an interrupted attempt saved."""
        from qinit_store.folder import tasks_saved, work_folder

        return 0 if self.path is None else tasks_saved(work_folder(self.path))


@dataclass
class Maker:
    """Finds and makes artefacts in one store."""

    keeping: Keeping
    machine: Machine
    imports: tuple[str, ...] = ()  # modules that register environments
    _read: Knowledge | None = None  # the fit that was read last: runs of one fit follow each other
    _fits: dict[str, FitSettings] = field(default_factory=dict)  # by content hash

    def place(self, artefact: Artefact, found: Found) -> Place:
        """Where it belongs, given what was `found` of all that it is made of; no task is read or verified."""
        from qinit_cli.artefacts.settings import RunSettings
        from qinit_cli.pipeline import fitting
        from qinit_cli.pipeline.job import place
        from qinit_cli.pipeline.transfer import stem_of

        match artefact:
            case PlannedSources():
                plan = sources_plan(artefact)
                return Place(place(plan, self.keeping, self.machine), plan.settings, plan.count)
            case PlannedFit(sources, options):
                return Place(*fitting.look(found[sources], options, self.keeping))
            case PlannedTuning():
                plan = _tuning_plan(artefact, found[artefact.sources].path)
                return Place(place(plan, self.keeping, self.machine), plan.settings, plan.count)
            case PlannedRun():
                fit = found[artefact.fit]
                fitted = self._fitted(fit)
                tuning = None if artefact.tuning is None else found[artefact.tuning].path
                method, _ = _method_of(artefact, tuning, fitted.sources)
                targets, count = targets_of_run(artefact, method, fitted.sources)
                settings = RunSettings.of(method, targets, count, fit.content_sha256, fitted)
                stem = stem_of(method, targets, count)
                return Place(target_path(self.keeping, stem, settings), settings, count)

    def command(self, artefact: Artefact, paths: Paths) -> list[str]:
        """The words behind `qinit` that make it in this store."""
        given = {one: str(path) for one, path in paths.items()}
        return command(artefact, given, ("--store", str(self.keeping.store)), self.imports)

    def make(self, artefact: Artefact, paths: Paths, reporter: Reporter) -> Made:
        """The artefact, made as far as it is missing; TasksFailed where a task failed."""
        from qinit_cli.pipeline.fitting import make_fit
        from qinit_cli.pipeline.job import make

        keeping = replace(self.keeping, command=tuple(self.command(artefact, paths)))
        match artefact:
            case PlannedSources():
                made = make(sources_plan(artefact), keeping, self.machine, reporter)
            case PlannedFit(sources, options):
                made, _, _ = make_fit(paths[sources], options, keeping, reporter)
            case PlannedTuning():
                made = make(_tuning_plan(artefact, paths[artefact.sources]), keeping, self.machine, reporter)
            case PlannedRun():
                made = self._run(artefact, paths, keeping, reporter)
        if made.tally.failed:
            raise TasksFailed(
                f"{made.tally.failed} of {counted(made.tally.tasks, 'task')} of {made.path} failed, the rest are saved"
            )
        return made

    def _run(self, run: PlannedRun, paths: Paths, keeping: Keeping, reporter: Reporter) -> Made:
        from qinit_cli.pipeline.job import make
        from qinit_cli.pipeline.optimal_tables import beginning_of
        from qinit_cli.pipeline.transfer import plan_of

        known = self._knowledge(paths[run.fit])
        tuning = None if run.tuning is None else paths[run.tuning]
        method, choice = _method_of(run, tuning, known.settings.sources)
        targets, count = targets_of_run(run, method, known.settings.sources)
        beginning = beginning_of(method, known, targets, count, keeping, self.machine, reporter)
        plan = plan_of(method, targets, beginning, count, known, choice)
        return make(plan, keeping, self.machine, reporter)

    def _fitted(self, fit: Description) -> FitSettings:
        from qinit_cli.artefacts.settings import FitSettings

        if fit.content_sha256 not in self._fits:
            self._fits[fit.content_sha256] = FitSettings.read(fit.spec)
        return self._fits[fit.content_sha256]

    def _knowledge(self, fit: Path) -> Knowledge:
        from qinit_cli.pipeline.knowledge import Knowledge

        # another thread may put the fit of its own run there at any time
        read = self._read
        if read is None or read.path != fit:
            self._read = read = Knowledge.read(fit)
        return read


def sources_plan(sources: PlannedSources) -> Plan:
    """The artefact of these sources, as `qinit train-sources` makes it."""
    from qinit_cli.pipeline.sources import plan_of, tasks_of

    family = sources.family.opened()
    return plan_of(tasks_of(family, sources.learning), task_count(family, "source", sources.learning.tasks))


def targets_of_run(run: PlannedRun, method: Method, sources: SourcesSettings) -> tuple[TargetTasks, int]:
    """Its targets, as `qinit transfer` has them, given the sources of the fit, and how many they are."""
    from qinit_cli.pipeline.transfer import targets_of

    return targets_of(method, run.learning, sources)


def _tuning_plan(tuning: PlannedTuning, sources: Path) -> Plan:
    from qinit_cli.artefacts.opening import open_artefact
    from qinit_cli.pipeline.cross_validation import plan_for

    with open_artefact(sources, "sources") as source:
        return plan_for(source, tuning.method, dict(tuning.values), tuning.learning)


def _method_of(
    run: PlannedRun, tuning: Path | None, sources: SourcesSettings
) -> tuple[Method, list[dict[str, str]]]:
    """The method with what its tuning chose, and that choice as an input."""
    if tuning is None:
        return run.method, []
    from qinit_cli.pipeline.tuning import chosen

    return chosen(tuning, run.method, sources.family.installed())
