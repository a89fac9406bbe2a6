"""The registry of task families: one line each, and the family appears as a subcommand and in the contract tests.

Those of installed plug-ins (entry points `qinit.families`) are in it too.
"""

from __future__ import annotations

from typing import Any

from qinit_cli.environments.acrobot import Acrobot
from qinit_cli.environments.cart_pole import CartPole
from qinit_cli.environments.continuous_gridworld import ContinuousGridworld
from qinit_cli.environments.family import Family
from qinit_cli.environments.gridworld import Gridworld
from qinit_cli.environments.gym import Gym
from qinit_cli.environments.imported import ImportedTables
from qinit_cli.environments.mixture_gridworld import MixtureGridworld
from qinit_cli.environments.mountain_car import MountainCar
from qinit_cli.environments.own_tasks import OwnTasks
from qinit_cli.environments.puddle_world import PuddleWorld
from qinit_cli.environments.windy_gridworld import WindyGridworld
from qinit_cli.registry import Registry

FAMILIES: Registry[Family] = Registry(
    "qinit.families",
    "family",
    (
        Gridworld,
        MountainCar,
        WindyGridworld,
        MixtureGridworld,
        ContinuousGridworld,
        PuddleWorld,
        CartPole,
        Acrobot,
        Gym,
        OwnTasks,
    ),
    lambda found: _fault(found),
    unlisted=(ImportedTables,),  # read from artefacts, never learned
)

__all__ = ["FAMILIES", "Family"]


def _fault(found: type[Any]) -> str:
    """What a class lacks to be a family."""
    wanted = {name for name in {**Family.__annotations__, **vars(Family)} if not name.startswith("_")}
    lacking = sorted(name for name in wanted if not hasattr(found, name))
    return f"it lacks {', '.join(lacking)}, which every family has" if lacking else ""
