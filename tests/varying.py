"""Small runs that differ in settings: look, do not touch."""

from __future__ import annotations

from functools import cache
from pathlib import Path
from typing import Any

import qinit_cli as qinit

TARGETS, EPISODES = 3, 12
METHODS = ("zero", "mean", "logqinit-median")


@cache
def fitted(
    variance: float = 1, seed: int = 0, tasks: int = 4, size: int = 4, store: Path | None = None
) -> Any:
    """A fit of solved sources."""
    family = qinit.families.gridworld(size=size, variance=variance)
    sources = qinit.train_sources(family, tasks=tasks, seed=seed, learner="exact", store=store)
    return qinit.fit(sources, store=store)


def ran(method: str, fit: Any, **settings: Any) -> Any:
    """A run of few targets."""
    return qinit.transfer(method, fit, **{"tasks": TARGETS, "episodes": EPISODES} | settings)


@cache
def balanced(store: Path | None = None) -> tuple[Any, ...]:
    """Every method, by variance, source set and epsilon."""
    return tuple(
        ran(method, fitted(variance, seed, store=store), epsilon=epsilon, store=store)
        for method in METHODS
        for variance in (1, 2, 4)
        for seed in (0, 1)
        for epsilon in (0.1, 0.3)
    )


def compared(runs: Any) -> list[Any]:
    """The runs as comparisons take them."""
    from qinit_cli.artefacts.opening import open_artefact
    from qinit_cli.comparison.runs import ComparedRun

    found = []
    for run in runs:
        with open_artefact(run.source) as artefact:
            found.append(ComparedRun.from_artefact(artefact))
    return found
