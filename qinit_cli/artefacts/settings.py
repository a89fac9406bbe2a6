"""What the settings of several kinds have in common, checked by the dataclasses that make them.

`specs` writes them, and each kind checks its own. A setting that an earlier version did not have may be missing if its option has
a default; an unknown one is refused.
"""

from __future__ import annotations

import dataclasses
import re
from collections.abc import Callable, Iterable, Mapping
from typing import Any, TypeVar

from qinit_cli.environments import FAMILIES, Family
from qinit_cli.errors import QinitError
from qinit_cli.learning import QLearning
from qinit_cli.methods import METHODS
from qinit_cli.options import is_of
from qinit_store.guard import MOST_TASKS

Settings = Mapping[str, Any]
Made = TypeVar("Made")

CONTENT = re.compile("[0-9a-f]{64}")  # the hash of an artefact
LEAST_FITTED = 2  # sources of a fit: a standard deviation takes two
LEARNERS, ROLES = ("q-learning", "exact"), ("source", "target")
EXACT = {
    "epsilon": 0.0,
    "episodes": 1,
    "start": "fixed",
}  # stand-ins for settings that the exact learner does not have
REFUSALS = (ValueError, TypeError, OverflowError, QinitError)  # of a dataclass that cannot be so


def family(told: Any) -> Family | None:
    """The family with these settings, None where it is a plug-in's that is not installed; ValueError where it cannot be."""
    name, settings = _named(told, "the family")
    return built(FAMILIES[name], settings, f"the family {name}") if name in FAMILIES else None


def learning(told: Any, learner: str = "q-learning") -> QLearning:
    """How tasks were learned; for the exact learner with stand-ins for the settings that it does not have."""
    settings = _object(told, "learning")
    if learner == "exact":
        settings = EXACT | of(settings, "learning", {"alpha": float, "gamma": float, "horizon": int})
    return built(QLearning, settings, "learning")


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


def drawn(told: Settings) -> None:
    """How sources were drawn and learned: part of every artefact that is made from them."""
    among("learner", told["learner"], LEARNERS)
    family(told["family"])
    learning(told["learning"], told["learner"])
    counted(told)


def counted(told: Settings) -> None:
    """ValueError where there can be no such number of tasks in an artefact, or no such seed."""
    at_least(told, tasks=1, seed=0)
    if told["tasks"] > MOST_TASKS:
        raise ValueError(f"tasks is {told['tasks']}; an artefact holds {MOST_TASKS} at most")


def fitted(told: Settings, tasks: int) -> None:
    """ValueError where `tasks` sources cannot be fitted with these options."""
    from qinit_cli.fitted import FitOptions

    options = built(FitOptions, told, "the fit")
    if options.holdout > tasks - LEAST_FITTED:
        raise ValueError(
            f"holdout is {options.holdout}; a fit of {tasks} sources keeps at least {LEAST_FITTED}"
        )


def method(told: Any, tuned: Iterable[str] = ()) -> None:
    """A method, what it starts from, and what a lifetime adds; one that is not installed may have any options."""
    name, settings = _named(told, "the method")
    if not isinstance(settings.pop("label", None), str):
        raise ValueError("the method lacks its label")
    if "update" in settings:
        update = of(settings.pop("update"), "the update", {"min_visits": int})
        at_least(update, min_visits=1)
    if isinstance(start := settings.pop("init", None), dict):
        first, own = _named(start, "what the method starts from")
        if first in METHODS:  # else a plug-in's that is not installed: the rest is checked without it
            built(METHODS[first], own, f"the method {first}")
            settings["init"] = first
    elif start is not None:
        settings["init"] = start
    if name not in METHODS:
        return
    made = built(METHODS[name], settings, f"the method {name}")
    if unknown := set(tuned) - {field.name for field in dataclasses.fields(made)}:  # type: ignore[arg-type]  # a dataclass
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


def of(
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


def among(name: str, value: Any, choices: Iterable[str]) -> None:
    """ValueError where a setting is none of the choices."""
    if value not in choices:
        raise ValueError(f"the {name} is {value!r}; it is one of {', '.join(choices)}")


def at_least(settings: Settings, **least: int) -> None:
    """ValueError where a setting is below its least value; one that is absent is none."""
    for name, low in least.items():
        if settings.get(name, low) < low:
            raise ValueError(f"{name} is {settings[name]}; it must be at least {low}")


def texts(settings: Settings, name: str) -> None:
    """ValueError where a setting is no list of texts."""
    texts = settings.get(name, [])
    if not all(isinstance(one, str) for one in texts):
        raise ValueError(f"{name} is {texts!r}, no list of texts")


def made_from(settings: Settings) -> None:
    """ValueError where the input is not one content hash."""
    inputs = settings["inputs"]
    if len(inputs) != 1 or not isinstance(inputs[0], str) or not CONTENT.fullmatch(inputs[0]):
        raise ValueError(f"inputs is {inputs!r}, no list of one content hash")
