"""The corridor's compiled step."""

from __future__ import annotations

from typing import Any, NamedTuple

from qinit_cli.plugin.kernels import GOAL, below, starts, steps
from qinit_corridor.walking import walked


class World(NamedTuple):
    """Corridors, B of them."""

    length: int
    door: Any  # i8 (B,)
    slip: Any  # f8 (B,)


@starts(World)
def start(world, task, lane, rng, anywhere):
    """The first cell, or any but the door's."""
    if not anywhere:
        return 0
    cell = below(rng, world.length - 1)
    return cell + (cell >= world.door[task])


@steps(World)
def step(world, task, lane, state, action, uniform, rng):
    """A cell on, or back if the floor is slippery."""
    meant = uniform < 1 - world.slip[task]
    after = walked(state, 1 if (action == 1) == meant else -1, world.length)
    return GOAL if after == world.door[task] else after
