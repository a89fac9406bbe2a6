"""Q-learning as one would write it down: one task, one step at a time, plain Python. The compiled loops must
equal it exactly."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field

import numpy as np

from qinit_cli.learning import Learning

MASK = 2**64 - 1


def rotated(word: int, count: int) -> int:
    return (word << count | word >> 64 - count) & MASK


def xoshiro(words: np.ndarray) -> Iterator[int]:
    """The 64-bit draws of xoshiro256++ from four words of state."""
    a, b, c, d = (int(word) for word in words)
    while True:
        yield (rotated((a + d) & MASK, 23) + a) & MASK
        shifted = b << 17 & MASK
        c ^= a
        d ^= b
        b ^= c
        a ^= d
        c ^= shifted
        d = rotated(d, 45)


def in_lanes(words: np.ndarray) -> Iterator[int]:
    """The draws of eight streams, (4, 8) words of state, in turn."""
    lanes = [xoshiro(words[:, lane]) for lane in range(8)]
    while True:
        for lane in lanes:
            yield next(lane)


@dataclass
class Outcome:
    """What one task learned."""

    q: list[list[float]]
    visits: list[list[int]]
    td_var: list[list[float]]
    steps: list[int] = field(default_factory=list)  # per episode
    reached: list[bool] = field(default_factory=list)


class Gridworld:
    """One gridworld: `step(draw, action)` moves the agent, `reset` puts it where an episode starts."""

    def __init__(self, size: int, goal: int, p: float, start: int | None, starts: Iterator[int]) -> None:
        self.size, self.goal, self.start, self.starts = size, goal, start, starts
        slip = (1.0 - p) / 3
        self.limits = [round(limit * 2**32) for limit in (p, p + slip, p + 2 * slip)]
        self.states, self.actions, self.state = size * size, 4, 0

    def reset(self) -> None:
        if self.start is not None:
            self.state = self.start
            return
        cells = [cell for cell in range(self.states) if cell != self.goal]
        self.state = cells[(next(self.starts) >> 32) * len(cells) >> 32]

    def step(self, draw: int, action: int) -> bool:
        """True if the goal was entered."""
        direction = (action + sum(draw >> 32 >= limit for limit in self.limits)) % 4
        row, column = divmod(self.state, self.size)
        row += (direction == 1) - (direction == 0)
        column += (direction == 3) - (direction == 2)
        if 0 <= row < self.size and 0 <= column < self.size:
            self.state = row * self.size + column
        return self.state == self.goal


def greedy_actions(values: list[float]) -> list[int]:
    return [action for action, value in enumerate(values) if value == max(values)]


def chosen(draw: int, values: list[float], exploration: int) -> int:
    """Epsilon-greedy, ties at random, by bits 12 to 31 and 0 to 11 of the draw."""
    explores = (draw >> 12 & 2**20 - 1) < exploration
    tied = list(range(len(values))) if explores else greedy_actions(values)
    return tied[(draw & 4095) * len(tied) >> 12]


def learn(world, learning: Learning, table, dice: Iterator[int], potential=None) -> Outcome:
    """One task learned from start to end."""
    q = [[float(value) for value in row] for row in table]
    out = Outcome(q, [[0] * world.actions for _ in q], [[0.0] * world.actions for _ in q])
    exploration = round(learning.epsilon * 2**20)
    for _ in range(learning.episodes):
        world.reset()
        length, reached = 0, False
        while not reached and length < learning.horizon:
            draw = next(dice)
            state = world.state
            action = chosen(draw, q[state], exploration)
            reached = world.step(draw, action)
            length += 1
            target = 1.0 if reached else learning.gamma * max(q[world.state])
            if potential is not None:
                target += 0.0 if reached else learning.gamma * float(potential[world.state])
                target -= float(potential[state])
            error = target - q[state][action]
            q[state][action] += learning.alpha * error
            out.visits[state][action] += 1
            out.td_var[state][action] += 0.01 * (error * error - out.td_var[state][action])
        out.steps.append(length)
        out.reached.append(reached)
    return out
