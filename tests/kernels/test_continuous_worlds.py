"""The compiled continuous worlds against Gymnasium's, and their bins against bins counted by hand."""

from __future__ import annotations

import inspect
import math
import re
from textwrap import dedent
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from gymnasium.envs.classic_control import acrobot as their_acrobot
from gymnasium.envs.classic_control import cartpole as their_cart_pole

from qinit_cli.kernels.acrobot import swung
from qinit_cli.kernels.cart_pole import pushed
from qinit_cli.kernels.compiled import compiled, lean
from qinit_cli.kernels.continuous import bin_of
from qinit_cli.kernels.cosine import cosine, sine_and_cosine

STEPS = 3_000


@compiled
def both(y, found):  # type: ignore[no-untyped-def]
    """Sine and cosine of y f8 (N,) into `found` f8 (2, N)."""
    for place in range(len(y)):
        found[0, place], found[1, place] = sine_and_cosine(y[place])


def sine(y: float) -> float:
    found = np.empty((2, 1))
    both(np.array([y], np.float64), found)
    return float(found[0, 0])


def cosine_too(y: float) -> float:
    found = np.empty((2, 1))
    both(np.array([y], np.float64), found)
    return float(found[1, 0])


@lean
def push(state, force, parameters, after):  # type: ignore[no-untyped-def]
    """One step of one cart."""
    length, masspole, masscart, gravity = parameters
    now = state[0], state[1], state[2], state[3]
    after[0], after[1], after[2], after[3] = pushed(now, force, length, masspole, masscart, gravity)


@lean
def swing(state, torque, links, after):  # type: ignore[no-untyped-def]
    """One step of one acrobot."""
    after[0], after[1], after[2], after[3] = swung((state[0], state[1], state[2], state[3]), torque, links)


@lean
def bin_number(state, low, scale, bins):  # type: ignore[no-untyped-def]
    return bin_of(state, low, scale, bins)


def ulps(value: Any, true: Any) -> Any:
    return np.abs(value - true) / np.spacing(np.abs(true))


def test_sine_and_cosine_are_right_to_the_last_place() -> None:
    y = np.concatenate([np.random.default_rng(7).uniform(-100, 100, 80_000), np.linspace(-7, 7, 80_000)])
    found = np.empty((2, len(y)))
    both(y, found)
    exact = np.array([[math.sin(each), math.cos(each)] for each in y]).T
    assert ulps(found, exact).max() <= 1
    near = np.abs(y) < 6.28
    np.testing.assert_array_equal(found[1, near], cosine.py_func(y[near]))


def carts(steps: int) -> list[tuple[int, dict[str, float], np.ndarray, np.ndarray]]:
    """Actions, parameters, and Gymnasium's states before and after, of carts that Gymnasium steps."""
    env: Any = their_cart_pole.CartPoleEnv()
    rng = np.random.default_rng(3)
    found = []
    for number in range(steps):
        if number % 30 == 0:
            env.reset(seed=number)
            env.length, env.masspole, env.masscart, env.gravity, env.force_mag = rng.uniform(
                [0.2, 0.05, 0.5, 5, 5], [1.5, 0.5, 2, 20, 15]
            ).tolist()
            env.total_mass, env.polemass_length = env.masspole + env.masscart, env.masspole * env.length
            env.state = rng.uniform(-3, 3, 4)
        action, before = int(rng.integers(2)), np.array(env.state, np.float64)
        env.steps_beyond_terminated = None
        env.step(action)
        parameters = {name: getattr(env, name) for name in ("length", "masspole", "masscart", "gravity")}
        force = env.force_mag if action == 1 else -env.force_mag
        found.append((force, parameters, before, np.array(env.state, np.float64)))
    return found


def test_with_our_sine_gymnasiums_cart_goes_where_ours_goes_to_the_last_bit(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    known = {name: getattr(np, name) for name in ("square", "array", "float64", "float32", "inf")}
    theirs = SimpleNamespace(**known, sin=sine, cos=cosine_too)
    monkeypatch.setattr(their_cart_pole, "np", theirs)
    after = np.empty(4)
    for force, parameters, before, state in carts(STEPS):
        push(before, force, tuple(parameters.values()), after)
        np.testing.assert_array_equal(after, state)


def test_numpys_sine_moves_nothing_of_the_cart_but_last_bits() -> None:
    after = np.empty(4)
    for force, parameters, before, state in carts(STEPS):
        push(before, force, tuple(parameters.values()), after)
        np.testing.assert_allclose(after, state, rtol=0, atol=1e-14)


def acrobots(steps: int) -> list[tuple[float, tuple[float, ...], np.ndarray, np.ndarray, bool]]:
    """Torques, links, Gymnasium's states before and after, and whether it says that the goal is reached."""
    env: Any = their_acrobot.AcrobotEnv()
    rng = np.random.default_rng(4)
    found = []
    for number in range(steps):
        if number % 100 == 0:
            env.reset(seed=number)
            env.LINK_LENGTH_1, env.LINK_MASS_1, env.LINK_MASS_2, long = rng.uniform(0.5, 2, 4).tolist()
            env.LINK_COM_POS_1, env.LINK_COM_POS_2 = 0.5 * env.LINK_LENGTH_1, 0.5 * long
            env.state = rng.uniform(-3, 3, 4)
        action, before = int(rng.integers(3)), np.array(env.state, np.float64)
        env.step(action)
        links = (
            env.LINK_LENGTH_1,
            env.LINK_MASS_1,
            env.LINK_MASS_2,
            env.LINK_COM_POS_1,
            env.LINK_COM_POS_2,
            9.8,
        )
        found.append((action - 1.0, links, before, np.array(env.state, np.float64), bool(env._terminal())))
    return found


def with_products(function: Any) -> Any:
    """Gymnasium's function with x*x where it has x**2, which the C library's power rounds otherwise once in 1,000 times."""
    source, squares = re.subn(r"(\w+)\*\*2", r"(\1 * \1)", dedent(inspect.getsource(function)))
    assert squares > 0
    names: dict[str, Any] = {}
    exec(source, vars(their_acrobot), names)
    return names[function.__name__]


def test_with_our_sine_and_squares_gymnasiums_acrobot_goes_where_ours_goes_to_the_last_bit(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(their_acrobot, "sin", sine)
    monkeypatch.setattr(their_acrobot, "cos", cosine_too)
    monkeypatch.setattr(their_acrobot.AcrobotEnv, "_dsdt", with_products(their_acrobot.AcrobotEnv._dsdt))
    after = np.empty(4)
    for torque, links, before, state, _ in acrobots(STEPS):
        swing(before, torque, links, after)
        np.testing.assert_array_equal(after, state)


def test_numpys_sine_moves_nothing_of_the_acrobot_but_last_bits() -> None:
    after = np.empty(4)
    for torque, links, before, state, _ in acrobots(STEPS):
        swing(before, torque, links, after)
        np.testing.assert_allclose(after, state, rtol=1e-12, atol=1e-12)


def test_bins_are_numbered_row_by_row_and_reach_beyond_their_ends() -> None:
    low, high, bins = np.array([-1.0, 0.0]), np.array([1.0, 3.0]), np.array([4, 3])
    scale = bins / (high - low)
    states = [(-1, 0), (-0.51, 0.99), (-0.5, 1), (0.99, 2.99), (1, 3), (-9, 9), (9, -9), (math.nan, 1.5)]
    numbers = [0, 0, 4, 11, 11, 2, 9, 1]
    assert [bin_number(np.array(state, np.float64), low, scale, bins) for state in states] == numbers
