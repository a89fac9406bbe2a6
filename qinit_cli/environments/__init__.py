"""The registry of task families: one line each, and the family appears as a subcommand and in the contract tests.

Those of installed plug-ins (entry points `qinit.families`) are in it too.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from qinit_cli.environments.family import Family
from qinit_cli.environments.gridworld import Gridworld
from qinit_cli.environments.gym import Gym
from qinit_cli.environments.mixture_gridworld import MixtureGridworld
from qinit_cli.environments.mountain_car import MountainCar
from qinit_cli.environments.windy_gridworld import WindyGridworld
from qinit_cli.errors import NotAllowed
from qinit_cli.registry import PLUG_IN, Registry

FAMILIES: Registry[Family] = Registry(
    "qinit.families",
    "family",
    (Gridworld, MountainCar, WindyGridworld, MixtureGridworld, Gym),
    lambda found: _fault(found),
)

__all__ = ["FAMILIES", "Family", "family_of", "label_of"]


def family_of(spec: Mapping[str, Any], provenance: Mapping[str, Any] | None = None) -> Family:
    """The family that a spec of sources or of a run describes; NotAllowed where this qinit does not know it.

    `provenance`, that of the artefact, tells which plug-in is missing.
    """
    settings = dict(spec["family"])
    name = settings.pop("name")
    if name not in FAMILIES:
        package = str((provenance or {}).get(f"{PLUG_IN} {name}", ""))
        there = f"known are {', '.join(FAMILIES)}"
        remedy = f"it came with {package}: pip install {package.split()[0]}" if package.strip() else there
        raise NotAllowed(f"the family {name} is not installed here; {remedy}")
    return FAMILIES[name](**settings)


def label_of(spec: Mapping[str, Any]) -> str:
    """What the family of a spec calls its distribution; where it is not installed, its name and settings."""
    settings = dict(spec["family"])
    name = settings.pop("name")
    if name in FAMILIES:
        return family_of(spec).label
    return " ".join(
        [name, *(f"{key}={value}" for key, value in sorted(settings.items()) if value is not None)]
    )


def _fault(found: type[Any]) -> str:
    """What a class lacks to be a family."""
    wanted = {name for name in {**Family.__annotations__, **vars(Family)} if not name.startswith("_")}
    lacking = sorted(name for name in wanted if not hasattr(found, name))
    return f"it lacks {', '.join(lacking)}, which every family has" if lacking else ""
