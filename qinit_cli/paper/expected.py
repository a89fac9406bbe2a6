"""What artefacts would take: from how fast this machine learns in a short trial, and how long episodes are by experience."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache
from typing import TYPE_CHECKING

import numpy as np

from qinit_cli.paper.experiments import Artefact, PlannedFit, PlannedRun, PlannedSources

if TYPE_CHECKING:
    from qinit_cli.environments import Family

TRIAL_TASKS = 32  # as many as workers learn together
TRIAL_EPISODES = {"gridworld": 400, "mountain-car": 60}  # a fifth of a second each

# Steps an episode takes, measured at the paper's sizes: Mountain Car's by noise; of targets, methods say it.
SOURCE_STEPS: Mapping[str, Sequence[tuple[float, float]]] = {
    "gridworld": [(0.0, 66.0)],
    "mountain-car": [(0.0002, 103.0), (0.005, 111.0), (0.01, 180.0), (0.015, 262.0), (0.02, 310.0)],
}

# Seconds beside the learning, on one core.
SOURCES_OVERHEAD, FIT_SECONDS, RUN_OVERHEAD, PICTURE_SECONDS = 0.3, 0.7, 0.1, 1.5

# Bytes on disk, a state-action: of a source task, of a table in a fit's library, of a start in a run; of an episode in a run.
SOURCE_BYTES, LIBRARY_BYTES, START_BYTES, EPISODE_BYTES = 15.5, 14.0, 7.0, 2.3


@dataclass(frozen=True)
class Cost:
    """What something takes."""

    steps: float = 0.0
    seconds: float = 0.0  # on the clock
    bytes: float = 0.0

    def __add__(self, other: Cost) -> Cost:
        return Cost(self.steps + other.steps, self.seconds + other.seconds, self.bytes + other.bytes)


def expected(missing: Iterable[Artefact], jobs: int) -> dict[Artefact, Cost]:
    """What each of the missing artefacts would take with so many jobs."""
    return {artefact: _expected(artefact, jobs) for artefact in missing}


def _expected(artefact: Artefact, jobs: int) -> Cost:
    match artefact:
        case PlannedSources(family):
            steps = _source_steps(artefact)
            seconds = steps / _speed(type(family)) / jobs + SOURCES_OVERHEAD
            return Cost(steps, seconds, SOURCE_BYTES * _entries(family) * artefact.tasks)
        case PlannedFit(sources):
            library = min(artefact.options.library, sources.tasks) + 12  # and twelve tables of moments
            return Cost(0.0, FIT_SECONDS, LIBRARY_BYTES * _entries(sources.family) * library)
        case PlannedRun():
            return _run(artefact, jobs)


def _run(run: PlannedRun, jobs: int) -> Cost:
    family, method = run.family, run.method
    steps = method.expected_steps(family.name) * run.tasks * run.episodes
    speed = _speed(type(family)) * method.speed
    starts = run.tasks if method.privileged else 1
    size = START_BYTES * _entries(family) * starts + EPISODE_BYTES * run.tasks * run.episodes
    whole = Cost(steps, steps / speed / jobs + RUN_OVERHEAD, size)
    if not method.needs_tables or family.tabular:
        return whole
    own = replace(run.fit.sources, tasks=run.tasks)  # the targets' tables are learned as sources are
    return whole + _expected(own, jobs)


def _source_steps(sources: PlannedSources) -> float:
    family = sources.family
    levels, steps = zip(*SOURCE_STEPS[family.name], strict=True)
    an_episode = float(np.interp(getattr(family, "noise", 0.0), levels, steps))
    return an_episode * sources.tasks * sources.episodes


def _entries(family: Family) -> int:
    import math

    return math.prod(family.shape) * len(family.actions)


@cache
def _speed(kind: type[Family]) -> float:
    """Steps a second of one core, from a short trial of the family's own sources; one for all its distributions."""
    from qinit_cli.environments.family import draw_tasks
    from qinit_cli.pipeline.asked import LearningSources
    from qinit_cli.pipeline.sources import learned, tasks_of
    from qinit_cli.watch import Watch

    trial = tasks_of(kind(), LearningSources(tasks=TRIAL_TASKS, episodes=TRIAL_EPISODES[kind.name]))
    ids = np.arange(TRIAL_TASKS)
    rows = learned(trial, draw_tasks(trial.family, trial.seed, trial.streams.task, ids), ids, Watch())
    return float(rows["steps"].sum() / rows["seconds"].sum())
