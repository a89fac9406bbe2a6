"""Tabular Q-learning with OpenSpiel's own agent, in environments written for its interface."""

from __future__ import annotations

import math
import random
from abc import ABC, abstractmethod

from open_spiel.python.algorithms.tabular_qlearner import QLearner
from open_spiel.python.rl_environment import StepType, TimeStep
from open_spiel.python.rl_tools import ConstantSchedule

SIZE, GOAL, P = 30, 20 * 30 + 20, 0.75
BINS, HORIZON = 30, 1_000
STEPS = 50_000  # of a turn


class World(ABC):
    """One player and a reward of 1 at the goal; the agent takes the last step before the horizon for an end."""

    actions: list[int]

    def __init__(self) -> None:
        self.probability = random.Random(0)
        self.time = 0

    @abstractmethod
    def start(self) -> int:
        """The state in which an episode starts."""

    @abstractmethod
    def move(self, action: int) -> tuple[int, bool]:
        """The state that the action leads to, and whether it is the goal."""

    def reset(self) -> TimeStep:
        """The first step of an episode."""
        self.time = 0
        return self._seen(self.start(), None, StepType.FIRST)

    def step(self, action: int) -> TimeStep:
        """The next one."""
        self.time += 1
        state, done = self.move(action)
        over = done or self.time == HORIZON
        return self._seen(state, [float(done)], StepType.LAST if over else StepType.MID)

    def _seen(self, state: int, rewards: list[float] | None, kind: StepType) -> TimeStep:
        seen = {"info_state": [state], "legal_actions": [self.actions], "current_player": 0}
        return TimeStep(observations=seen, rewards=rewards, discounts=[1.0], step_type=kind)


class Gridworld(World):
    """A slippery grid; episodes start anywhere but at the goal."""

    actions = [0, 1, 2, 3]  # noqa: RUF012 (the agent indexes arrays with it)
    moves = ((-1, 0), (1, 0), (0, -1), (0, 1))

    def start(self) -> int:
        """Any cell but the goal."""
        self.cell = GOAL
        while self.cell == GOAL:
            self.cell = self.probability.randrange(SIZE * SIZE)
        return self.cell

    def move(self, action: int) -> tuple[int, bool]:
        """The cell it leads to, unless it slips."""
        if self.probability.random() >= P:
            action = (action + 1 + self.probability.randrange(3)) % 4
        down, across = self.moves[action]
        row, column = divmod(self.cell, SIZE)
        row, column = min(max(row + down, 0), SIZE - 1), min(max(column + across, 0), SIZE - 1)
        self.cell = row * SIZE + column
        return self.cell, self.cell == GOAL


class MountainCar(World):
    """Mountain Car seen in bins; episodes start anywhere before the flag."""

    actions = [0, 1, 2]  # noqa: RUF012 (as above)

    def start(self) -> int:
        """The bin of any position and velocity."""
        self.position = self.probability.uniform(-1.2, 0.5)
        self.velocity = self.probability.uniform(-0.07, 0.07)
        return self._bin()

    def move(self, action: int) -> tuple[int, bool]:
        """The bin it leads to."""
        velocity = self.velocity + (action - 1) * 0.001 - 0.0025 * math.cos(3 * self.position)
        velocity = min(max(velocity, -0.07), 0.07)
        self.position = min(max(self.position + velocity, -1.2), 0.6)
        self.velocity = max(velocity, 0.0) if self.position == -1.2 else velocity
        return self._bin(), self.position >= 0.5 and self.velocity >= 0

    def _bin(self) -> int:
        row = min(BINS - 1, int((self.position + 1.2) * BINS / 1.8))
        return row * BINS + min(BINS - 1, int((self.velocity + 0.07) * BINS / 0.14))


def gridworld() -> float:
    """Steps taken in a turn."""
    return _learn(Gridworld(), alpha=0.1, gamma=0.95)


def mountain_car() -> float:
    """Steps taken in a turn."""
    return _learn(MountainCar(), alpha=0.05, gamma=0.99)


def _learn(world: World, alpha: float, gamma: float, epsilon: float = 0.5) -> float:
    agent = QLearner(0, len(world.actions), alpha, ConstantSchedule(epsilon), gamma)
    seen = world.reset()
    for _ in range(STEPS):
        seen = world.step(int(agent.step(seen).action))
        if seen.last():
            agent.step(seen)
            seen = world.reset()
    return float(STEPS)
