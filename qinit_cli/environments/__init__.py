"""The registry of task families: one line each, and the family appears as a subcommand and in the contract tests."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from qinit_cli.environments.family import Family
from qinit_cli.environments.gridworld import Gridworld
from qinit_cli.environments.mountain_car import MountainCar
from qinit_cli.errors import NotAllowed

FAMILIES: dict[str, type[Family]] = {family.name: family for family in (Gridworld, MountainCar)}

__all__ = ["FAMILIES", "Family", "family_of"]


def family_of(spec: Mapping[str, Any]) -> Family:
    """The family that a spec of sources or of a run describes; NotAllowed where this qinit does not know it."""
    settings = dict(spec["family"])
    name = settings.pop("name")
    if name not in FAMILIES:
        raise NotAllowed(f"the family {name} is not installed here; known are {', '.join(FAMILIES)}")
    return FAMILIES[name](**settings)
