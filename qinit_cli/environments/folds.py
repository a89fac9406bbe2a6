"""The tasks of a file cut into folds, each of which is left out once."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from qinit_cli.environments.family import Family
from qinit_cli.environments.gym import Gym
from qinit_cli.environments.own_tasks import OwnTasks
from qinit_cli.errors import UsageError

OF_FILES = (OwnTasks, Gym)  # whose sources and targets are named


def each_fold(family: Family, folds: int) -> Sequence[OwnTasks | Gym]:
    """The family with all tasks of its file but one fold's as sources, for each fold; UsageError where it cannot be cut."""
    if not isinstance(family, OF_FILES):
        raise UsageError(f"{family.name} draws its tasks, and folds are of tasks of a file; leave them out")
    if folds < 2:
        raise UsageError(f"folds is {folds}; it must be at least 2")
    if family.use is not None:
        raise UsageError(
            f"{folds} folds name the sources of each in turn, and --use {family.use} does too; leave out one of them"
        )
    return [replace(family, use=f"fold:{fold}/{folds}") for fold in range(1, folds + 1)]
