"""Learning target tasks from what a method starts them with."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

from qinit_cli.environments.family import Family, draw_tasks
from qinit_cli.learning import Learning
from qinit_cli.methods import Initial, Targets
from qinit_cli.pipeline.sources import Rows, sequences, shaped
from qinit_cli.seeding import Stream

if TYPE_CHECKING:
    from qinit_cli.arrays import Floats, Integers, Tasks
    from qinit_cli.watch import Watch

MOMENTS = 30  # at most, at which weights are kept: enough for a picture on a logarithmic axis


@dataclass(frozen=True)
class Streams:
    """Where the chance of a task that is learned as a target comes from."""

    task: Stream
    dice: Stream
    start: Stream
    evaluation: Stream
    choice: Stream
    world: Stream


TARGETS = Streams(
    Stream.TARGET_TASK,
    Stream.TARGET_DICE,
    Stream.TARGET_START,
    Stream.TARGET_EVALUATION,
    Stream.TARGET_CHOICE,
    Stream.TARGET_WORLD,
)
# sources in the place of targets: what is chosen by them has seen no target and none of the targets' dice
STAND_INS = Streams(
    Stream.SOURCE_TASK,
    Stream.TUNING_DICE,
    Stream.TUNING_START,
    Stream.TUNING_EVALUATION,
    Stream.TUNING_CHOICE,
    Stream.TUNING_WORLD,
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
    streams: Streams = TARGETS

    @property
    def evaluations(self) -> int:
        """How many there are: one before the first episode, one after every n-th."""
        return 1 + self.learning.episodes // self.evaluate_every if self.evaluate_every else 0

    @property
    def moments(self) -> Integers:
        """Episodes after which the weights of hypotheses are kept, (R,): none, each of the first few, ever fewer, all."""
        import numpy as np

        episodes = self.learning.episodes
        spread = np.geomspace(1, episodes, MOMENTS).round().astype(np.int64)
        return np.unique(np.concatenate([[0], spread]))

    def targets(self, count: int, optimal: Callable[[], Floats]) -> Targets:
        """The first `count` tasks as a privileged method sees them; `optimal` makes their Q* if asked."""
        import numpy as np

        return Targets(self.family, self.learning, self.draw(np.arange(count)), optimal)

    def draw(self, indices: Integers) -> Tasks:
        """The tasks at these indices, (B,)."""
        return draw_tasks(self.family, self.seed, self.streams.task, indices)


def learn_targets(
    targets: TargetTasks, initial: Initial, indices: Integers, watch: Watch
) -> tuple[Integers, Rows]:
    """The ids of the tasks that were finished, and a row for each column of the artefact; fewer once `watch` was stopped."""
    import numpy as np

    from qinit_cli.analysis.returns import discounted_returns
    from qinit_cli.kernels.batch import Chance, Records, Start, learn
    from qinit_cli.kernels.dice import lane_seeds, seeds

    family, learning = targets.family, targets.learning
    tasks = targets.draw(indices)
    own = initial.of(indices)
    learned = learn(
        family.worlds(tasks, sequences(targets.seed, targets.streams.world, indices)),
        learning,
        Start(own.start, own.potential if own.potential.any() else None, own.policies, own.hypotheses),
        Chance(
            dice=lane_seeds(sequences(targets.seed, targets.streams.dice, indices)),
            starts=seeds(sequences(targets.seed, targets.streams.start, indices)),
            evaluation=seeds(sequences(targets.seed, targets.streams.evaluation, indices)),
            choices=seeds(sequences(targets.seed, targets.streams.choice, indices)),
        ),
        Records(
            bins=learning.episodes,
            visits=targets.keep_visits,
            evaluate_every=targets.evaluate_every,
            moments=targets.moments,
        ),
        watch,
    )
    kept = learned.finished
    rows: Rows = {
        "steps": learned.steps[kept].astype(np.int32),
        "reached": learned.reached[kept].astype(np.uint8),
        "seconds": learned.seconds[kept],
        **{name: tasks[name][kept] for name in tasks.dtype.names or ()},
    }
    if family.tabular:
        exact, _ = family.solve(tasks[kept], learning.gamma)
        rows["v_star"] = family.start_value(exact)
        rows["v_eps"] = family.exploring_value(tasks[kept], exact, learning)
    if learned.evaluation_steps is not None and learned.evaluation_reached is not None:
        reached = learned.evaluation_reached[kept].astype(bool)
        rows["eval_return"] = discounted_returns(learned.evaluation_steps[kept], reached, learning.gamma)
        rows["eval_reached"] = reached.astype(np.float64)
        rows["eval_steps"] = learned.evaluation_steps[kept].astype(np.int32)
    if learned.weighing is not None:
        rows["weight"] = learned.weighing.weights[kept].astype(np.float32)
        rows["moves"] = learned.weighing.moves[kept].astype(np.int32)
        rows["frozen"] = learned.weighing.frozen[kept].astype(np.int32)
    if targets.keep_q:
        rows["q"] = learned.q[kept]
    if learned.visits is not None:
        rows["visits"] = learned.visits[kept]
    if initial.start_per_task:
        rows["start"] = own.start[kept]
    if initial.potential_per_task:
        rows["potential"] = own.potential[kept].reshape(-1, *family.shape)
    return indices[kept], shaped(rows, family, ("q", "visits", "start"))


def statics(initial: Initial, family: Family) -> dict[str, Floats]:
    """What a run keeps of the method's arrays that is the same for every target, laid out along the state axes."""
    kept: dict[str, Floats] = {}
    if not initial.start_per_task:
        kept["start"] = initial.start.reshape(*family.shape, -1)
    if not initial.potential_per_task:
        kept["potential"] = initial.potential.reshape(family.shape)
    return kept
