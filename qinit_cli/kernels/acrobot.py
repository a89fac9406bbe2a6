# mypy: allow-untyped-defs, allow-untyped-calls
"""Two links that hang from a joint, the second of which is driven, by the equations of Gymnasium's Acrobot-v1 in their order:
those of Sutton and Barto's book, integrated by a Runge-Kutta step of the fourth order.

The state is both angles (radians; of the first link from hanging down, of the second from the first) and both angular velocities.
Actions: torque of -1, 0 and 1 on the joint between the links.
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
from qinit_cli.kernels.worlds import GOAL, starts, steps

SECONDS = 0.2  # of a step
FASTEST_1, FASTEST_2 = 4 * math.pi, 9 * math.pi
SPREAD = 0.1  # each number of the state starts within so much of 0, as Gymnasium has it
INERTIA = 1.0  # of either link
HEIGHT = 1.0  # the goal: the tip is so far above the joint, in lengths of a link that is 1 long


class AcrobotWorld(NamedTuple):
    """The acrobots of a batch, and how those in the lanes hang."""

    length_1: Any  # f8 (B,)
    length_2: Any  # f8 (B,)
    mass_1: Any  # f8 (B,)
    mass_2: Any  # f8 (B,)
    gravity: Any  # f8 (B,)
    low: Any  # f8 (4,) where episodes start that start anywhere
    high: Any  # f8 (4,)
    observed: Any  # f8 (L, 4)


@inlined
def slopes(state, torque, links):
    """Time derivatives of the state, four numbers; links: the first one's length, both masses, both half lengths, gravity."""
    theta1, theta2, dtheta1, dtheta2 = state
    l1, m1, m2, lc1, lc2, g = links
    sine2, cosine2 = sine_and_cosine(theta2)
    d1 = m1 * (lc1 * lc1) + m2 * (l1 * l1 + lc2 * lc2 + 2 * l1 * lc2 * cosine2) + INERTIA + INERTIA
    d2 = m2 * (lc2 * lc2 + l1 * lc2 * cosine2) + INERTIA
    phi2 = m2 * lc2 * g * sine_and_cosine(theta1 + theta2 - math.pi / 2.0)[1]
    phi1 = (
        -m2 * l1 * lc2 * (dtheta2 * dtheta2) * sine2
        - 2 * m2 * l1 * lc2 * dtheta2 * dtheta1 * sine2
        + (m1 * lc1 + m2 * l1) * g * sine_and_cosine(theta1 - math.pi / 2)[1]
        + phi2
    )
    ddtheta2 = (torque + d2 / d1 * phi1 - m2 * l1 * lc2 * (dtheta1 * dtheta1) * sine2 - phi2) / (
        m2 * (lc2 * lc2) + INERTIA - d2 * d2 / d1
    )
    ddtheta1 = -(d2 * ddtheta2 + phi1) / d1
    return dtheta1, dtheta2, ddtheta1, ddtheta2


@inlined
def swung(state, torque, links):
    """The state after a step with that torque."""
    half = SECONDS / 2.0
    k1 = slopes(state, torque, links)
    k2 = slopes(_along(state, half, k1), torque, links)
    k3 = slopes(_along(state, half, k2), torque, links)
    k4 = slopes(_along(state, SECONDS, k3), torque, links)
    return (
        _wrapped(_weighed(state[0], k1[0], k2[0], k3[0], k4[0])),
        _wrapped(_weighed(state[1], k1[1], k2[1], k3[1], k4[1])),
        _bounded(_weighed(state[2], k1[2], k2[2], k3[2], k4[2]), FASTEST_1),
        _bounded(_weighed(state[3], k1[3], k2[3], k3[3], k4[3]), FASTEST_2),
    )


@starts(AcrobotWorld)
def start(world, task, lane, rng, anywhere):
    """Hanging at rest but for SPREAD, or anywhere in the box below the goal."""
    observed = world.observed[lane]
    if anywhere:
        put_anywhere(world, task, lane, rng)
        return 0
    for dimension in range(4):
        observed[dimension] = SPREAD * (2 * unit(rng) - 1)
    return 0


@steps(AcrobotWorld)
def step(world, task, lane, state, action, uniform, rng):
    """A torque; the goal is a tip that is high enough."""
    observed = world.observed[lane]
    links = (
        world.length_1[task],
        world.mass_1[task],
        world.mass_2[task],
        0.5 * world.length_1[task],
        0.5 * world.length_2[task],
        world.gravity[task],
    )
    before = (observed[0], observed[1], observed[2], observed[3])
    observed[0], observed[1], observed[2], observed[3] = swung(before, action - 1.0, links)
    return end_at(world, task, lane)


@body(end_at, AcrobotWorld)
def _end_at(world, task, lane):
    theta1, theta2 = world.observed[lane, 0], world.observed[lane, 1]
    return GOAL if -sine_and_cosine(theta1)[1] - sine_and_cosine(theta2 + theta1)[1] > HEIGHT else 0


@body(guide, AcrobotWorld)
def _guide(world, task, lane):
    """Drives the joint the way it turns, which adds to the energy."""
    return 2 if world.observed[lane, 3] >= 0 else 0


@inlined
def _along(state, seconds, slope):
    return (
        state[0] + seconds * slope[0],
        state[1] + seconds * slope[1],
        state[2] + seconds * slope[2],
        state[3] + seconds * slope[3],
    )


@inlined
def _weighed(number, k1, k2, k3, k4):
    return number + SECONDS / 6.0 * (k1 + 2 * k2 + 2 * k3 + k4)


@inlined
def _wrapped(angle):
    """The angle from -pi to pi: one turn is taken off as Gymnasium does, more of them at once."""
    if angle > math.pi:
        angle -= 2 * math.pi
    elif angle < -math.pi:
        angle += 2 * math.pi
    if -math.pi <= angle <= math.pi:
        return angle
    return angle - 2 * math.pi * np.floor((angle + math.pi) / (2 * math.pi))


@inlined
def _bounded(speed, fastest):
    return min(max(speed, -fastest), fastest)
