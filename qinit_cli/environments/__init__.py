"""The registry of task families: one line each, and the family appears as a subcommand and in the contract tests."""

from __future__ import annotations

from qinit_cli.environments.family import Family
from qinit_cli.environments.gridworld import Gridworld
from qinit_cli.environments.mountain_car import MountainCar

FAMILIES: dict[str, type[Family]] = {family.name: family for family in (Gridworld, MountainCar)}

__all__ = ["FAMILIES", "Family"]
