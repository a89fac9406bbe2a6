"""Choosing a method's parameters by its sources alone: each source stands in for a target, the method knowing the others.

The sources are split into folds; a fit of all others is what the method starts the sources of a fold with, and these are
learned as targets are. No target and none of the targets' random streams are seen, so that the choice flatters no comparison.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any, get_type_hints

from qinit_cli.artefacts.choice import Choice
from qinit_cli.artefacts.opening import open_artefact
from qinit_cli.artefacts.settings import TuningSettings
from qinit_cli.environments import Family
from qinit_cli.errors import NotAllowed, UsageError
from qinit_cli.methods import Method
from qinit_cli.options import flag, options

if TYPE_CHECKING:
    from pathlib import Path

    from qinit_store.held import Held
    from qinit_store.reading import Artefact

Grid = dict[str, tuple[float, ...]]  # the values to try of each parameter


def settings(artefact: Artefact) -> dict[str, Any]:
    """The options that a tuned method is to have: the chosen parameters, and what was given to tune besides."""
    told = TuningSettings.read(artefact.spec)
    family, method = told.family.installed(), told.method.installed()
    defaults = {one.name: one.default for one in options(type(method))}
    for name, default in defaults.items():  # what the family fills in stays with the family
        plainer = replace(method, **{name: default})  # type: ignore[type-var]  # every concrete method is a dataclass
        if plainer.on(family) == method.on(family):
            method = plainer
    given = {name: getattr(method, name) for name in defaults if getattr(method, name) != defaults[name]}
    chosen = with_parameters(method, Choice.of(artefact).chosen.parameters)
    return given | {name: getattr(chosen, name) for name in told.grid}


def chosen(tuning: Path | Held, method: Method, family: Family) -> tuple[Method, list[dict[str, str]]]:
    """The method with what a tuning chose, and the tuning as an input; UsageError where both set an option."""
    with open_artefact(tuning, "tuning") as artefact:
        told = TuningSettings.read(artefact.spec)
        name = told.method.name
        if name != method.name:
            raise NotAllowed(f"{artefact.path} chose parameters of {name}, not of {method.name}")
        drawn, wanted = told.family.installed(), settings(artefact)
        given = {"role": "tuning", "name": artefact.path.stem, "content_sha256": artefact.content_sha256}
        if drawn != family:
            raise NotAllowed(
                f"{artefact.path} chose parameters for {drawn.label}; this fit is of {family.label}: tune its own sources"
            )
    defaults = {one.name: one.default for one in options(type(method))}
    clash = [one for one, value in wanted.items() if getattr(method, one) not in (defaults[one], value)]
    if clash:
        raise UsageError(f"{flag(clash[0])} and --tuned both say what {clash[0]} is; leave one of them out")
    return replace(method, **wanted), [given]  # type: ignore[type-var]  # every concrete method is a dataclass


def with_parameters(method: Method, parameters: dict[str, float]) -> Method:
    """The method with these parameters, whole numbers where it takes whole numbers; ValueError for one that cannot be."""
    hints, given = get_type_hints(type(method)), dict[str, float]()
    for name, value in parameters.items():
        whole = hints[name] in (int, int | None)
        if whole and not float(value).is_integer():
            raise ValueError(f"{flag(name)} is {value:g}; it must be a whole number")
        given[name] = int(value) if whole else float(value)
    return replace(method, **given)  # type: ignore[type-var]  # every concrete method is a dataclass
