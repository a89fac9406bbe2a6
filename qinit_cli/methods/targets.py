"""The target tasks that a privileged method may look at."""

from __future__ import annotations

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
    tables: Floats  # (T, S, A) Q* of each, exact or learned; no rows for a method that does not need them

    @classmethod
    def unseen(cls, family: Family, learning: Learning) -> Targets:
        """What is shown of targets that nobody may look at: the family and how they are learned."""
        import numpy as np

        from qinit_cli.environments.family import draw_tasks
        from qinit_cli.seeding import Stream

        tasks = draw_tasks(family, 0, Stream.TARGET_TASK, np.arange(0))
        return cls(family, learning, tasks, no_tables(family))


def no_tables(family: Family) -> Floats:
    """The tables of no target, (0, S, A)."""
    return zero_tables(family, 0)


def zero_tables(family: Family, count: int) -> Floats:
    """Zeros in the place of the tables of so many targets, (T, S, A)."""
    import math

    import numpy as np

    return np.zeros((count, math.prod(family.shape), len(family.actions)))
