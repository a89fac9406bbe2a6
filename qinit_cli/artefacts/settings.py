"""The settings in an artefact, checked by the dataclasses that make them.

`specs` writes them. A setting that an earlier version did not have may be missing if its option has a default; an unknown one
is refused.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Iterable, Mapping
from typing import Any, TypeVar

from qinit_cli.environments import FAMILIES, Family
from qinit_cli.errors import QinitError
from qinit_cli.fields import is_of
from qinit_cli.fitted import FitOptions
from qinit_cli.learning import Learning
from qinit_cli.methods import METHODS

Settings = Mapping[str, Any]
Made = TypeVar("Made")

LEARNERS, ROLES = ("q-learning", "exact"), ("source", "target")
EXACT = {
    "epsilon": 0.0,
    "episodes": 1,
    "start": "fixed",
}  # stand-ins for settings that the exact learner does not have
REFUSALS = (ValueError, TypeError, OverflowError, QinitError)  # of a dataclass that cannot be so


def check(kind: str, spec: Settings) -> None:
    """ValueError, in one clause, for the first setting of an artefact of this kind that cannot be."""
    said = spec.get("kind")
    if said != kind:
        raise ValueError(f"its settings are of {said!r}, the artefact is of {kind}")
    CHECKS[kind]({name: value for name, value in spec.items() if name != "kind"})


def family(told: Any) -> Family | None:
    """The family with these settings, None where it is a plug-in's that is not installed; ValueError where it cannot be."""
    name, settings = _named(told, "the family")
    return built(FAMILIES[name], settings, f"the family {name}") if name in FAMILIES else None


def learning(told: Any, learner: str = "q-learning") -> Learning:
    """How tasks were learned; for the exact learner with stand-ins for the settings that it does not have."""
    settings = _object(told, "learning")
    if learner == "exact":
        settings = EXACT | _of(settings, "learning", {"alpha": float, "gamma": float, "horizon": int})
    return built(Learning, settings, "learning")


def built(kind: Callable[..., Made], settings: Settings, what: str) -> Made:
    """An instance of a dataclass; ValueError where a setting is missing, unknown or out of its range."""
    known = {field.name: field for field in dataclasses.fields(kind) if field.init}  # type: ignore[arg-type]  # a dataclass
    _refuse_unknown(settings, known, what)
    for name, field in known.items():
        if name not in settings and field.default is field.default_factory is dataclasses.MISSING:
            raise ValueError(f"{what} lacks {name}")
    try:
        return kind(**settings)
    except REFUSALS as error:
        raise ValueError(f"{what} cannot be so: {error}") from error


def _sources(spec: Settings) -> None:
    told = _of(
        spec,
        "the settings",
        {
            "algorithm_version": int,
            "family": dict,
            "learner": str,
            "learning": dict,
            "seed": int,
            "tasks": int,
        },
        {"role": str},
    )
    _among("role", told.get("role", "source"), ROLES)
    _drawn(told)


def _drawn(told: Settings) -> None:
    """How sources were drawn and learned: part of every artefact that is made from them."""
    _among("learner", told["learner"], LEARNERS)
    family(told["family"])
    learning(told["learning"], told["learner"])
    _at_least(told, tasks=1, seed=0)


def _fit(spec: Settings) -> None:
    options = {field.name: object for field in dataclasses.fields(FitOptions)}
    told = _of(
        spec,
        "the settings",
        {"algorithm_version": int, "inputs": list, "sources": dict, "estimator": str},
        {**options, "initialisations": list},
    )
    _texts(told, "inputs", count=1)
    _texts(told, "initialisations")
    built(FitOptions, {name: told[name] for name in options if name in told}, "the fit")
    _sources(told["sources"])


def _run(spec: Settings) -> None:
    told = _of(
        spec,
        "the settings",
        {
            "algorithm_version": int,
            "method": dict,
            "family": dict,
            "learning": dict,
            "seed": int,
            "tasks": int,
            "inputs": list,
            "source_set": dict,
        },
        {"keep_q": bool, "evaluate_every": int},
    )
    family(told["family"])
    learning(told["learning"])
    _texts(told, "inputs", count=1)
    _at_least(told, tasks=1, seed=0, evaluate_every=0)
    _method(told["method"])
    fitted = {"estimator": object, "library": object, "holdout": object, "exclude_unlearned": object}
    drawn = {"sources": str, "family": dict, "learner": str, "learning": dict, "tasks": int}
    source_set = _of(told["source_set"], "the source set", drawn, fitted)
    built(
        FitOptions, {name: source_set[name] for name in fitted if name in source_set}, "the source set's fit"
    )
    _drawn(source_set)


def _tuning(spec: Settings) -> None:
    told = _of(
        spec,
        "the settings",
        {
            "algorithm_version": int,
            "method": dict,
            "grid": dict,
            "family": dict,
            "learning": dict,
            "seed": int,
            "tasks": int,
            "inputs": list,
            "sources": dict,
        },
    )
    for name, values in told["grid"].items():
        if not (isinstance(values, list) and values and all(is_of(value, float) for value in values)):
            raise ValueError(f"the values tried of {name} are no list of numbers")
    family(told["family"])
    learning(told["learning"])
    _texts(told, "inputs", count=1)
    _at_least(told, tasks=1, seed=0)
    _method(told["method"], tuned=told["grid"])
    _sources(told["sources"])


CHECKS: dict[str, Callable[[Settings], None]] = {
    "sources": _sources,
    "fit": _fit,
    "run": _run,
    "tuning": _tuning,
}


def _method(told: Any, tuned: Iterable[str] = ()) -> None:
    """A method, what it starts from, and what a lifetime adds; one that is not installed may have any options."""
    name, settings = _named(told, "the method")
    if not isinstance(settings.pop("label", None), str):
        raise ValueError("the method lacks its label")
    if "update" in settings:
        update = _of(settings.pop("update"), "the update", {"min_visits": int})
        _at_least(update, min_visits=1)
    if isinstance(start := settings.pop("init", None), dict):
        first, own = _named(start, "what the method starts from")
        if first in METHODS:  # else a plug-in's that is not installed: the rest is checked without it
            built(METHODS[first], own, f"the method {first}")
            settings["init"] = first
    elif start is not None:
        settings["init"] = start
    if name not in METHODS:
        return
    method = built(METHODS[name], settings, f"the method {name}")
    if unknown := set(tuned) - {field.name for field in dataclasses.fields(method)}:  # type: ignore[arg-type]  # a dataclass
        raise ValueError(f"the method {name} has no {min(unknown)} to choose")


def _named(told: Any, what: str) -> tuple[str, dict[str, Any]]:
    settings = dict(_object(told, what))
    name = settings.pop("name", None)
    if not isinstance(name, str):
        raise ValueError(f"{what} lacks its name")
    return name, settings


def _object(told: Any, what: str) -> Settings:
    if not isinstance(told, Mapping):
        raise ValueError(f"{what} is {told!r}, which are no settings")
    return told


def _of(
    told: Any, what: str, needed: Mapping[str, Any], more: Mapping[str, Any] | None = None
) -> dict[str, Any]:
    """The settings, each of the type it must have; those in `more` may be missing."""
    settings, known = _object(told, what), {**needed, **(more or {})}
    _refuse_unknown(settings, known, what)
    for name, kind in known.items():
        if name in settings:
            fits = (
                is_of(settings[name], kind)
                if kind in (int, float, bool, str)
                else isinstance(settings[name], kind)
            )
            if not fits:
                raise ValueError(f"{name} is {settings[name]!r} in {what}")
        elif name in needed:
            raise ValueError(
                f"{what} lacks {name}" if what != "the settings" else f"the settings lack {name}"
            )
    return dict(settings)


def _refuse_unknown(settings: Settings, known: Iterable[str], what: str) -> None:
    if unknown := sorted(set(settings) - set(known)):
        raise ValueError(f"{unknown[0]!r} in {what} is no setting of this version")


def _among(name: str, value: Any, choices: Iterable[str]) -> None:
    if value not in choices:
        raise ValueError(f"the {name} is {value!r}; it is one of {', '.join(choices)}")


def _at_least(settings: Settings, **least: int) -> None:
    for name, low in least.items():
        if settings.get(name, low) < low:
            raise ValueError(f"{name} is {settings[name]}; it must be at least {low}")


def _texts(settings: Settings, name: str, count: int | None = None) -> None:
    texts = settings.get(name, [])
    if not all(isinstance(one, str) for one in texts) or (count is not None and len(texts) != count):
        raise ValueError(
            f"{name} is {texts!r}, {'no list of texts' if count is None else f'no list of {count} text'}"
        )
