"""Where values of continuous states are kept: probes, the same for all tasks of all seeds."""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache
from typing import TYPE_CHECKING, Any

import numpy as np

from qinit_cli.environments import Family
from qinit_cli.environments.family import draw_tasks
from qinit_cli.environments.tiled import PROBES, TiledFamily
from qinit_cli.tasks import SourceTasks
from qinit_cli.watch import Watch

if TYPE_CHECKING:
    from qinit_cli.arrays import Floats

PILOTS = 8  # tasks whose greedy paths are followed
PILOT_SHARE, FEWEST_EPISODES = 50, 200  # of the episodes that sources learn for
PATHS = 16  # of each pilot: one from where targets start, the others from anywhere if that can be
PILOT_SEED = 0  # whatever the sources' seed: replicates have the same probes


def with_probes(tasks: SourceTasks) -> SourceTasks:
    """The tasks with the probes of their family, if that is learned by tiles and has none yet."""
    family = tasks.family
    if not isinstance(family, TiledFamily) or family.at is not None:
        return tasks
    episodes = max(FEWEST_EPISODES, tasks.learning.episodes // PILOT_SHARE)
    learning = replace(tasks.learning, episodes=min(episodes, tasks.learning.episodes))
    return replace(
        tasks, family=family.placed(_placed(SourceTasks(family, tasks.learner, learning, PILOT_SEED)))
    )


def probes_of(family: Family) -> dict[str, Any]:
    """The probes (P, D) as a dataset; nothing for a family of tables."""
    return {PROBES: family.projection.probes} if isinstance(family, TiledFamily) else {}


@lru_cache(maxsize=8)
def _placed(pilots: SourceTasks) -> Floats:
    """The target start, up to half of them states on greedy paths of the pilots, and a Sobol set over the box."""
    from scipy.stats import qmc

    family: Any = pilots.family
    count, coding = family.cut.probes, family.coding
    start = np.array([family.target_state()])
    visited = _visited(pilots)
    # evenly spread over all that was visited, in the order of the paths
    kept = visited[np.unique(np.linspace(0, len(visited) - 1, min(len(visited), count // 2)).astype(int))]
    spread = qmc.Sobol(len(coding.low), scramble=False).random_base2((count - 1).bit_length())
    spread = qmc.scale(spread, coding.low, coding.high)[: count - len(start) - len(kept)]
    return np.concatenate([start, kept, spread])


def _visited(pilots: SourceTasks) -> Floats:
    """The states on greedy paths, (N, D)."""
    from qinit_cli.pipeline.sources import learned

    family: Any = pilots.family
    there = family.available("source")
    indices = np.arange(PILOTS if there is None else min(PILOTS, there))
    tasks = draw_tasks(family, pilots.seed, pilots.streams.task, indices)
    weights = learned(pilots, tasks, indices, Watch())["q"]
    visited: Floats = family.visited(tasks, weights, pilots.learning.horizon, PATHS)
    return visited
