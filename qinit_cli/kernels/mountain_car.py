# mypy: allow-untyped-defs, allow-untyped-calls
"""Mountain Car as the compiled loop steps through it: eight cars move as one vector.

The dynamics are those of Gymnasium's MountainCar-v0, with a push eta on the right hill. The car's state is
continuous; the table sees its bin, row position and column velocity. Actions: 0 left, 1 none, 2 right.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from qinit_cli.arrays import Integers
from qinit_cli.kernels.choices import NO_SLIP, decide
from qinit_cli.kernels.compiled import inlined, inner
from qinit_cli.kernels.continuous import coordinate, end_at, put_state
from qinit_cli.kernels.cosine import cosine
from qinit_cli.kernels.lane import BLOCK
from qinit_cli.kernels.loop import compiled_loop
from qinit_cli.kernels.parts import Function, body
from qinit_cli.kernels.random_streams import Words, two_normals, unit
from qinit_cli.kernels.reals import EIGHT, bits, chosen, load_reals, reals, store_reals, store_whole, whole
from qinit_cli.kernels.worlds import GOAL as REACHED
from qinit_cli.kernels.worlds import beside, move, moves_at_once, place_of, prepare, starts, steps
from qinit_cli.learning import Learning

LEFT, RIGHT, GOAL, FASTEST = -1.2, 0.6, 0.5, 0.07
FORCE, GRAVITY = 0.001, 0.0025
PUSHES = np.array([-FORCE, 0.0, FORCE])  # by action

Place = Literal["point", "valley"]


class CarWorld(NamedTuple):
    """The mountain cars of a batch as the loop reads them, and where those in the lanes are."""

    eta: Any  # f8 (B,) push of a task
    hill: float
    bins: float
    valley: bool  # where episodes start but anywhere: x ~ U(-0.6, -0.4), else x = -0.5
    noise: float  # standard deviation of a push that is drawn anew every step
    position: Any  # f8 (L,)
    velocity: Any  # f8 (L,)
    gravity: Any  # f8 (L,) what it adds to the velocity in the coming step
    lane_eta: Any  # f8 (L,)
    gusts: Any  # f8 (L * BLOCK,), eta of every step, eight lanes side by side; None if pushes belong to tasks


@dataclass(frozen=True)
class MountainCars:
    """Mountain Car tasks to learn, B of them."""

    eta: NDArray[np.float64]  # (B,) added to the position where the position before the step is >= hill
    hill: float = 0.0
    bins: int = 30  # along position and velocity
    start: Place = (
        "point"  # if learning.start is "fixed": x = -0.5, v = 0, or Gymnasium's x ~ U(-0.6, -0.4), v = 0
    )
    noise: float = 0.0  # standard deviation of a further push, drawn every step
    rng: Words | None = None  # (B, 4) its streams

    actions: ClassVar[int] = 3
    lanes: ClassVar[int] = EIGHT
    alone: ClassVar[int] = 2  # 35 M steps/s one after the other, against 14 for each of eight

    def __post_init__(self) -> None:
        if self.bins < 1:
            raise ValueError(f"{self.bins} bins; there must be at least 1")
        if self.noise > 0 and self.rng is None:
            raise ValueError("a push drawn every step needs streams of its own: rng")

    @property
    def states(self) -> int:
        """Number of bins."""
        return self.bins**2

    def __len__(self) -> int:
        return len(self.eta)

    def queue(self) -> Integers:
        """Those first that are pushed back most: they take up to twelve times the steps of the others."""
        return np.argsort(self.eta, kind="stable")

    def loop(self, learning: Learning, lanes: int) -> tuple[Function, CarWorld]:
        """The compiled loop and the world it takes."""
        return compiled_loop(learning, CarWorld), self.continuous(lanes, learning.horizon)

    def continuous(self, lanes: int, horizon: int) -> CarWorld:
        """The cars as a world in that many lanes."""
        if lanes % EIGHT:
            raise ValueError(f"{lanes} lanes; Mountain Car is learned in multiples of {EIGHT}")
        return CarWorld(
            eta=np.ascontiguousarray(self.eta, np.float64),
            hill=float(self.hill),
            bins=float(self.bins),
            valley=self.start == "valley",
            noise=float(self.noise),
            position=np.full(lanes, -0.5),
            velocity=np.zeros(lanes),
            gravity=np.zeros(lanes),
            lane_eta=np.zeros(lanes),
            gusts=np.zeros(lanes * BLOCK) if self.noise > 0 else None,
        )


@inlined
def pull(position):
    """What gravity adds to the velocity in a step; one car, or eight side by side."""
    return cosine(3.0 * position) * -GRAVITY


@inlined
def moved(position, velocity, push, eta, hill):
    """The car's position and velocity after a step; one car, or eight side by side.

    push: PUSHES of the action. eta is added to the position where that is >= hill before the step.
    """
    return roll(position, velocity, push + pull(position), eta, hill)


@inlined
def roll(position, velocity, change, eta, hill):
    """`moved`, given what push and gravity together add to the velocity."""
    gust = chosen(position >= hill, eta, 0.0)
    velocity = _between(velocity + change, -FASTEST, FASTEST)
    position = _between(position + (velocity + gust), LEFT, RIGHT)
    velocity = chosen((position == LEFT) & (velocity < 0.0), 0.0, velocity)
    return position, velocity


@inlined
def is_done(position, velocity):
    """True once the car is at the flag and does not roll back."""
    return (position >= GOAL) & (velocity >= 0.0)


@inlined
def bin_of(position, velocity, bins):
    """The table's state, a whole number but float64: bin of the position * bins + bin of the velocity."""
    last = bins - 1.0
    row = whole((position - LEFT) * (bins / (RIGHT - LEFT)))
    column = whole((velocity + FASTEST) * (bins / (2 * FASTEST)))
    return chosen(row > last, last, row) * bins + chosen(column > last, last, column)


@inlined
def _between(number, low, high):
    number = chosen(number > high, high, number)
    return chosen(number < low, low, number)


@starts(CarWorld)
def start(world, task, lane, rng, anywhere):
    """Puts the lane's car at the target start, or anywhere left of the flag."""
    position, velocity = -0.5, 0.0
    if anywhere:
        position = LEFT + (GOAL - LEFT) * unit(rng)
        velocity = -FASTEST + 2 * FASTEST * unit(rng)
    elif world.valley:
        position = -0.6 + 0.2 * unit(rng)
    world.lane_eta[lane] = world.eta[task]
    _put(world, lane, position, velocity)
    return np.int64(bin_of(position, velocity, world.bins))


@steps(CarWorld)
def step(world, task, lane, state, action, uniform, rng):
    """The bin that the lane's car comes to; a push that is drawn every step is drawn here."""
    eta = _drawn(world.gusts, world, task, rng)
    position, velocity = moved(world.position[lane], world.velocity[lane], PUSHES[action], eta, world.hill)
    _put(world, lane, position, velocity)
    return REACHED if is_done(position, velocity) else np.int64(bin_of(position, velocity, world.bins))


@inlined
def _put(world, lane, position, velocity):
    world.position[lane], world.velocity[lane], world.gravity[lane] = position, velocity, pull(position)


@body(beside, CarWorld)
def _beside(world):
    return EIGHT


@body(prepare, CarWorld)
def _prepare(world, lane, task, rng, exploration, all_actions, draws, choices):
    decide(draws, exploration, all_actions, NO_SLIP, choices)
    _draw_gusts(world.gusts, world, lane, task, rng)


@body(moves_at_once, CarWorld)
def _moves_at_once(world):
    return True


@body(move, CarWorld)
def _move(world, first, step, action, states, after):
    position, velocity = load_reals(world.position, first), load_reals(world.velocity, first)
    change = _pushes(action) + load_reals(world.gravity, first)
    eta = _eight_etas(world.gusts, world, first, step)
    position, velocity = roll(position, velocity, change, eta, world.hill)
    done = is_done(position, velocity)
    store_whole(after, 0, chosen(done, np.float64(states), bin_of(position, velocity, world.bins)))
    store_reals(world.position, first, position)
    store_reals(world.velocity, first, velocity)
    # of the next step: as long as the updates, which need not wait for it
    store_reals(world.gravity, first, pull(position))
    return bits(done) != 0


@body(place_of, CarWorld)
def _place_of(world, task, lane, step, state, choice, action, drawn, rng, states):
    change = PUSHES[action] + world.gravity[lane]
    eta = _one_eta(world.gusts, world, lane, step)
    position, velocity = roll(world.position[lane], world.velocity[lane], change, eta, world.hill)
    _put(world, lane, position, velocity)
    return np.uint32(
        chosen(is_done(position, velocity), np.float64(states), bin_of(position, velocity, world.bins))
    )


@body(coordinate, CarWorld)
def _coordinate(world, lane, dimension):
    return world.position[lane] if dimension == 0 else world.velocity[lane]


@body(put_state, CarWorld)
def _put_state(world, lane, state):
    _put(world, lane, state[0], state[1])


@body(end_at, CarWorld)
def _end_at(world, task, lane):
    return REACHED if is_done(world.position[lane], world.velocity[lane]) else 0


@inlined
def _eight_etas(gusts, world, first, step):
    return load_reals(world.lane_eta, first) if gusts is None else load_reals(gusts, _gust_place(first, step))


@inlined
def _one_eta(gusts, world, lane, step):
    return world.lane_eta[lane] if gusts is None else gusts[_gust_place(lane, step)]


@inlined
def _drawn(gusts, world, task, rng):
    return world.eta[task] if gusts is None else _gusts(world.eta[task], world.noise, rng)[0]


@inlined
def _gust_place(lane, step):
    """Where the push of a step in a lane stands."""
    return lane // EIGHT * EIGHT * BLOCK + step * EIGHT + lane % EIGHT


@inlined
def _pushes(actions):
    """PUSHES of eight actions, read one by one: a vector cannot be read at once where its parts were just written."""
    return reals(
        PUSHES[actions[0]],
        PUSHES[actions[1]],
        PUSHES[actions[2]],
        PUSHES[actions[3]],
        PUSHES[actions[4]],
        PUSHES[actions[5]],
        PUSHES[actions[6]],
        PUSHES[actions[7]],
    )


@inner
def _draw_gusts(gusts, world, lane, task, rng):
    """Pushes for every step of a block, in place of the task's."""
    if gusts is not None:
        for step in range(0, BLOCK, 2):
            one, other = _gusts(world.eta[task], world.noise, rng)
            gusts[_gust_place(lane, step)], gusts[_gust_place(lane, step + 1)] = one, other


@inlined
def _gusts(eta, noise, rng):
    """Two normal pushes around eta."""
    one, other = two_normals(noise, rng)
    return eta + one, eta + other
