"""How many source tasks MAXQINIT wants before its start is optimistic (Abel et al., 2018)."""

from __future__ import annotations

import math


def tasks_for_one_target(p_min: float, delta: float) -> int:
    """Least m with m >= ln(delta) / ln(1 - p_min).

    With probability 1 - delta, m draws contain one given task whose probability is at least `p_min`.
    ValueError unless 0 < p_min <= 1 and 0 < delta < 1.
    """
    return tasks_for_all_targets(p_min, delta, 1)


def tasks_for_all_targets(p_min: float, delta: float, tasks: int) -> int:
    """Least m with m >= ln(delta / tasks) / ln(1 - p_min): the draws contain every one of `tasks` tasks.

    The union bound over them. ValueError unless 0 < p_min <= 1, 0 < delta < 1 and 1 <= tasks <= 1 / p_min.
    """
    if not 0 < p_min <= 1:
        raise ValueError(f"p_min is {p_min}: a probability above 0 and at most 1 is needed")
    if not 0 < delta < 1:
        raise ValueError(f"delta is {delta}: a probability above 0 and below 1 is needed")
    if tasks < 1:
        raise ValueError(f"tasks is {tasks}: at least one task is needed")
    if tasks * p_min > 1 + 1e-9:
        raise ValueError(f"{tasks} tasks of probability at least {p_min} add up to more than 1")
    if p_min == 1:
        return 1
    return math.ceil(math.log(delta / tasks) / math.log1p(-p_min))
