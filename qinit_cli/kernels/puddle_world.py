# mypy: allow-untyped-defs, allow-untyped-calls
"""The unit square with the two puddles of Sutton (1996): where they slow the agent down, or where it is lost.

Sutton's puddles cost, and a goal that pays 1 has no costs: the costs of a step are therefore made of time. At a depth of d a step
costs 1 + 400 d there; here it goes 1 / (1 + 400 d) as far, so that the same way costs as much.
"""

from __future__ import annotations

from typing import Any, NamedTuple

from qinit_cli.kernels.compiled import inlined
from qinit_cli.kernels.continuous import end_at
from qinit_cli.kernels.continuous_gridworld import arrived, moved, put
from qinit_cli.kernels.parts import body
from qinit_cli.kernels.puddles import puddle_depth
from qinit_cli.kernels.worlds import GOAL, LOST, starts, steps

COST = 400.0  # of a step, for each unit of depth

depth = inlined(puddle_depth)


class PuddleSquare(NamedTuple):
    """The tasks of a batch, and where the lanes are; fields as in OpenSquare."""

    goal_x: Any  # f8 (B,)
    goal_y: Any  # f8 (B,)
    radius: float
    start_x: float
    start_y: float
    step: float
    noise: float
    drowns: bool  # an episode in a puddle is lost
    low: Any  # f8 (2,)
    high: Any  # f8 (2,)
    observed: Any  # f8 (L, 2)


@starts(PuddleSquare)
def start(world, task, lane, rng, anywhere):
    """At the target start, or anywhere where no episode ends."""
    put(world, task, lane, rng, anywhere)
    return 0


@steps(PuddleSquare)
def step(world, task, lane, state, action, uniform, rng):
    """A step to one side, the shorter the deeper the puddle in which it begins."""
    wet = depth(world.observed[lane, 0], world.observed[lane, 1])
    moved(world, lane, action, 1.0 / (1.0 + COST * wet), rng)
    return end_at(world, task, lane)


@body(end_at, PuddleSquare)
def _end_at(world, task, lane):
    if arrived(world, task, lane):
        return GOAL
    return LOST if world.drowns and depth(world.observed[lane, 0], world.observed[lane, 1]) > 0.0 else 0
