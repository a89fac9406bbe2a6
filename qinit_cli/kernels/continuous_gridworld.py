# mypy: allow-untyped-defs, allow-untyped-calls
"""The unit square with steps of one length to four sides and normal noise, walls around it, and a round goal.

The state is x and y. Actions: 0 up (y grows), 1 down, 2 left, 3 right.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from qinit_cli.kernels.compiled import inlined
from qinit_cli.kernels.continuous import end_at, put_anywhere
from qinit_cli.kernels.parts import body
from qinit_cli.kernels.random_streams import two_normals
from qinit_cli.kernels.worlds import GOAL, starts, steps

ACROSS = np.array([0.0, 0.0, -1.0, 1.0])  # by action
ALONG = np.array([1.0, -1.0, 0.0, 0.0])


class OpenSquare(NamedTuple):
    """The tasks of a batch, and where the lanes are."""

    goal_x: Any  # f8 (B,)
    goal_y: Any  # f8 (B,)
    radius: float  # of the goal
    start_x: float  # where targets start
    start_y: float
    step: float  # length of a step
    noise: float  # standard deviation of what is added to a step along either axis
    low: Any  # f8 (2,) where episodes start that start anywhere
    high: Any  # f8 (2,)
    observed: Any  # f8 (L, 2)


@inlined
def put(world, task, lane, rng, anywhere):
    """The lane at the target start, or anywhere where no episode ends."""
    if anywhere:
        put_anywhere(world, task, lane, rng)
    else:
        world.observed[lane, 0], world.observed[lane, 1] = world.start_x, world.start_y


@inlined
def moved(world, lane, action, share, rng):
    """Moves the lane by a share of a step, its noise included; walls stop it."""
    x, y = 0.0, 0.0
    if world.noise > 0.0:
        x, y = two_normals(world.noise, rng)
    x = world.observed[lane, 0] + share * (world.step * ACROSS[action] + x)
    y = world.observed[lane, 1] + share * (world.step * ALONG[action] + y)
    world.observed[lane, 0], world.observed[lane, 1] = min(max(x, 0.0), 1.0), min(max(y, 0.0), 1.0)


@inlined
def arrived(world, task, lane):
    """True within the goal, its edge included."""
    x, y = world.observed[lane, 0] - world.goal_x[task], world.observed[lane, 1] - world.goal_y[task]
    return x * x + y * y <= world.radius * world.radius


@starts(OpenSquare)
def start(world, task, lane, rng, anywhere):
    """At the target start, or anywhere but in the goal."""
    put(world, task, lane, rng, anywhere)
    return 0


@steps(OpenSquare)
def step(world, task, lane, state, action, uniform, rng):
    """A step to one side."""
    moved(world, lane, action, 1.0, rng)
    return end_at(world, task, lane)


@body(end_at, OpenSquare)
def _end_at(world, task, lane):
    return GOAL if arrived(world, task, lane) else 0
