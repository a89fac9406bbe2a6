# mypy: allow-untyped-defs, allow-untyped-calls, disable-error-code="untyped-decorator, arg-type"
"""Worlds: where the compiled loop's episodes start, and what a step does there.

A world is a NamedTuple of arrays and scalars whose class has registered two compiled functions by `starts` and `steps`. Our own
may have faster bodies for the parts below as well, which know what they step through.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numba.extending import overload

from qinit_cli.kernels.choices import NO_SLIP, decide
from qinit_cli.kernels.compiled import INLINED, inlined, unkept_inlined
from qinit_cli.kernels.parts import Function, part
from qinit_cli.kernels.random_streams import THIRTY_TWO

GOAL = -1  # a step led to the goal: the episode ends, with reward 1
LOST = -2  # a step ended the episode elsewhere, with reward 0
CUT = -3  # CUT - state: a step led to that state, and the world itself cut the episode off there

_STARTS: dict[type, Any] = {}
_STEPS: dict[type, Any] = {}
_CUTTING: set[type] = set()  # the worlds that may cut an episode off


def starts(*worlds: type, around: bool = False) -> Callable[[Function], Any]:
    """Registers where episodes start in worlds of these classes, and compiles it.

    The function takes (world, task, lane, rng, anywhere) and returns the table's state, from 0 to S - 1. `around` says that it
    calls `start_of` of a world within: its machine code is then kept with its callers', which know the class within.
    """

    def register(function: Function) -> Any:
        made = unkept_inlined(function) if around else inlined(function)
        _STARTS.update(dict.fromkeys(worlds, made))
        return made

    return register


def steps(*worlds: type, cuts: bool = False, around: bool = False) -> Callable[[Function], Any]:
    """Registers what a step does in worlds of these classes, and compiles it.

    The function takes (world, task, lane, state, action, uniform, rng) and returns the table's state that the step leads to,
    GOAL or LOST. `uniform` is uniform in [0, 1); what needs more draws from `rng`. What the table does not see is kept in
    arrays of the world, at `lane`; native rewards go to its field `paid` f8 (L,). With `cuts` it may also return CUT - state:
    the episode ends in that state as it does at the horizon, without the goal, and the state's value still counts. `around` is
    as in `starts`.
    """
    if cuts:
        _CUTTING.update(worlds)

    def register(function: Function) -> Any:
        made = unkept_inlined(function) if around else inlined(function)
        _STEPS.update(dict.fromkeys(worlds, made))
        return made

    return register


def start_of(world, task, lane, rng, anywhere):
    """The state where an episode starts; compiled code calls what the world's class has registered."""
    return _STARTS[type(world)].py_func(world, task, lane, rng, anywhere)


def step_of(world, task, lane, state, action, uniform, rng):
    """Where a step leads to: a state, GOAL, LOST or CUT - state; compiled code calls what the world's class has registered."""
    return _STEPS[type(world)].py_func(world, task, lane, state, action, uniform, rng)


def entered(world, place, states):
    """The row that a step leads the learner to, given its place: a state, S for the goal, S + 1 for being lost."""
    return place - states - 2 if type(world) in _CUTTING and place >= states + 2 else place


@overload(start_of, jit_options=INLINED)
def _start_of(world, task, lane, rng, anywhere):
    registered = _STARTS[world.instance_class]
    return lambda world, task, lane, rng, anywhere: registered(world, task, lane, rng, anywhere)


@overload(step_of, jit_options=INLINED)
def _step_of(world, task, lane, state, action, uniform, rng):
    registered = _STEPS[world.instance_class]
    return lambda world, task, lane, state, action, uniform, rng: registered(
        world, task, lane, state, action, uniform, rng
    )


@overload(entered, jit_options=INLINED)
def _entered(world, place, states):
    if world.instance_class not in _CUTTING:  # nothing is compiled in
        return lambda world, place, states: place
    return lambda world, place, states: place - states - 2 if place >= states + 2 else place


@part
def beside(world):
    """How many lanes are learned side by side in straight-line code."""
    return 4


@part
def prepare(world, lane, task, rng, exploration, all_actions, draws, choices):
    """Works out what the draws u8 (BLOCK,) of a lane's next steps decide: choices u2 (BLOCK,), see choices.decide."""
    decide(draws, exploration, all_actions, NO_SLIP, choices)


@part
def place_of(world, task, lane, step, state, choice, action, drawn, rng, states):
    """The place that a lane's step leads to: a state, S for the goal, S + 1 for being lost, S + 2 + state if cut off there."""
    uniform = np.float64(drawn >> THIRTY_TWO) * 2.0**-32
    code = step_of(world, task, lane, np.int64(state), np.int64(action), uniform, rng[task])
    return np.uint32(code if code >= 0 else states - 1 - code)


@part
def moves_at_once(world):
    """Whether the lanes that are learned side by side move at once, by `move`."""
    return False


@part
def move(world, first, step, action, states, after):
    """Writes into `after` the places that the steps of the lanes from `first` on lead to; True if any of them is no state."""
    return False
