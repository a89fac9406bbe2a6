"""Which tasks are asked for: sources, learned to the end, and targets, from what a method starts them with."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from qinit_cli.environments.family import Family, Role, draw_tasks
from qinit_cli.learning import KNOWN_AT, KNOWNNESS, Learning, curve_bins
from qinit_cli.methods.method import Method
from qinit_cli.methods.targets import Targets
from qinit_cli.seeding import Stream

if TYPE_CHECKING:
    from qinit_cli.arrays import Floats, Integers, Tasks

MOMENTS = 30  # at most, at which weights are kept: enough for a picture on a logarithmic axis


@dataclass(frozen=True)
class SourceStreams:
    """Where the probability of a task that is learned to the end comes from."""

    task: Stream
    rng: Stream
    start: Stream
    world: Stream
    learner: Stream


STREAMS: dict[Role, SourceStreams] = {
    "source": SourceStreams(
        Stream.SOURCE_TASK,
        Stream.SOURCE_DICE,
        Stream.SOURCE_START,
        Stream.SOURCE_WORLD,
        Stream.SOURCE_LEARNER,
    ),
    # target tasks learned as sources are: what `optimal` starts from where there are no exact tables
    "target": SourceStreams(
        Stream.TARGET_TASK,
        Stream.OPTIMAL_DICE,
        Stream.OPTIMAL_START,
        Stream.OPTIMAL_WORLD,
        Stream.OPTIMAL_LEARNER,
    ),
}


@dataclass(frozen=True)
class SourceTasks:
    """Which tasks are learned to the end, and how."""

    family: Family
    learner: str  # "exact", or the name of learning.learner
    learning: Learning
    seed: int
    role: Role = "source"

    @property
    def streams(self) -> SourceStreams:
        """Which streams they are drawn from."""
        return STREAMS[self.role]

    @property
    def bins(self) -> int:
        """Bins of the learning curve."""
        return curve_bins(self.learner, self.learning)


@dataclass(frozen=True)
class TargetStreams:
    """Which streams a task that is learned as a target is drawn from."""

    task: Stream
    rng: Stream
    start: Stream
    evaluation: Stream
    choice: Stream
    world: Stream
    learner: Stream


TARGETS = TargetStreams(
    Stream.TARGET_TASK,
    Stream.TARGET_DICE,
    Stream.TARGET_START,
    Stream.TARGET_EVALUATION,
    Stream.TARGET_CHOICE,
    Stream.TARGET_WORLD,
    Stream.TARGET_LEARNER,
)
# sources in the place of targets: what is chosen by them has seen no target and none of the targets' random streams
VALIDATION = TargetStreams(
    Stream.SOURCE_TASK,
    Stream.TUNING_DICE,
    Stream.TUNING_START,
    Stream.TUNING_EVALUATION,
    Stream.TUNING_CHOICE,
    Stream.TUNING_WORLD,
    Stream.TUNING_LEARNER,
)


@dataclass(frozen=True)
class TargetTasks:
    """Which target tasks, how they are learned, and what is kept of them."""

    family: Family
    learning: Learning
    seed: int
    keep_q: bool
    evaluate_every: int = 0  # episodes between greedy evaluations; 0: none
    keep_visits: bool = False
    known_at: int | None = None  # updates after which a blended value is the learned one; None: no blend
    streams: TargetStreams = TARGETS

    @property
    def evaluations(self) -> int:
        """How many there are: one before the first episode, one after every n-th."""
        return 1 + self.learning.episodes // self.evaluate_every if self.evaluate_every else 0

    def label_of(self, method: Method) -> str:
        """What the method is called on these targets: with the blend, if there is one."""
        if self.known_at is None:
            return method.label
        blended = f"{method.label} blend={KNOWNNESS}"
        return blended if self.known_at == KNOWN_AT else f"{blended} known-at={self.known_at}"

    @property
    def moments(self) -> Integers:
        """Episodes after which the weights of hypotheses are kept, (R,): none, each of the first few, ever fewer, all."""
        episodes = self.learning.episodes
        spread = np.geomspace(1, episodes, MOMENTS).round().astype(np.int64)
        return np.unique(np.concatenate([[0], spread]))

    def targets(self, count: int, tables: Floats) -> Targets:
        """The first `count` tasks as a privileged method sees them, with Q* of each, (T, S, A), where it needs them."""
        return Targets(self.family, self.learning, self.draw(np.arange(count)), tables)

    def draw(self, indices: Integers) -> Tasks:
        """The tasks at these indices, (B,)."""
        return draw_tasks(self.family, self.seed, self.streams.task, indices)
