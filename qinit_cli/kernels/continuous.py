# mypy: allow-untyped-defs, allow-untyped-calls
"""Worlds whose state is a point of several dimensions, and the bins by which a table sees them.

A continuous world is a NamedTuple whose class has registered `starts` and `steps`, with a field `observed` f8 (L, D): the state
of each lane, which both write, at ends too. Its start returns 0; its step returns 0 while the episode goes on, else GOAL or LOST.
Fields of lanes are those that `in_lanes` names; others belong to tasks. A field `noise` is a standard deviation, 0 for no noise.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar, NamedTuple

import numpy as np

from qinit_cli.arrays import Integers
from qinit_cli.kernels.compiled import inlined, unkept_inlined
from qinit_cli.kernels.loop import compiled_loop
from qinit_cli.kernels.parts import Function, part
from qinit_cli.kernels.random_streams import Words, unit
from qinit_cli.kernels.worlds import start_of, starts, step_of, steps
from qinit_cli.learning import Learning


class Binned(NamedTuple):
    """A continuous world as a table sees it: by the number of a bin, row-major."""

    world: Any
    low: Any  # f8 (D,) where the bins begin
    scale: Any  # f8 (D,) bins for each unit
    bins: Any  # i8 (D,)


@dataclass(frozen=True)
class ContinuousWorlds:
    """Tasks of a continuous world to learn in a table, B of them."""

    world: Any  # the continuous world, its lanes not yet allocated
    low: tuple[float, ...]  # what the bins cover; beyond it states count in the outermost ones
    high: tuple[float, ...]
    bins: tuple[int, ...]
    actions: int
    rng: Words  # (B, 4) randomness of a task's steps

    lanes: ClassVar[int] = 4
    # side by side a step takes as long, with noise longer; 20 % less for the cart-pole
    alone: ClassVar[int] = 4

    @property
    def states(self) -> int:
        """Number of bins."""
        return int(np.prod(self.bins))

    def __len__(self) -> int:
        return len(self.rng)

    def queue(self) -> Integers:
        """As they are: what takes long is not known."""
        return np.arange(len(self))

    def loop(self, learning: Learning, lanes: int) -> tuple[Function, Binned]:
        """The compiled loop and the world it takes."""
        return compiled_loop(learning, Binned, type(self.world)), self.binned(lanes, learning.horizon)

    def continuous(self, lanes: int, horizon: int) -> Any:
        """The world with so many lanes."""
        return in_lanes(self.world, lanes, horizon)

    def binned(self, lanes: int, horizon: int) -> Binned:
        """The world with so many lanes, in bins."""
        low, high = np.array(self.low, np.float64), np.array(self.high, np.float64)
        bins = np.array(self.bins, np.int64)
        return Binned(self.continuous(lanes, horizon), low, bins / (high - low), bins)


def in_lanes(world: Any, lanes: int, horizon: int) -> Any:
    """The continuous world with lanes of its own: `observed` f8 (L, D), and where it has such fields `time` i8 (L,), the steps
    of the lane's episode so far, and `limit`, the steps after which it is cut off."""
    own = {
        "observed": np.zeros((lanes, world.observed.shape[1])),
        "time": np.zeros(lanes, np.int64),
        "limit": horizon,
    }
    return world._replace(**{name: value for name, value in own.items() if name in world._fields})


@part
def coordinate(world, lane, dimension):
    """A coordinate of the lane's state."""
    return world.observed[lane, dimension]


@part
def put_state(world, lane, state):
    """Puts a lane in which an episode has started into a state f8 (D,)."""
    for dimension in range(len(state)):
        world.observed[lane, dimension] = state[dimension]


@part
def end_at(world, task, lane):
    """GOAL or LOST where an episode ends in the lane's state, else 0; for worlds whose states tell that."""
    return 0


@part
def guide(world, task, lane):
    """The action by which a plain controller, which knows the task, brings the lane nearer to the goal."""
    return 0


@unkept_inlined
def put_anywhere(world, task, lane, rng):
    """Puts the lane uniformly into the box from `world.low` to `world.high`, f8 (D,) each, where no episode ends.

    The box must hold such states, else this never ends.
    """
    ended = True
    while ended:
        for dimension in range(world.observed.shape[1]):
            low, high = world.low[dimension], world.high[dimension]
            world.observed[lane, dimension] = low + (high - low) * unit(rng)
        ended = end_at(world, task, lane) != 0


@inlined
def bin_of(state, low, scale, bins):
    """The number of the bin that a state f8 (D,) is in, row-major; beyond the bins, of the outermost one."""
    number = np.int64(0)
    for dimension in range(len(bins)):
        place = (state[dimension] - low[dimension]) * scale[dimension]
        place = place if place > 0.0 else 0.0  # NaN too: whatever a state becomes, it has a bin
        place = min(place, np.float64(bins[dimension] - 1))
        number = number * bins[dimension] + np.int64(place)
    return number


@starts(Binned, around=True)
def _start(world, task, lane, rng, anywhere):
    start_of(world.world, task, lane, rng, anywhere)
    return bin_of(world.world.observed[lane], world.low, world.scale, world.bins)


@steps(Binned, around=True)
def _step(world, task, lane, state, action, uniform, rng):
    code = step_of(world.world, task, lane, state, action, uniform, rng)
    return code if code < 0 else bin_of(world.world.observed[lane], world.low, world.scale, world.bins)
