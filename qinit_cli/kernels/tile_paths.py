# mypy: allow-untyped-defs, allow-untyped-calls
"""Greedy paths of tile-coded values, compiled: each in the world itself, from a state of one's own or where targets start."""

from __future__ import annotations

from functools import cache
from typing import TYPE_CHECKING, Any

import numpy as np

from qinit_cli.kernels.compiled import kept_with, unkept
from qinit_cli.kernels.continuous import coordinate, end_at, put_state
from qinit_cli.kernels.parts import Function
from qinit_cli.kernels.random_streams import THIRTY_TWO, draw
from qinit_cli.kernels.tiles import note_tiles
from qinit_cli.kernels.worlds import GOAL, start_of, step_of

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from qinit_cli.arrays import Floats
    from qinit_cli.kernels.random_streams import Words
    from qinit_cli.kernels.tiles import TiledWorld, TiledWorlds

LANE = 0  # a path is followed alone
NEVER = -1  # a path that does not arrive


def path_lengths(
    worlds: TiledWorlds, rng: Words, weights: Floats, states: Floats, horizon: int
) -> NDArray[np.int32]:
    """Steps to the goal from each state (P, D) by each action first, (B, P, A); NEVER where the greedy path does not arrive.

    `weights` (B, T, A) are the tasks', `rng` (B, 4) what steps draw from. Paths are without noise; 0 in a state of the goal.
    """
    world = _alone(worlds, horizon, noisy=False)
    lengths = np.empty((len(weights), len(states), worlds.actions), np.int32)
    _compiled("lengths", type(world.inner).__module__)(world, rng.copy(), weights, states, horizon, lengths)
    return lengths


def greedy_paths(
    worlds: TiledWorlds, rng: Words, weights: Floats, horizon: int, *, anywhere: bool, noisy: bool = True
) -> tuple[Floats, NDArray[np.int64]]:
    """The states (B, H + 1, D) of a greedy path of each task from where targets start, or anywhere, and its steps, (B,).

    Steps are NEVER where the path does not arrive; its states from its end on are NaN.
    """
    world = _alone(worlds, horizon, noisy=noisy)
    states = np.full((len(weights), horizon + 1, len(world.low)), np.nan)
    steps = np.empty(len(weights), np.int64)
    _compiled("paths", type(world.inner).__module__)(
        world, rng.copy(), weights, horizon, anywhere, states, steps
    )
    return states, steps


def _alone(worlds: TiledWorlds, horizon: int, *, noisy: bool) -> TiledWorld:
    """The world in which paths are followed."""
    world = worlds.world(worlds.lanes, horizon)
    if noisy or "noise" not in world.inner._fields:
        return world
    return world._replace(inner=world.inner._replace(noise=0.0))


@cache
def _compiled(name: str, module: str) -> Function:
    functions: dict[str, Any] = {"lengths": _lengths, "paths": _paths}
    made: Function = kept_with((module,), functions[name])
    return made


def _lengths(world, rng, weights, states, horizon, lengths):
    for task in range(len(weights)):
        for state in range(len(states)):
            for first in range(lengths.shape[2]):
                start_of(world.inner, task, LANE, rng[task], False)
                put_state(world.inner, LANE, states[state])
                code = np.int64(end_at(world.inner, task, LANE))
                if code != 0:
                    lengths[task, state, first] = 0 if code == GOAL else NEVER
                    continue
                code, steps = _step(world, task, first, rng), 1
                while code >= 0 and steps < horizon:
                    code = _step(world, task, _greedy(world, weights[task]), rng)
                    steps += 1
                lengths[task, state, first] = steps if code == GOAL else NEVER


def _paths(world, rng, weights, horizon, anywhere, states, path_steps):
    for task in range(len(weights)):
        start_of(world.inner, task, LANE, rng[task], anywhere)
        _note(world, states[task, 0])
        steps, code = 0, 0
        while code >= 0 and steps < horizon:
            code = _step(world, task, _greedy(world, weights[task]), rng)
            steps += 1
            _note(world, states[task, steps])
        path_steps[task] = steps if code == GOAL else NEVER


@unkept
def _step(world, task, action, rng):
    uniform = np.float64(draw(rng[task]) >> THIRTY_TWO) * 2.0**-32
    return np.int64(step_of(world.inner, task, LANE, 0, np.int64(action), uniform, rng[task]))


@unkept
def _note(world, state):
    for dimension in range(len(state)):
        state[dimension] = coordinate(world.inner, LANE, dimension)


@unkept
def _greedy(world, weights):
    """The first of the actions whose weights, those of the active tiles, sum up to most."""
    note_tiles(world, LANE, 0)
    best, taken = -np.inf, 0
    for action in range(weights.shape[1]):
        summed = 0.0
        for entry in world.active[LANE, 0]:
            summed += weights[entry // world.width, action]
        if summed > best:
            best, taken = summed, action
    return taken
