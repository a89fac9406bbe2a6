"""Evidence whose answer is known because it was drawn so."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np
import pytest

from qinit_cli.claims.scores import Arm, Arms
from qinit_cli.claims.setting import GRIDWORLD, MOUNTAIN_CAR, UNIFORM, Setting

TARGETS = 12
FREE = ("zero", "drs", "optimal")


@pytest.fixture
def setting() -> Callable[..., Setting]:
    """A setting by its distribution's name."""

    def made(distribution: str, variant: str = "", *, full: bool = True) -> Setting:
        word, _, number = distribution.partition(" ")
        level = float("inf") if distribution == UNIFORM else float(number)
        return Setting(MOUNTAIN_CAR if word == "noise" else GRIDWORLD, distribution, level, variant, full)

    return made


@pytest.fixture
def scores() -> Callable[..., Arms]:
    """Methods whose average returns are these but for a little probability, over sets that share their targets."""

    def made(means: Mapping[str, float], *, sets: int = 10, spread: float = 0.0005) -> Arms:
        probability = np.random.default_rng(0)
        target = probability.normal(0, 0.01, TARGETS)
        arms = {}
        for label, mean in means.items():
            reads = label.split()[0] not in FREE
            rows = sets if reads else 1
            averages = mean + target + spread * probability.standard_normal((rows, TARGETS))
            arms[label] = Arm(averages, tuple(("targets", f"set {row}") for row in range(rows)), reads)
        return Arms(arms, shared=True)

    return made
