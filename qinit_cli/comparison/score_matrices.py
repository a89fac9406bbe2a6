"""Scores by method as rliable takes them (Agarwal et al., NeurIPS 2021): a matrix of runs and tasks for each."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from qinit_cli.comparison.scores import Metric, curve
from qinit_cli.comparison.source_sets import grouped
from qinit_cli.errors import NotAllowed

if TYPE_CHECKING:
    from qinit_cli.arrays import Floats
    from qinit_cli.comparison.runs import ComparedRun


def score_matrices(runs: Sequence[ComparedRun], metric: Metric) -> dict[str, Floats]:
    """By the label of each method the metric's mean over all episodes, (source sets, targets).

    Rows are in the order of the source sets' hashes, columns in that of the targets. A method that reads no sources has the
    rows that were run, often one. NotAllowed where the runs did not all meet the same targets: columns would be other tasks.
    """
    groups = grouped(runs)
    if len(groups) > 1:
        raise NotAllowed(
            f"the runs met {len(groups)} sets of targets, and a score matrix has the same tasks in every row; "
            "give the runs of one set of targets"
        )
    if not groups[0].shared:
        raise NotAllowed(
            "each source set has targets of its own, and a score matrix has the same tasks in every row; "
            "transfer from every source set with the same --seed"
        )
    return {
        entry.label: np.stack([curve(run, metric).mean(axis=1) for run in entry.runs])
        for entry in groups[0].entries
    }
