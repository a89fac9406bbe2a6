"""What became of source tasks: how many are solved, and their errors against exact tables."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from qinit_cli.artefacts.opening import open_artefact
from qinit_cli.artefacts.sources import blocks_in_shares
from qinit_cli.environments.family import draw_tasks, relative_error
from qinit_cli.seeding import Stream
from qinit_cli.tasks import SourceTasks

if TYPE_CHECKING:
    from qinit_cli.arrays import Flags, Floats, Integers
    from qinit_store.held import Held

ERROR_TASKS = 1_000  # the errors against exact tables are taken over at most this many


@dataclass(frozen=True)
class LearnedSources:
    """What an artefact of N sources holds, values as shares, and the first ones' relative errors against exact tables."""

    ids: Integers  # (N,)
    solved: Flags  # (N,)
    positive: Flags  # (N,) whether a value is above 0
    least: float  # of the values above 0; NaN where there are none
    largest: float
    errors: Floats  # (n, S * A), NaN where the exact value is 0; no rows where there are no exact tables, or these are

    def error_numbers(self) -> dict[str, int | float | None]:
        """The errors of the first tasks that have any, None where none has."""
        medians = {
            int(task): float(np.median(known))
            for task, row in zip(self.ids, self.errors, strict=False)
            if (known := row[np.isfinite(row)]).size
        }
        worst = max(medians, key=lambda task: medians[task], default=None)
        whole = self.errors[np.isfinite(self.errors)]
        return {
            "error_tasks": len(medians),
            "median_relative_error": float(np.median(whole)) if medians else None,
            "worst_task": worst,
            "worst_median_relative_error": None if worst is None else medians[worst],
        }


def learned(source: Path | Held, tasks: SourceTasks) -> LearnedSources:
    """What the artefact of these tasks holds."""
    family, left = tasks.family, ERROR_TASKS if tasks.learner != "exact" and tasks.family.tabular else 0
    entries = math.prod(family.shape) * len(family.actions)
    solved, errors = [np.empty(0, np.bool_)], [np.empty((0, entries))]
    least, largest = [np.empty(0)], [np.empty(0)]
    with open_artefact(source, "sources") as artefact:
        for block in blocks_in_shares(artefact, ("solved", "q")):
            solved.append(block["solved"].astype(bool))
            q = block["q"].reshape(len(block["q"]), -1, len(family.actions))
            largest.append(q.max(axis=(1, 2)))
            least.append(np.where(q > 0, q, np.inf).min(axis=(1, 2)))
            if left > 0:
                drawn = draw_tasks(family, tasks.seed, Stream.SOURCE_TASK, block["task"][:left])
                error = relative_error(family, tasks.learning.gamma, drawn, q[:left])
                errors.append(error.reshape(len(drawn), entries))
                left -= len(drawn)
        ids = artefact.tasks
    positive = np.concatenate(largest) > 0
    return LearnedSources(
        ids,
        np.concatenate(solved),
        positive,
        float(np.min(np.concatenate(least)[positive], initial=np.inf)) if positive.any() else math.nan,
        float(np.max(np.concatenate(largest), initial=0.0)) if positive.any() else math.nan,
        np.concatenate(errors),
    )
