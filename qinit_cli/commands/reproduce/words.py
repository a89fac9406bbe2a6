"""The plain command that makes an artefact of an experiment."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from qinit_cli.fields import flag, options
from qinit_cli.paper.experiments import Fit, Run, Sources

if TYPE_CHECKING:
    from pathlib import Path


def sources_command(sources: Sources, store: str) -> list[str]:
    """The words behind `qinit`."""
    family = sources.family
    return [
        *("train-sources", family.name, *option_words(family)),
        *_unless("--tasks", sources.tasks, family.source_tasks),
        *_unless("--episodes", sources.episodes, family.source_learning.episodes),
        *("--seed", str(sources.seed), "--store", store),
    ]


def fit_command(fit: Fit, sources: Path, store: str) -> list[str]:
    """The words behind `qinit`."""
    return ["fit", str(sources), *option_words(fit.options), "--store", store]


def run_command(run: Run, fit: Path, store: str) -> list[str]:
    """The words behind `qinit`."""
    family = run.family
    return [
        *("transfer", run.method.name, str(fit), *option_words(run.method)),
        *_unless("--tasks", run.tasks, family.target_tasks),
        *_unless("--episodes", run.episodes, family.target_learning.episodes),
        *("--store", store),
    ]


def option_words(instance: Any) -> list[str]:
    """The options that make this instance of a dataclass of options; what stands there anyway is left out."""
    return [word for field in options(type(instance)) for word in _option(instance, field)]


def _option(instance: Any, field: Any) -> Iterator[str]:
    value = getattr(instance, field.name)
    if value == field.default or _made_anyway(instance, field):
        return
    yield flag(field.name)
    if value is not True:
        yield _spelled(value)


def _made_anyway(instance: Any, field: Any) -> bool:
    """Whether the option's default leads to the same instance, as --variance of goals that are normal anyway."""
    try:
        return bool(replace(instance, **{field.name: field.default}) == instance)
    except ValueError:
        return False


def _unless(name: str, value: int, default: int) -> tuple[str, ...]:
    return () if value == default else (name, str(value))


def _spelled(value: Any) -> str:
    return str(int(value)) if isinstance(value, float) and value.is_integer() else str(value)
