# mypy: allow-untyped-defs, allow-untyped-calls
"""Tile coding, compiled: the values of a continuous state are sums of the weights of its active tiles.

The loop stays what it is. A lane has two rows, its slots, which a step's state and the state after it take in turn: the world
writes the active tiles of a slot, and the memory sums their weights into its row before that is read. An update adds to all
active weights: its share of the step size is one by the number of tilings.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from qinit_cli.arrays import Integers
from qinit_cli.kernels.blend import blended, learn_blended, learned_value
from qinit_cli.kernels.compiled import inlined, unkept_inlined
from qinit_cli.kernels.continuous import coordinate
from qinit_cli.kernels.exploration import choose, choose_wide
from qinit_cli.kernels.lane import (
    BLOCK,
    FEW,
    POTENTIAL,
    WORTH,
    WORTH_OF_POTENTIAL,
    aligned,
    change,
    empty,
    fill,
    greedy_action,
    note_best,
    own,
    picked,
    read,
    width_of,
)
from qinit_cli.kernels.loop import compiled_loop
from qinit_cli.kernels.parts import Function, body
from qinit_cli.kernels.policies import policy_action
from qinit_cli.kernels.random_streams import Words
from qinit_cli.kernels.traces import meet, meet_step, traced
from qinit_cli.kernels.vectors import WIDTH
from qinit_cli.kernels.worlds import (
    CUT,
    LOST,
    beside,
    move,
    moves_at_once,
    place_of,
    prepare,
    start_of,
    starts,
    step_of,
    steps,
)
from qinit_cli.learning import Learning
from qinit_cli.tile_coding import TileCoding

MANY = 1 << 30  # states of an inner world: its places from here on are ends
SLOTS = 2  # rows of a lane that are states; a world's state is the slot that it is in


class TiledWorld(NamedTuple):
    """A continuous world whose states are told by their active tiles."""

    inner: Any  # a continuous world
    low: Any  # f8 (D,)
    scale: Any  # f8 (D,) tiles for a unit
    top: float  # the largest number below the tiles along a dimension
    offsets: Any  # f8 (D, n)
    strides: Any  # i4 (D,) entries of `weights`
    first: Any  # i4 (n,) entries of `weights`
    active: Any  # i4 (L, 2, n) for each slot: the entry of `weights` where each active tile's begin
    slot: Any  # i8 (L,) of each lane's state
    width: int  # entries of `weights` of a tile

    @property
    def paid(self) -> Any:
        """f8 (L,) each lane's last reward; AttributeError where the continuous world notes none."""
        return self.inner.paid


class TileMemory(NamedTuple):
    """As lane.Memory, for sums of weights of up to four actions; `visits` and `td_var` are not kept."""

    rows: Any  # f8 (L, (2 + 2) * 8)
    ties: Any  # u1 (L, 2 + 2)
    visits: Any  # i8 (L, 0)
    td_var: Any  # f8 (L, 0)
    draws: Any  # u8 (L, BLOCK)
    choices: Any  # u2 (L, BLOCK)
    actions: int
    weights: Any  # f8 (L, T * 4) of each tile those of the actions
    active: Any  # i4 (L, 2, n) the world's own array
    potential: Any  # f8 (L, T * 4) the first of four, or None
    share: float  # of an update, for each weight


class WideTileMemory(NamedTuple):
    """As TileMemory, for more than four actions: W places each."""

    rows: Any
    ties: Any
    visits: Any
    td_var: Any
    draws: Any
    choices: Any
    actions: int
    weights: Any  # f8 (L, T * W)
    active: Any
    potential: Any  # f8 (L, T * W), or None
    share: float
    width: int  # W, a multiple of four


@dataclass(frozen=True)
class TiledWorlds:
    """Tasks of a continuous world to learn by tiles, B of them."""

    inner: Any  # Worlds whose world is continuous
    coding: TileCoding

    @property
    def states(self) -> int:
        """Weights of an action."""
        return self.coding.weights

    @property
    def actions(self) -> int:
        """Those of the worlds."""
        actions: int = self.inner.actions
        return actions

    @property
    def lanes(self) -> int:
        """As many as without tiles."""
        lanes: int = self.inner.lanes
        return lanes

    @property
    def alone(self) -> int:
        """As many as without tiles."""
        alone: int = self.inner.alone
        return alone

    @property
    def rng(self) -> Words | None:
        """That of the worlds."""
        rng: Words | None = self.inner.rng
        return rng

    def __len__(self) -> int:
        return len(self.inner)

    def queue(self) -> Integers:
        """As without tiles."""
        queue: Integers = self.inner.queue()
        return queue

    def loop(self, learning: Learning, lanes: int) -> tuple[Function, TiledWorld]:
        """The compiled loop and the world it takes."""
        world = self.world(lanes, learning.horizon)
        return compiled_loop(learning, TiledWorld, type(world.inner)), world

    def world(self, lanes: int, horizon: int) -> TiledWorld:
        """The world in that many lanes, whose episodes are cut off at the horizon."""
        coding, width = self.coding, -(-self.actions // WIDTH) * WIDTH
        return TiledWorld(
            inner=self.inner.continuous(lanes, horizon),
            low=np.array(coding.low),
            scale=coding.scales(),
            top=float(np.nextafter(coding.tiles, 0.0)),
            offsets=coding.offsets(),
            strides=(coding.strides() * width).astype(np.int32),
            first=(coding.first() * width).astype(np.int32),
            active=np.zeros((lanes, SLOTS, coding.tilings), np.int32),
            slot=np.zeros(lanes, np.int64),
            width=width,
        )


def tile_memory(world: TiledWorld, tiles: int, actions: int, shaped: bool) -> TileMemory | WideTileMemory:
    """The memory of lanes that hold that many weights of each action, with room for a potential's if `shaped`."""
    lanes, _, tilings = world.active.shape
    width = -(-actions // WIDTH) * WIDTH
    arrays = (
        aligned(lanes, (SLOTS + 2) * (width + WIDTH)),
        np.zeros((lanes, SLOTS + 2), np.uint8),
        np.zeros((lanes, 0), np.int64),
        np.zeros((lanes, 0)),
        np.zeros((lanes, BLOCK), np.uint64),
        np.zeros((lanes, BLOCK if actions <= FEW else 0), np.uint16),
        actions,
        aligned(lanes, tiles * width),
        world.active,
        np.zeros((lanes, tiles * width)) if shaped else None,
        1.0 / tilings,
    )
    return TileMemory(*arrays) if actions <= FEW else WideTileMemory(*arrays, width)


@starts(TiledWorld, around=True)
def _start(world, task, lane, rng, anywhere):
    start_of(world.inner, task, lane, rng, anywhere)
    note_tiles(world, lane, 0)
    return 0


@steps(TiledWorld, cuts=True, around=True)
def _step(world, task, lane, state, action, uniform, rng):
    code = step_of(world.inner, task, lane, 0, action, uniform, rng)
    slot = 1 - state
    note_tiles(world, lane, slot)
    if code >= 0:
        return slot
    return CUT - slot if code < LOST else code


@unkept_inlined
def note_tiles(world, lane, slot):
    """Writes the active tiles of the lane's state into the slot."""
    active = world.active[lane, slot]
    world.slot[lane] = slot
    for tiling in range(len(active)):
        active[tiling] = world.first[tiling]
    for dimension in range(len(world.low)):
        inside = (coordinate(world.inner, lane, dimension) - world.low[dimension]) * world.scale[dimension]
        # NaN counts as low: compiled code has no bounds that would stop an index that is none
        inside = min(inside, world.top) if inside > 0.0 else 0.0
        offsets, stride = world.offsets[dimension], world.strides[dimension]
        for tiling in range(len(active)):
            active[tiling] += np.int32(inside + offsets[tiling]) * stride


@body(beside, TiledWorld)
def _beside(world):
    return beside(world.inner)


@body(prepare, TiledWorld)
def _prepare(world, lane, task, rng, exploration, all_actions, draws, choices):
    prepare(world.inner, lane, task, rng, exploration, all_actions, draws, choices)


@body(moves_at_once, TiledWorld)
def _moves_at_once(world):
    return moves_at_once(world.inner)


@body(move, TiledWorld)
def _move(world, first, step, action, states, after):
    ended = move(world.inner, first, step, action, MANY, after)
    for place in range(len(after)):
        after[place] = _tiled_place(world, first + place, np.int64(after[place]), states)
    return ended


# the inner world's own: a world that draws for a block beforehand steps by that whether lanes move at once or alone
@body(place_of, TiledWorld)
def _place_of(world, task, lane, step, state, choice, action, drawn, rng, states):
    there = place_of(world.inner, task, lane, step, np.uint32(0), choice, action, drawn, rng, MANY)
    return np.uint32(_tiled_place(world, lane, np.int64(there), states))


@unkept_inlined
def _tiled_place(world, lane, there, states):
    """The place of the tiled world, its tiles noted in the lane's other slot, given that of the inner one."""
    slot = 1 - world.slot[lane]
    note_tiles(world, lane, slot)
    if there < MANY:
        return slot
    end = there - MANY
    return states + end if end < 2 else states + 2 + slot  # 2 and more: cut off


@body(own, TileMemory)
def _own(memory, lane):
    return TileMemory(
        memory.rows[lane],
        memory.ties[lane],
        memory.visits[lane],
        memory.td_var[lane],
        memory.draws[lane],
        memory.choices[lane],
        memory.actions,
        memory.weights[lane],
        memory.active[lane],
        _own_potential(memory.potential, lane),
        memory.share,
    )


@body(own, WideTileMemory)
def _own_wide(memory, lane):
    return WideTileMemory(
        memory.rows[lane],
        memory.ties[lane],
        memory.visits[lane],
        memory.td_var[lane],
        memory.draws[lane],
        memory.choices[lane],
        memory.actions,
        memory.weights[lane],
        memory.active[lane],
        _own_potential(memory.potential, lane),
        memory.share,
        memory.width,
    )


@inlined
def _own_potential(potential, lane):
    return None if potential is None else potential[lane]


@body(width_of, WideTileMemory)
def _width_of_wide(memory):
    return memory.width


body(choose, WideTileMemory)(choose_wide)


@body(greedy_action, WideTileMemory)
def _greedy_action_wide(memory, state, drawn):
    return picked(memory, state, drawn, False)


@body(fill, TileMemory, WideTileMemory)
def _fill(memory, tasks, task, gamma, potential, visits, td_var):
    width, actions = width_of(memory), tasks.q.shape[2]
    memory.rows[:] = -np.inf
    memory.weights[:] = -np.inf
    for tile in range(tasks.q.shape[1]):
        for action in range(actions):
            memory.weights[width * tile + action] = tasks.q[task, tile, action]
    _fill_potential(memory.potential, potential, width, task)


@inlined
def _fill_potential(own_potential, potential, width, task):
    if own_potential is not None and potential is not None:
        for tile in range(potential.shape[1]):
            own_potential[width * tile] = potential[task % len(potential), tile]


@body(empty, TileMemory, WideTileMemory)
def _empty(memory, tasks, task, visits, td_var):
    width = width_of(memory)
    for tile in range(tasks.q.shape[1]):
        for action in range(tasks.q.shape[2]):
            tasks.q[task, tile, action] = memory.weights[width * tile + action]


@body(read, TileMemory)
def _read(memory, state, gamma):
    slot = np.int64(state)
    row, active, weights = 2 * WIDTH * slot, memory.active[slot], memory.weights
    a = b = c = d = 0.0
    for tiling in range(len(active)):
        entry = active[tiling]
        a += weights[entry]
        b += weights[entry + 1]
        c += weights[entry + 2]
        d += weights[entry + 3]
    best = max(max(a, b), max(c, d))
    memory.rows[row], memory.rows[row + 1], memory.rows[row + 2], memory.rows[row + 3] = a, b, c, d
    memory.rows[row + WIDTH + WORTH] = gamma * best
    memory.ties[slot] = (a == best) | (b == best) << 1 | (c == best) << 2 | (d == best) << 3
    _read_potential(memory.potential, memory, slot, gamma)


@body(read, WideTileMemory)
def _read_wide(memory, state, gamma):
    slot, width = np.int64(state), memory.width
    row, active, best = (width + WIDTH) * slot, memory.active[slot], -np.inf
    for action in range(memory.actions):
        summed = 0.0
        for tiling in range(len(active)):
            summed += memory.weights[active[tiling] + action]
        memory.rows[row + action] = summed
        best = max(best, summed)
    memory.rows[row + width + WORTH] = gamma * best
    _read_potential(memory.potential, memory, slot, gamma)


@inlined
def _read_potential(potential, memory, slot, gamma):
    if potential is not None:
        place, phi = (width_of(memory) + WIDTH) * slot + width_of(memory), 0.0
        for entry in memory.active[slot]:
            phi += potential[entry]
        memory.rows[place + WORTH_OF_POTENTIAL], memory.rows[place + POTENTIAL] = gamma * phi, phi


@body(change, TileMemory, WideTileMemory)
def _change(memory, row, action, amount):
    part_of_it = amount * memory.share
    for entry in memory.active[row // (width_of(memory) + WIDTH)]:
        memory.weights[entry + action] += part_of_it
    return 0.0, 0


@body(note_best, TileMemory, WideTileMemory)
def _note_best(memory, state, best, tied, gamma):
    pass  # the row is read again before it counts


@body(traced, TileMemory, WideTileMemory)
def _traced(memory):
    return memory.weights, memory.share


@body(meet_step, TileMemory, WideTileMemory)
def _meet_step(memory, learner, step):
    for entry in memory.active[step.state]:
        meet(learner, step.lane, entry + step.action)


@body(learned_value, TileMemory, WideTileMemory)
def _learned_value(memory, learner, step):
    summed = 0.0
    for entry in memory.active[step.state]:
        summed += learner.learned[step.lane, entry + step.action]
    return summed


@body(learn_blended, TileMemory, WideTileMemory)
def _learn_blended(memory, learner, step, amount, gamma):
    part_of_it = amount * memory.share
    for tile in memory.active[step.state]:
        entry = tile + step.action
        memory.weights[entry] = blended(learner, step.lane, entry, part_of_it)


@body(policy_action, TileMemory, WideTileMemory)
def _policy_action(memory, choosing, lane, state):
    weights, active = choosing.policies[choosing.chosen[lane]], memory.active[np.int64(state)]
    best, taken = -np.inf, 0
    for action in range(memory.actions):
        summed = 0.0
        for tiling in range(len(active)):
            summed += weights[active[tiling] + action]
        best, taken = (summed, action) if summed > best else (best, taken)
    return np.int64(taken)
