"""The plain command that makes an artefact of an experiment."""

from __future__ import annotations

from typing import TYPE_CHECKING

from qinit_cli.paper.experiments import PlannedFit, PlannedRun, PlannedSources
from qinit_cli.pipeline.words import option_words

if TYPE_CHECKING:
    from pathlib import Path


def sources_command(sources: PlannedSources, store: str) -> list[str]:
    """The words behind `qinit`."""
    family = sources.family
    return [
        *("train-sources", family.name, *option_words(family)),
        *_unless("--tasks", sources.tasks, family.source_tasks),
        *_unless("--episodes", sources.episodes, family.source_learning.episodes),
        *("--seed", str(sources.seed), "--store", store),
    ]


def fit_command(fit: PlannedFit, sources: Path, store: str) -> list[str]:
    """The words behind `qinit`."""
    return ["fit", str(sources), *option_words(fit.options), "--store", store]


def run_command(run: PlannedRun, fit: Path, store: str) -> list[str]:
    """The words behind `qinit`."""
    family = run.family
    return [
        *("transfer", run.method.name, str(fit), *option_words(run.method)),
        *_unless("--tasks", run.tasks, family.target_tasks),
        *_unless("--episodes", run.episodes, family.target_learning.episodes),
        *("--store", store),
    ]


def _unless(name: str, value: int, default: int) -> tuple[str, ...]:
    return () if value == default else (name, str(value))
