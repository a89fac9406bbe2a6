# mypy: allow-untyped-defs, allow-untyped-calls
"""The cart with a pole, by the equations of Gymnasium's CartPole-v1 in their order, integrated by Euler's method.

The state is the cart's position (m) and velocity, and the pole's angle (radians, 0 upright, clockwise) and angular velocity. The
angle of a pole that is to be swung up is from 0 to 2 pi.
Actions: 0 pushes to the left, 1 to the right.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from qinit_cli.kernels.compiled import inlined
from qinit_cli.kernels.continuous import end_at, guide, put_anywhere
from qinit_cli.kernels.cosine import sine_and_cosine
from qinit_cli.kernels.parts import body
from qinit_cli.kernels.random_streams import unit
from qinit_cli.kernels.worlds import GOAL, LOST, starts, steps

SECONDS = 0.02  # of a step
TRACK = 2.4  # the cart is lost beyond it, on either side
UPRIGHT = 12 * 2 * math.pi / 360  # the largest angle of a pole that counts as upright
SLOW = 1.0  # the largest angular velocity of a pole that has been swung up
SPREAD = 0.05  # each number of the state starts within so much of rest, as Gymnasium has it
TURN = 2 * math.pi
FOUR_THIRDS = 4.0 / 3.0


class CartPoleWorld(NamedTuple):
    """The carts of a batch, and how those in the lanes stand."""

    length: Any  # f8 (B,) half the pole's length
    masspole: Any  # f8 (B,)
    masscart: Any  # f8 (B,)
    gravity: Any  # f8 (B,)
    force_mag: Any  # f8 (B,)
    up: bool  # the pole hangs and is to be swung up; else it stands and is to be kept so until the limit
    low: Any  # f8 (4,) where episodes start that start anywhere
    high: Any  # f8 (4,)
    limit: int
    time: Any  # i8 (L,)
    observed: Any  # f8 (L, 4)


@inlined
def pushed(state, force, length, masspole, masscart, gravity):
    """The state, four numbers, after a step with that force."""
    x, x_dot, theta, theta_dot = state
    total, moment = masspole + masscart, masspole * length
    sine, cosine = sine_and_cosine(theta)
    temp = (force + moment * (theta_dot * theta_dot) * sine) / total
    thetaacc = (gravity * sine - cosine * temp) / (
        length * (FOUR_THIRDS - masspole * (cosine * cosine) / total)
    )
    xacc = temp - moment * thetaacc * cosine / total
    return (
        x + SECONDS * x_dot,
        x_dot + SECONDS * xacc,
        theta + SECONDS * theta_dot,
        theta_dot + SECONDS * thetaacc,
    )


@starts(CartPoleWorld)
def start(world, task, lane, rng, anywhere):
    """At rest but for SPREAD, the pole upright or hanging; or anywhere in the box where no episode ends."""
    observed = world.observed[lane]
    world.time[lane] = 0
    if anywhere:
        put_anywhere(world, task, lane, rng)
        return 0
    for dimension in range(4):
        observed[dimension] = SPREAD * (2 * unit(rng) - 1)
    if world.up:
        observed[2] += math.pi
    return 0


@steps(CartPoleWorld)
def step(world, task, lane, state, action, uniform, rng):
    """A push to either side; the goal is a pole that is up, or at the limit one that has stood so long."""
    observed = world.observed[lane]
    force = world.force_mag[task] if action == 1 else -world.force_mag[task]
    x, x_dot, theta, theta_dot = pushed(
        (observed[0], observed[1], observed[2], observed[3]),
        force,
        world.length[task],
        world.masspole[task],
        world.masscart[task],
        world.gravity[task],
    )
    observed[0], observed[1], observed[2], observed[3] = x, x_dot, theta, theta_dot
    if world.up:
        observed[2] = _wrapped(theta)
    world.time[lane] += 1
    code = end_at(world, task, lane)
    return GOAL if code == 0 and not world.up and world.time[lane] >= world.limit else code


@body(end_at, CartPoleWorld)
def _end_at(world, task, lane):
    x, theta, theta_dot = world.observed[lane, 0], world.observed[lane, 2], world.observed[lane, 3]
    upright = abs(theta) <= UPRIGHT or (world.up and theta >= TURN - UPRIGHT)
    if abs(x) > TRACK or not (world.up or upright):
        return LOST
    return GOAL if world.up and upright and abs(theta_dot) < SLOW else 0


@body(guide, CartPoleWorld)
def _guide(world, task, lane):
    """Leans against the fall, and back to the middle; a hanging pole is pushed the way that adds to its energy."""
    x, x_dot, theta, theta_dot = world.observed[lane]
    if not world.up:
        return 1 if theta + 0.3 * theta_dot + 0.05 * x + 0.1 * x_dot > 0 else 0
    if abs(x + 0.5 * x_dot) > 0.8 * TRACK:
        return 0 if x > 0 else 1
    return 0 if theta_dot * math.cos(theta) > 0 else 1


@inlined
def _wrapped(angle):
    """The angle from 0 to 2 pi."""
    return angle - TURN * np.floor(angle / TURN)
