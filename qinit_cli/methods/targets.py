"""The target tasks that a privileged method may look at."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from qinit_cli.arrays import Floats, Tasks
    from qinit_cli.environments.family import Family
    from qinit_cli.learning import Learning


@dataclass(frozen=True)
class Targets:
    """Target tasks of one family, learned in one way."""

    family: Family
    learning: Learning
    tasks: Tasks  # (T,)
    optimal: Callable[
        [], Floats
    ]  # Q* of each, (T, S, A): exact, or learned as a source is where there are no exact tables
