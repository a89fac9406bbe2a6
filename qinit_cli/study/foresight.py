"""What planned artefacts would take, from short trials on this machine: steps, seconds and bytes.

Sources are tried as `--dry-run` tries them, once for each distribution and way of learning, whatever the seed. Targets are tried
from a start of zeros, all their episodes; a run that starts from sources is taken to need the steps of settled episodes, so
that it may take longer where its start is poor. While a study runs, its own artefacts correct these figures, see `pace`.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass, field, replace
from functools import cache
from typing import TYPE_CHECKING

from qinit_cli.environments.family import task_count
from qinit_cli.errors import QinitError
from qinit_cli.methods.zero import Zero
from qinit_cli.pipeline.asked import LearningTargets
from qinit_cli.pipeline.estimate import TRIAL_TASKS, OfTask, of_task, shortened, threads
from qinit_cli.study.planned import Artefact, PlannedFit, PlannedRun, PlannedSources, PlannedTuning, named

if TYPE_CHECKING:
    from qinit_cli.environments import Family
    from qinit_cli.pipeline.machine import Machine
    from qinit_cli.tasks import SourceTasks, TargetTasks

# seconds beside the learning, on one core, as docs/performance.md has them
SOURCES_OVERHEAD, FIT_SECONDS, TUNING_OVERHEAD, RUN_OVERHEAD, PICTURE_SECONDS = 0.3, 0.7, 0.6, 0.1, 1.5
LIBRARY_BYTES, MOMENTS = 14.0, 12  # of a fit, on disk: an entry of a table, and tables beside its library
TARGET_EPISODES = 2_000  # tried of each target: all, where there are no more
INFORMED = 0.8  # the speed from a start that is read from memory, over that from zeros


@dataclass(frozen=True)
class Cost:
    """What something takes."""

    steps: float = 0.0
    seconds: float = 0.0  # on the clock
    bytes: float = 0.0

    def __add__(self, other: Cost) -> Cost:
        return Cost(self.steps + other.steps, self.seconds + other.seconds, self.bytes + other.bytes)


@dataclass
class Foresight:
    """Tries what it is asked of, each kind of task once."""

    machine: Machine
    _tried: dict[SourceTasks | TargetTasks, tuple[OfTask, float]] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self._threads = threads(self.machine)

    def expected(self, missing: Iterable[Artefact]) -> dict[Artefact, Cost]:
        """What each of the missing artefacts would take; an error of a trial names its artefact."""
        found: dict[Artefact, Cost] = {}
        for artefact in missing:
            try:
                found[artefact] = self._of(artefact)
            except QinitError as error:
                raise type(error)(f"{named(artefact)}: {error}") from error
        return found

    def _of(self, artefact: Artefact) -> Cost:
        match artefact:
            case PlannedSources():
                return self._learned(artefact, _sources(artefact)[1])
            case PlannedFit(sources, options):
                kept = min(options.library, _sources(sources)[1]) + MOMENTS
                return Cost(0.0, FIT_SECONDS, LIBRARY_BYTES * _entries(sources.family) * kept)
            case PlannedTuning():
                return self._tuned(artefact)
            case PlannedRun():
                return self._run(artefact)

    def _learned(self, sources: PlannedSources, count: int) -> Cost:
        one, size = self._source(sources)
        seconds = self._clock(one.seconds, count) + SOURCES_OVERHEAD
        return Cost(one.steps * count, seconds, one.compression * size * count)

    def _run(self, run: PlannedRun) -> Cost:
        one, size = self._target(run)
        count = _targets(run)[1]
        steps, seconds = self._informed(run, one) if run.method.reads_sources else (one.steps, one.seconds)
        clock = self._clock(seconds, count) + RUN_OVERHEAD
        cost = Cost(steps * count, clock, one.compression * size * count)
        if (
            run.method.needs_tables and not run.family.tabular
        ):  # the targets' tables are learned as sources are
            cost += self._learned(run.fit.sources, count)
        return cost

    def _tuned(self, tuning: PlannedTuning) -> Cost:
        asked = {name: getattr(tuning.learning, name) for name in ("learner", "episodes", "alpha", "epsilon")}
        run = PlannedRun(PlannedFit(tuning.sources), Zero(), LearningTargets(**asked))
        steps, seconds = self._informed(run, self._target(run)[0])
        count = math.prod(len(values) for _, values in tuning.values) * _sources(tuning.sources)[1]
        return Cost(steps * count, self._clock(seconds, count) + TUNING_OVERHEAD, 8.0 * count)

    def _informed(self, run: PlannedRun, one: OfTask) -> tuple[float, float]:
        """Steps and seconds of a target whose episodes are as short as those of sources that are learned."""
        settled = self._source(run.fit.sources)[0].settled
        episodes = _targets(run)[0].learning.episodes
        share = 1.0 if math.isnan(settled) or not one.steps else min(1.0, settled * episodes / one.steps)
        return one.steps * share, one.seconds * share / INFORMED

    def _clock(self, seconds: float, count: int) -> float:
        """Seconds on the clock of so many tasks, which are learned side by side."""
        return seconds * count / self._threads

    def _source(self, sources: PlannedSources) -> tuple[OfTask, float]:
        """What one source takes, and its bytes in memory; those of all seeds are alike."""
        from qinit_cli.pipeline.sources import plan_of

        tasks, count = _sources(sources)
        key = replace(tasks, seed=0)
        if key not in self._tried:
            fewer, tried = shortened(key)
            trial, whole = plan_of(fewer, min(count, TRIAL_TASKS)), plan_of(key, count)
            self._tried[key] = of_task(trial, tasks.learning.episodes, tried), whole.schema.task_bytes
        return self._tried[key]

    def _target(self, run: PlannedRun) -> tuple[OfTask, float]:
        """What one target takes from a start of zeros, and its bytes in memory; alike for all methods and source sets."""
        from qinit_cli.pipeline.transfer import from_zeros

        targets, count = _targets(run)
        key = replace(targets, seed=0)
        if key not in self._tried:
            tried = min(targets.learning.episodes, TARGET_EPISODES)
            fewer = replace(key, learning=replace(key.learning, episodes=tried))
            trial, whole = from_zeros(fewer, min(count, TRIAL_TASKS)), from_zeros(key, count)
            self._tried[key] = of_task(trial, targets.learning.episodes, tried), whole.schema.task_bytes
        return self._tried[key]


@cache
def _sources(sources: PlannedSources) -> tuple[SourceTasks, int]:
    """The tasks, and how many they are."""
    from qinit_cli.pipeline.sources import tasks_of

    family = sources.family.opened()
    return tasks_of(family, sources.learning), task_count(family, "source", sources.learning.tasks)


@cache
def _targets(run: PlannedRun) -> tuple[TargetTasks, int]:
    """The tasks, and how many they are; of a method that is tuned as it is before."""
    from qinit_cli.artefacts.settings import SourcesSettings
    from qinit_cli.pipeline.transfer import targets_of

    return targets_of(run.method, run.learning, SourcesSettings.of(*_sources(run.fit.sources)))


def _entries(family: Family) -> int:
    return math.prod(family.shape) * len(family.actions)
