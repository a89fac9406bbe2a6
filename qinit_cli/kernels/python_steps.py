# mypy: allow-untyped-defs, allow-untyped-calls, disable-error-code="untyped-decorator"
"""Worlds that are stepped through in Python: the compiled loop calls back, and all else of it stays as it is.

An episode's randomness is a seed, drawn by its start from the task's own stream, so that nothing depends on what else is learned,
nor on how many episodes came before. A step costs what its Python costs and a few microseconds; threads wait for each other.
"""

from __future__ import annotations

import ctypes
from collections.abc import Callable
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass, field
from typing import Any, ClassVar, NamedTuple, Protocol

import numpy as np
from llvmlite import ir
from numba import extending, types

from qinit_cli.arrays import Floats, Integers
from qinit_cli.kernels.loop import compiled_loop
from qinit_cli.kernels.parts import Function
from qinit_cli.kernels.random_streams import THIRTY_TWO, Words, draw
from qinit_cli.kernels.tiles import TiledWorld, TiledWorlds
from qinit_cli.kernels.worlds import LOST, starts, steps
from qinit_cli.learning import Learning

intrinsic: Any = extending.intrinsic

CALLBACK = ctypes.CFUNCTYPE(ctypes.c_int64, ctypes.c_int64, ctypes.c_int64)
_WORD = ir.IntType(64)


class Simulator(Protocol):
    """One task, simulated in Python."""

    def start(self, seed: int) -> int:
        """Begins an episode, all of whose randomness comes from the seed (below 2^32); the table's state."""
        ...

    def step(self, action: int) -> int:
        """The table's state that the action leads to, GOAL, LOST or CUT - state."""
        ...


class PythonWorld(NamedTuple):
    """Where the loop calls back."""

    start: int  # the address of a function of task and seed
    step: int  # the address of a function of task and action


class PaidSimulator(Simulator, Protocol):
    """One task, simulated in Python, that tells its rewards."""

    paid: float  # the last step's


class PaidPythonWorld(NamedTuple):
    """As PythonWorld, with rewards."""

    start: int
    step: int
    paid: Any  # f8 (L,) the last step's reward, which the step writes


class ContinuousPythonWorld(NamedTuple):
    """As PythonWorld, a world of kernels.continuous; at an end `observed` may stay what it was."""

    start: int
    step: int
    observed: Any  # f8 (L, D)


class PaidContinuousPythonWorld(NamedTuple):
    """As ContinuousPythonWorld, with rewards."""

    start: int
    step: int
    observed: Any
    paid: Any


WORLDS = PythonWorld, PaidPythonWorld, ContinuousPythonWorld, PaidContinuousPythonWorld


@dataclass
class PythonWorlds:
    """Tasks to learn, B of them, that are simulated in Python."""

    # of a task's place in the batch and the horizon; of a continuous world also of the state f8 (D,), which its starts and
    # steps write: the table's state is then 0
    simulators: Callable[..., Simulator]
    states: int
    actions: int
    rng: Words  # (B, 4)
    around: AbstractContextManager[Any] = field(
        default_factory=nullcontext
    )  # entered while tasks are learned
    pays: bool = False  # the simulators are PaidSimulators
    dimensions: int = 0  # of a continuous state; 0: there is none
    _failed: list[BaseException] = field(default_factory=list)
    _callbacks: list[Any] = field(default_factory=list)  # alive as long as the loop may call them

    lanes: ClassVar[int] = 1  # none of them could go on while another waits for Python
    alone: ClassVar[int] = 1

    def __len__(self) -> int:
        return len(self.rng)

    def __enter__(self) -> PythonWorlds:
        self.around.__enter__()
        return self

    def __exit__(self, *error: Any) -> None:
        self.around.__exit__(*error)

    def queue(self) -> Integers:
        """As they are: what takes long is not known."""
        return np.arange(len(self))

    def loop(self, learning: Learning, lanes: int) -> tuple[Function, PythonWorld | PaidPythonWorld]:
        """The loop, which raises what a simulator has raised, and the world that it takes."""
        paid = np.zeros(lanes)
        begin, move = self._addresses(learning.horizon, paid)
        world = PaidPythonWorld(begin, move, paid) if self.pays else PythonWorld(begin, move)
        return self.raising(compiled_loop(learning, type(world))), world

    def continuous(self, lanes: int, horizon: int) -> ContinuousPythonWorld | PaidContinuousPythonWorld:
        """The world of continuous states, with so many lanes."""
        paid, observed = np.zeros(lanes), np.zeros((lanes, self.dimensions))
        begin, move = self._addresses(horizon, paid, observed[0])
        if self.pays:
            return PaidContinuousPythonWorld(begin, move, observed, paid)
        return ContinuousPythonWorld(begin, move, observed)

    def raising(self, advance: Function) -> Function:
        """The loop, raising what a simulator has raised."""

        def raising(blocks: int, *arguments: Any) -> None:
            advance(min(blocks, 1), *arguments)  # a block at a time: whoever stops it should not wait
            if self._failed:
                raise self._failed[0]

        return raising

    def _addresses(self, horizon: int, paid: Floats, *state: Floats) -> tuple[int, int]:
        """Where compiled code starts an episode, and steps; `paid` and the state are written."""

        now = -1  # the task that is learned
        move: Callable[[int], int] = _none_begun
        simulator: Any = None

        def start(task: int, seed: int) -> int:
            nonlocal now, move, simulator
            if self._failed:
                return 0
            try:
                if task != now:
                    simulator, now = None, -1  # the task before it is done
                    simulator = self.simulators(task, horizon, *state)
                    now, move = task, simulator.step
                code: int = simulator.start(seed)
                return code
            except BaseException as error:  # nothing may pass through compiled code
                return failed(error, 0)

        # as few calls as can be: it is what a step of Python costs beside the environment's own
        def step(task: int, action: int) -> int:
            try:
                return move(action)
            except BaseException as error:
                return failed(error, LOST)

        def paid_step(task: int, action: int) -> int:
            try:
                code = move(action)
                paid[:] = simulator.paid  # read before any other step
                return code
            except BaseException as error:
                return failed(error, LOST)

        def failed(error: BaseException, instead: int) -> int:
            """Keeps the exception; the rest of the block is nobody's."""
            nonlocal move
            self._failed.append(error)
            move = _lost
            return instead

        callbacks = CALLBACK(start), CALLBACK(paid_step if self.pays else step)
        self._callbacks.extend(callbacks)
        begin, go = (ctypes.cast(callback, ctypes.c_void_p).value or 0 for callback in callbacks)
        return begin, go


def _lost(action: int) -> int:
    return LOST


def _none_begun(action: int) -> int:
    raise RuntimeError("a step before the start of an episode")


class TiledPythonWorlds(TiledWorlds):
    """TiledWorlds of PythonWorlds."""

    def __enter__(self) -> TiledPythonWorlds:
        self.inner.__enter__()
        return self

    def __exit__(self, *error: Any) -> None:
        self.inner.__exit__(*error)

    def loop(self, learning: Learning, lanes: int) -> tuple[Function, TiledWorld]:
        """The loop, which raises what a simulator has raised, and the world that it takes."""
        advance, world = super().loop(learning, lanes)
        return self.inner.raising(advance), world


@intrinsic
def _call(typing: Any, address: Any, task: Any, value: Any) -> Any:
    """Calls the function of two integers at that address."""

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        kind = ir.FunctionType(_WORD, [_WORD, _WORD]).as_pointer()
        return builder.call(builder.inttoptr(arguments[0], kind), arguments[1:])

    return types.int64(types.int64, types.int64, types.int64), generate


@starts(*WORLDS)
def _start(world, task, lane, rng, anywhere):
    return _call(world.start, np.int64(task), np.int64(draw(rng) >> THIRTY_TWO))


@steps(*WORLDS, cuts=True)
def _step(world, task, lane, state, action, uniform, rng):
    return _call(world.step, np.int64(task), np.int64(action))
