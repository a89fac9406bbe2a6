"""Tabular Q-learning as a researcher writes it: a Gymnasium environment, a numpy table, a Python loop."""

from __future__ import annotations

from typing import Any

import gymnasium
import numpy as np

SIZE, GOAL, P = 30, 20 * 30 + 20, 0.75
BINS = 30
STEPS = 100_000  # of a turn


class Gridworld(gymnasium.Env[int, int]):
    """A slippery grid; episodes start anywhere but at the goal."""

    observation_space = gymnasium.spaces.Discrete(SIZE * SIZE)
    action_space = gymnasium.spaces.Discrete(4)
    moves = ((-1, 0), (1, 0), (0, -1), (0, 1))

    def reset(self, *, seed: int | None = None, options: Any = None) -> tuple[int, dict[str, Any]]:
        super().reset(seed=seed)
        self.cell = GOAL
        while self.cell == GOAL:
            self.cell = int(self.np_random.integers(SIZE * SIZE))
        return self.cell, {}

    def step(self, action: int) -> tuple[int, float, bool, bool, dict[str, Any]]:
        if self.np_random.random() >= P:
            action = (action + 1 + int(self.np_random.integers(3))) % 4
        down, across = self.moves[action]
        row, column = divmod(self.cell, SIZE)
        row, column = min(max(row + down, 0), SIZE - 1), min(max(column + across, 0), SIZE - 1)
        self.cell = row * SIZE + column
        done = self.cell == GOAL
        return self.cell, float(done), done, False, {}


class Binned(gymnasium.ObservationWrapper[int, int, Any]):
    """Mountain Car seen in bins, with reward 1 at the flag."""

    def observation(self, observation: Any) -> int:
        row = min(BINS - 1, int((observation[0] + 1.2) * BINS / 1.8))
        return row * BINS + min(BINS - 1, int((observation[1] + 0.07) * BINS / 0.14))

    def step(self, action: int) -> tuple[int, float, bool, bool, dict[str, Any]]:
        state, _, done, truncated, told = super().step(action)
        return state, float(done), done, truncated, told


def gridworld() -> float:
    """Steps taken in a turn."""
    limited = gymnasium.wrappers.TimeLimit(Gridworld(), max_episode_steps=1_000)
    return _learn(limited, 4, alpha=0.1, gamma=0.95)


def mountain_car() -> float:
    """Steps taken in a turn; episodes start in the valley, as Gymnasium has it."""
    car = gymnasium.make("MountainCar-v0", max_episode_steps=1_000)
    return _learn(Binned(car), 3, alpha=0.05, gamma=0.99)


def _learn(world: Any, actions: int, alpha: float, gamma: float, epsilon: float = 0.5) -> float:
    rng = np.random.default_rng(0)
    q = np.zeros((SIZE * SIZE, actions))
    state, _ = world.reset(seed=0)
    for _ in range(STEPS):
        if rng.random() < epsilon:
            action = int(rng.integers(actions))
        else:
            action = int(rng.choice(np.flatnonzero(q[state] == q[state].max())))
        after, reward, done, truncated, _ = world.step(action)
        target = reward if done else gamma * q[after].max()
        q[state, action] += alpha * (target - q[state, action])
        state = after
        if done or truncated:
            state, _ = world.reset()
    return float(STEPS)
