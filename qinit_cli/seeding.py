"""Chance, addressed and never ordered.

Every stream is `SeedSequence(seed, spawn_key=(stream, index))`, so that what a task meets depends on the root seed, the kind
of stream and the task's index alone: not on the number of jobs, the order of work or what ran before. Target streams leave
the method out: every method meets the same target tasks, starts and random streams, and methods are compared in pairs.
"""

from __future__ import annotations

from enum import IntEnum
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import numpy as np


class Stream(IntEnum):
    """What a stream is for. The numbers are part of every result: never reuse or reorder them."""

    SOURCE_TASK = 0
    SOURCE_DICE = 1
    SOURCE_START = 2
    TARGET_TASK = 3
    TARGET_DICE = 4
    TARGET_START = 5
    TARGET_EVALUATION = 6
    TARGET_CHOICE = 7
    BOOTSTRAP = 8
    NORMALITY = 9
    HOLDOUT = 10
    SOURCE_WORLD = 11
    TARGET_WORLD = 12
    OPTIMAL_DICE = 13
    OPTIMAL_START = 14
    OPTIMAL_WORLD = 15
    TUNING_DICE = 16
    TUNING_START = 17
    TUNING_EVALUATION = 18
    TUNING_CHOICE = 19
    TUNING_WORLD = 20
    SOURCE_LEARNER = 21
    TARGET_LEARNER = 22
    OPTIMAL_LEARNER = 23
    TUNING_LEARNER = 24


def sequence(seed: int, stream: Stream, index: int) -> np.random.SeedSequence:
    """The seed sequence at one address."""
    import numpy as np

    return np.random.SeedSequence(seed, spawn_key=(int(stream), index))


def generator(seed: int, stream: Stream, index: int) -> np.random.Generator:
    """A numpy generator at one address."""
    import numpy as np

    return np.random.Generator(np.random.PCG64(sequence(seed, stream, index)))
