# mypy: allow-untyped-defs, allow-untyped-calls
"""Tasks given as tables of transitions, and the compiled step through them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from qinit_cli.arrays import Flags, Floats
from qinit_cli.kernels.dice import Words, below, unit
from qinit_cli.kernels.stepping import SteppedWorlds, starts, steps


@dataclass(frozen=True)
class Tables:
    """Where the steps of B tasks lead: up to O outcomes of each action in each state, those that are not there of chance 0."""

    after: NDArray[np.int32]  # (B, S, A, O) the next state, stepping.GOAL or stepping.LOST
    chance: Floats  # (B, S, A, O), 1 in sum
    start: Floats  # (B, S) chance that a target's episode starts there
    open: Flags  # (B, S) episodes go on there: where "anywhere" may start

    def __len__(self) -> int:
        return len(self.after)

    def worlds(self, dice: Words) -> SteppedWorlds:
        """The tasks as the compiled loop takes them; `dice` u8 (B, 4) is not used, as a step's own chance is enough."""
        _, states, actions, _ = self.after.shape
        places = np.argsort(~self.open, axis=1, kind="stable").astype(np.int32)
        world = World(
            after=np.ascontiguousarray(self.after, np.int32),
            limits=_cumulative(self.chance),
            start=_cumulative(self.start),
            places=places,
            count=self.open.sum(axis=1).astype(np.int64),
        )
        return SteppedWorlds(world, states, actions, dice)


class World(NamedTuple):
    """The tables of a batch as the loop reads them."""

    after: Any  # i4 (B, S, A, O)
    limits: Any  # f8 (B, S, A, O) running sums of the chances
    start: Any  # f8 (B, S) running sums
    places: Any  # i4 (B, S) the open states first
    count: Any  # i8 (B,) of them


@starts(World)
def start(world, task, lane, dice, anywhere):
    """A state drawn from the target's starts, or any open one."""
    if anywhere:
        return np.int64(world.places[task, below(dice, world.count[task])])
    return np.searchsorted(world.start[task], unit(dice), side="right")


@steps(World)
def step(world, task, lane, state, action, chance, dice):
    """The outcome whose share of [0, 1) the chance falls into."""
    outcome = 0
    while chance >= world.limits[task, state, action, outcome]:
        outcome += 1
    return np.int64(world.after[task, state, action, outcome])


def _cumulative(chances: Floats) -> Floats:
    """Running sums over the last axis; from the last chance that is not 0 on they are 2, whatever rounding did."""
    sums: Floats = np.cumsum(chances, axis=-1)
    rest = np.cumsum(chances[..., ::-1], axis=-1)[..., ::-1]  # of the chances from here on
    following = np.concatenate([rest[..., 1:], np.zeros_like(rest[..., :1])], axis=-1)
    sums[following == 0] = 2.0
    return sums
