"""What an artefact is evidence of: its distribution, and where its settings differ from the paper's.

The paper's settings are the defaults, which stand for it where it gives none: learned sources, maximum likelihood, the
families' own learning options and counts of tasks.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import fields
from typing import Any

from qinit_cli.artefacts.settings import FitSettings, RunSettings, SourceSet, SourcesSettings, plain_learning
from qinit_cli.claims.setting import GRIDWORLD, MOUNTAIN_CAR, UNIFORM, Setting, noise, variance
from qinit_cli.environments import Family
from qinit_cli.fitted import FitOptions
from qinit_cli.learning import Learning

Differences = dict[str, Any]  # by name

DISTRIBUTION = {GRIDWORLD: ("goals", "variance", "mean"), MOUNTAIN_CAR: ("noise",)}  # the fields that span it
LARGER_OR_EQUAL = ("size", "bins")  # fields in which less is smaller than the paper's
PLAIN_FIT = {"estimator": "mle", "library": 100, "holdout": 0, "exclude_unlearned": False}


def of_sources(told: SourcesSettings) -> Setting:
    """What sources are evidence of."""
    return _setting(told.family.installed(), _texts(_source_differences(told)), _sources_full(told))


def of_fit(told: FitSettings) -> Setting:
    """What a fit is evidence of."""
    differences = _source_differences(told.sources) | _fit_differences(told.options)
    return _setting(told.sources.family.installed(), _texts(differences), _sources_full(told.sources))


def of_run(told: RunSettings, sources: SourceSet | None) -> Setting:
    """What a run is evidence of, by its settings and its source set; None where its method reads no sources."""
    family = told.family.installed()
    usual = family.target_learning
    target = _learning_differences(told.learning, plain_learning(told.learning), usual)
    if told.tasks != family.target_tasks:
        target["tasks"] = told.tasks
    full = told.tasks >= family.target_tasks and told.learning.episodes >= usual.episodes
    source: Differences = {}
    if sources is not None:
        own = sources.family.installed()
        source = _source_differences(sources) | _fit_differences(sources.fitted)
        full = full and _sources_full(sources)
        if own != family:
            source[f"sources of {own.label}"] = None
    both = {name: value for name, value in target.items() if source.get(name) == value}
    words = [
        *_texts({name: value for name, value in source.items() if name in both or name not in target}),
        *(
            f"source {text}"
            for text in _texts({n: v for n, v in source.items() if n in target and n not in both})
        ),
        *(f"target {text}" for text in _texts({n: v for n, v in target.items() if n not in both})),
    ]
    return _setting(family, words, full)


def known(told: SourcesSettings | RunSettings) -> bool:
    """Whether the claims are about its family as tables and its reward."""
    return (
        not told.family.tiled
        and told.family.name in DISTRIBUTION
        and told.family.payment(told.learning.gamma) is None
    )


def _setting(family: Family, told: list[str], full: bool) -> Setting:
    distribution, level = _distribution(family)
    world = list(_world_differences(family))
    large = all(
        getattr(family, name) >= getattr(type(family)(), name)
        for name in LARGER_OR_EQUAL
        if hasattr(family, name)
    )
    return Setting(family.name, distribution, level, ", ".join([*world, *told]), full and large)


def _distribution(family: Any) -> tuple[str, float]:
    if family.name == MOUNTAIN_CAR:
        return noise(family.noise), family.noise
    if family.goals == "uniform":
        return UNIFORM, float("inf")
    return variance(family.variance), family.variance


def _world_differences(family: Any) -> Iterator[str]:
    usual = type(family)()
    for field in fields(family):
        value = getattr(family, field.name)
        if (
            value is not None
            and field.name not in DISTRIBUTION[family.name]
            and value != getattr(usual, field.name)
        ):
            yield family.grid.label if field.name == "map" else _text(field.name, value)
    if family.name == GRIDWORLD and family.mean not in (None, 2 * family.shape[0] / 3):
        yield f"mean {family.mean:g}"


def _source_differences(told: SourcesSettings | SourceSet) -> Differences:
    family = told.family.installed()
    differences: Differences = {"exact sources": None} if told.learner == "exact" else {}
    differences |= _learning_differences(
        told.learning, plain_learning(told.learning, told.learner), family.source_learning
    )
    if told.tasks != family.source_tasks:
        differences["source tasks"] = told.tasks
    return differences


def _fit_differences(options: FitOptions) -> Differences:
    return {name: value for name, usual in PLAIN_FIT.items() if (value := getattr(options, name)) != usual}


def _learning_differences(learning: Learning, stored: Iterable[str], usual: Learning) -> Differences:
    """Of the settings that are stored those that differ, schedules, learner and exploration as they are typed."""
    found = {name: getattr(learning, name) for name in stored}
    return {
        name: value if isinstance(value, int | float) else str(value)
        for name, value in found.items()
        if value != getattr(usual, name)
    }


def _sources_full(told: SourcesSettings | SourceSet) -> bool:
    """Whether the sources are as many, and learned as long, as the paper's; exact ones are learned to the end."""
    family = told.family.installed()
    long_enough = told.learner == "exact" or told.learning.episodes >= family.source_learning.episodes
    return long_enough and told.tasks >= family.source_tasks


def _texts(differences: Differences) -> list[str]:
    return [_text(name, value) for name, value in differences.items()]


def _text(name: str, value: Any) -> str:
    """As in gamma 0.9; a flag or a whole remark by its name alone."""
    told = name.replace("_", " ")
    if value is None or value is True:
        return told
    return f"{told} {value:g}" if isinstance(value, int | float) else f"{told} {value}"
