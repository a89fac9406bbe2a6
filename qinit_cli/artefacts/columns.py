"""Columns and axes that several kinds of artefacts have."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from qinit_cli.environments.tiled import DIVERGED
from qinit_cli.rewards import UNIT, ReturnBounds
from qinit_store.schema import TASK, Axis, Column, digest_column

LONGEST = 1e10  # seconds of a task: three hundred years
ROUNDING = 1e-6  # by which sums of probabilities and repeated steps may leave [0, 1]


def kept() -> tuple[Column, ...]:
    """What is kept of every task that was learned: its time, which no digest covers, and its digest."""
    return (
        Column(
            "seconds",
            (TASK,),
            "f8",
            "s",
            "time inside the kernel, a fair share of its batch",
            hashed=False,
            low=0,
            high=LONGEST,
        ),
        digest_column(),
    )


def index(name: str, length: int) -> Axis:
    """An axis that counts from 0."""
    return Axis(name, np.arange(length, dtype=np.int64), "1", f"index of the {name}")


# columns of returns within their bounds; those of spreads, with the power of a return that they are
RETURNS = {
    "q",
    "start",
    "mean",
    "min",
    "max",
    "value_mean",
    "library_q",
    "v_star",
    "v_eps",
    "eval_return",
    "average",
}
LEARNED = {"q", "mean", "min", "max", "value_mean", "library_q"}  # by tiles these may leave the bounds
SPREADS = {"std": 1, "td_var": 2, "library_td_var": 2}


def within_bounds(
    columns: Iterable[Column], bounds: ReturnBounds, *, tiled: bool = False
) -> tuple[Column, ...]:
    """The columns, made for returns from 0 to 1, with the least and the largest value that these bounds allow.

    Values that are `tiled` are estimates that may leave the bounds, until learning counts as diverged.
    """
    from dataclasses import replace

    slack = ROUNDING * bounds.width
    limits: dict[str, tuple[float | None, float | None]] = {}
    if bounds != UNIT:
        limits |= dict.fromkeys(RETURNS, (bounds.low - slack, bounds.high + slack))
        limits |= {name: (0.0, bounds.width**power * (1 + ROUNDING)) for name, power in SPREADS.items()}
    if tiled:
        most = DIVERGED * bounds.width * (1 + ROUNDING)
        limits |= dict.fromkeys(LEARNED, (-most, most))
        limits |= {name: (0.0, (2 * most) ** power) for name, power in SPREADS.items()}
    return tuple(
        replace(one, low=limits[one.name][0], high=limits[one.name][1]) if one.name in limits else one
        for one in columns
    )
