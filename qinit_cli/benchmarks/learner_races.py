"""Learners, and a world given as tables, beside Q-learning in the gridworld's own step."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from qinit_cli.arrays import Floats
from qinit_cli.benchmarks.learning_races import SOURCE_BINS, Size, learned
from qinit_cli.benchmarks.race import Race, Runner
from qinit_cli.environments.family import Family, draw_tasks
from qinit_cli.environments.gridworld import Gridworld
from qinit_cli.environments.windy_gridworld import WindyGridworld
from qinit_cli.kernels.batch import Records
from qinit_cli.learners import LEARNERS, Learner
from qinit_cli.learning import Q_LEARNING
from qinit_cli.seeding import Stream

EPISODES = 2_000  # of each task


def races(size: Size) -> Iterator[Race]:
    """Each learner from its own kind of start, exact tables or optimistic ones, and a table of transitions by Q-learning."""
    gridworld = Gridworld()
    usual = _runner("Q-learning", gridworld, Q_LEARNING, size)
    for name in LEARNERS.own:
        if name != Q_LEARNING.name:
            learner = LEARNERS[name]()
            yield Race(
                "learners",
                f"gridworld sources, {name}",
                "M steps/s",
                _runner("qinit", gridworld, learner, size),
                [usual],
            )
    windy = _runner("qinit", WindyGridworld(), Q_LEARNING, size)
    yield Race("learners", "windy-gridworld sources, a table", "M steps/s", windy, [usual])


def _runner(called: str, family: Family, learner: Learner, size: Size) -> Runner:
    tasks = draw_tasks(family, 0, Stream.SOURCE_TASK, np.arange(size.tasks))
    usual = family.source_learning
    learning = replace(
        usual,
        episodes=max(10, round(EPISODES * size.scale)),
        epsilon=usual.epsilon if learner.explores else 0.0,
        learner=learner,
    )
    start: Floats = family.solve(tasks, usual.gamma)[0]
    if learner.optimism:
        start = np.full_like(start, learner.optimism)
    records = Records(min(SOURCE_BINS, learning.episodes), visits=True, td_var=True)
    return Runner(called, lambda: float(learned(family, tasks, learning, start, records)[1]))
