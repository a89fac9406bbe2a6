"""Columns and axes that several kinds of artefacts have."""

from __future__ import annotations

import numpy as np

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
