"""Environments as people write them: six cells in a row, and what may be wrong with them. Each has the id NAME-v0."""

from __future__ import annotations

import ctypes
import os
import random
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any, ClassVar

import gymnasium
import numpy as np
from gymnasium import spaces


class Walk(gymnasium.Env[int, int]):
    """Right leads to the goal; a step goes the other way with probability `slip`; `limit` steps, reported as truncated."""

    observation_space: Any = spaces.Discrete(6)
    action_space: Any = spaces.Discrete(2)
    PULL = 0.0  # of the class
    counts: ClassVar[dict[str, int]] = {"made": 0, "closed": 0}

    def __init__(self, slip: float = 0.3, limit: int = 0, path: Any = None) -> None:
        self.slip, self.limit, self.path = slip, limit, path
        self.counts["made"] += 1

    @property
    def speed(self) -> float:
        return 1.0

    def reset(self, *, seed: int | None = None, options: Any = None) -> tuple[Any, dict[str, Any]]:
        super().reset(seed=seed)
        self.cell = self.time = 0
        return 0, {}

    def step(self, action: int) -> Any:
        self.time += 1
        action = 1 - action if self.np_random.random() < self.slip + self.PULL else action
        self.cell = min(max(self.cell + (1 if action else -1), 0), 5)
        done = self.cell == 5
        return self.cell, float(done), done, bool(self.limit) and self.time >= self.limit and not done, {}

    def close(self) -> None:
        self.counts["closed"] += 1


class Handed(Walk):
    """Hands its arguments on."""

    def __init__(self, **given: Any) -> None:
        super().__init__(**given)


class Pairs(gymnasium.ObservationWrapper):
    """Three states instead of six."""

    def __init__(self, env: Any) -> None:
        super().__init__(env)
        self.observation_space = spaces.Discrete(3)
        self.width = 2

    def observation(self, observation: int) -> int:
        return observation // self.width


class Mirrored(gymnasium.ActionWrapper):
    def action(self, action: int) -> int:
        return 1 - action


class Positions(gymnasium.ObservationWrapper):
    """A Box of one number, as TransformObservation makes it."""

    def __init__(self, env: Any) -> None:
        super().__init__(env)
        self.observation_space = spaces.Box(0.0, 6.0, (1,))

    def observation(self, observation: int) -> Any:
        return np.array([observation + 0.5], np.float32)


class Noisy(Walk):
    """Prints by every way there is."""

    def step(self, action: int) -> Any:
        print("said")
        os.write(1, b"written\n")
        ctypes.CDLL(None).printf(b"printed by C\n")
        (sys.__stdout__ or sys.stderr).write("kept\n")
        return super().step(action)


class OwnChance(Walk):
    """A slip from probability that no seed reaches."""

    def __init__(self) -> None:
        super().__init__(float(np.random.default_rng().uniform(0, 0.5)))


class ByNumpy(Walk):
    def step(self, action: int) -> Any:
        return super().step(int(np.random.random() < 0.5))  # noqa: NPY002, as people do


class ByPython(Walk):
    def step(self, action: int) -> Any:
        return super().step(int(random.random() < 0.5))


class SeedsForAll(ByNumpy):
    """Seeds what all environments share: two that are learned at once disturb each other."""

    def reset(self, *, seed: int | None = None, options: Any = None) -> Any:
        np.random.seed(seed)  # noqa: NPY002, as people do
        return super().reset(seed=seed)


class ByTheClock(Walk):
    def step(self, action: int) -> Any:
        observation, _, *rest = super().step(action)
        return observation, time.perf_counter(), *rest


class StartsByChance(Walk):
    """Starts now and then where no seed has a say, in episodes longer than those that are tried."""

    def reset(self, *, seed: int | None = None, options: Any = None) -> Any:
        super().reset(seed=seed)
        self.cell = int(np.random.random() < 0.5)  # noqa: NPY002, as people do
        return self.cell, {}

    def step(self, action: int) -> Any:
        self.cell = 0
        return super().step(0)


class SeededOnce(Walk):
    """Heeds the seed of its first reset alone."""

    def reset(self, *, seed: int | None = None, options: Any = None) -> Any:
        return super().reset(seed=None if hasattr(self, "cell") else seed)


class SameArray(Positions):
    """Observes the same array again and again, with other numbers in it."""

    def observation(self, observation: int) -> Any:
        self.row = getattr(self, "row", np.zeros(1, np.float32))
        self.row[:] = super().observation(observation)
        return self.row


class Panic(BaseException):
    """What environments in Rust raise."""


class Raises(Walk):
    """Raises where it is told to."""

    def __init__(self, where: str = "") -> None:
        super().__init__()
        self.where = where
        self._raise("init")

    def reset(self, *, seed: int | None = None, options: Any = None) -> Any:
        self._raise("reset")
        return super().reset(seed=seed)

    def step(self, action: int) -> Any:
        self._raise("step")
        if self.where == "exit":
            raise SystemExit(0)
        if self.where == "panic":
            raise Panic("the motor\nis broken")
        return (0, 0.0, False, {}) if self.where == "tuple" else super().step(action)

    def close(self) -> None:
        self._raise("close")

    def _raise(self, here: str) -> None:
        if self.where == here:
            raise ValueError("the motor\nis broken")


MAKERS: dict[str, Any] = {
    "Walk-v0": Walk,
    "Handed-v0": Handed,
    "Paired-v0": lambda **given: Pairs(Walk(**given)),
    "Mirrored-v0": lambda **given: Mirrored(Walk(**given)),
    "Positions-v0": lambda **given: Positions(Walk(**given)),
    "Noisy-v0": Noisy,
    "OwnChance-v0": OwnChance,
    "ByNumpy-v0": ByNumpy,
    "ByPython-v0": ByPython,
    "SeedsForAll-v0": SeedsForAll,
    "ByTheClock-v0": ByTheClock,
    "StartsByChance-v0": StartsByChance,
    "SeededOnce-v0": SeededOnce,
    "SameArray-v0": lambda **given: SameArray(Walk(**given)),
    "Raises-v0": Raises,
}


@contextmanager
def registered() -> Iterator[None]:
    """While it lasts, gymnasium knows them; Limited-v0 is Walk with gymnasium's own limit of eight steps."""
    for name, maker in MAKERS.items():
        gymnasium.register(name, entry_point=maker)
    gymnasium.register("Limited-v0", entry_point=Walk, max_episode_steps=8)
    try:
        yield
    finally:
        for name in [*MAKERS, "Limited-v0"]:
            del gymnasium.registry[name]
