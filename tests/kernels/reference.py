"""Worlds and learning in them as one would write them down: one task, one step at a time, plain Python. The compiled loops
must equal it exactly; learner_reference.py has the learners and the explorations."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, field, fields

import numpy as np
from learner_reference import EXPLORATIONS, LEARNERS, Blend, Table, greedy_actions, picked

from qinit_cli.kernels.batch import LaneStreams
from qinit_cli.learning import Learning
from qinit_cli.rewards import UNIT, ReturnBounds

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
    evaluation: list[tuple[int, bool]] = field(
        default_factory=list
    )  # length and reached of each greedy episode
    returns: list[float] = field(default_factory=list)  # per episode
    evaluated: list[float] = field(default_factory=list)  # return of each greedy episode


class Gridworld:
    """One gridworld: `step(draw, action)` moves the agent, `reset` puts it where an episode starts."""

    def __init__(self, size: int, goal: int, p: float, start: int | None, starts: Iterator[int]) -> None:
        self.size, self.goal, self.start, self.starts = size, goal, start, starts
        slip = (1.0 - p) / 3
        self.limits = [round(limit * 2**32) for limit in (p, p + slip, p + 2 * slip)]
        self.states, self.actions, self.state, self.target = size * size, 4, 0, 0

    def reset(self) -> None:
        if self.start is not None:
            self.state = self.start
            return
        cells = [cell for cell in range(self.states) if cell != self.goal]
        self.state = cells[(next(self.starts) >> 32) * len(cells) >> 32]

    def reset_to_target(self, draws: Iterator[int]) -> None:
        self.state = self.target

    def step(self, draw: int, action: int, draws: Iterator[int] | None = None) -> bool:
        """True if the goal was entered."""
        direction = (action + sum(draw >> 32 >= limit for limit in self.limits)) % 4
        row, column = divmod(self.state, self.size)
        row += (direction == 1) - (direction == 0)
        column += (direction == 3) - (direction == 2)
        if 0 <= row < self.size and 0 <= column < self.size:
            self.state = row * self.size + column
        return self.state == self.goal


@dataclass
class MountainCar:
    """One mountain car; the table sees its bin."""

    bins: int
    eta: float
    hill: float
    start: str  # "anywhere", or as target
    starts: Iterator[int]
    target: str = "point"  # or "valley": the target start
    noise: float = 0.0
    gusts: Iterator[float] | None = None  # pushes of every step, in place of eta

    def __post_init__(self) -> None:
        self.states, self.actions, self.position, self.velocity = self.bins**2, 3, -0.5, 0.0

    @property
    def state(self) -> int:
        row = min(int((self.position + 1.2) * (self.bins / (0.6 + 1.2))), self.bins - 1)
        return row * self.bins + min(int((self.velocity + 0.07) * (self.bins / 0.14)), self.bins - 1)

    def reset(self) -> None:
        if self.start == "anywhere":
            self.position = -1.2 + (0.5 + 1.2) * unit(next(self.starts))
            self.velocity = -0.07 + 0.14 * unit(next(self.starts))
        else:
            self.reset_to_target(self.starts)

    def reset_to_target(self, draws: Iterator[int]) -> None:
        self.position, self.velocity = -0.5, 0.0
        if self.target == "valley":
            self.position = -0.6 + 0.2 * unit(next(draws))

    def step(self, draw: int, action: int, draws: Iterator[int] | None = None) -> bool:
        """True if the flag was reached; evaluation gives the draws that its pushes come from."""
        eta = self.eta
        if self.gusts is not None:
            eta = next(self.gusts if draws is None else gusts(self.eta, self.noise, draws))
        pushed = eta if self.position >= self.hill else 0.0
        self.velocity += (action - 1) * 0.001 + cosine(3 * self.position) * -0.0025
        self.velocity = min(max(self.velocity, -0.07), 0.07)
        self.position = min(max(self.position + (self.velocity + pushed), -1.2), 0.6)
        if self.position == -1.2 and self.velocity < 0:
            self.velocity = 0.0
        return self.position >= 0.5 and self.velocity >= 0


def unit(draw: int) -> float:
    return (draw >> 11) * 2.0**-53


def gusts(eta: float, noise: float, draws: Iterator[int]) -> Iterator[float]:
    """Pushes around eta by the polar method."""
    while True:
        x, y = 2 * unit(next(draws)) - 1, 2 * unit(next(draws)) - 1
        square = x * x + y * y
        if 0 < square < 1:
            scale = noise * math.sqrt(-2 * math.log(square) / square)
            yield eta + scale * x
            yield eta + scale * y


COS = 4.16666666666666019037e-02, -1.38888888888741095749e-03, 2.48015872894767294178e-05
COS += -2.75573143513906633035e-07, 2.08757232129817482790e-09, -1.13596475577881948265e-11
SIN = -1.66666666666666324348e-01, 8.33333333332248946124e-03, -1.98412698298579493134e-04
SIN += 2.75573137070700676789e-06, -2.50507602534068634195e-08, 1.58969099521155010221e-10


def cosine(y: float) -> float:
    """fdlibm's cosine, its polynomials summed in pairs."""
    turns = round(y * (2 / math.pi))
    rough, correction = y - turns * 1.57079632673412561417, turns * 6.07710050650619224932e-11
    r = rough - correction
    rest = (rough - r) - correction
    z = r * r
    if turns % 2 == 0:
        tail = z * ((COS[0] + z * COS[1]) + z * z * ((COS[2] + z * COS[3]) + z * z * (COS[4] + z * COS[5])))
        head = 1.0 - 0.5 * z
        value = head + (((1.0 - head) - 0.5 * z) + (z * tail - r * rest))
    else:
        tail = (SIN[1] + z * SIN[2]) + z * z * ((SIN[3] + z * SIN[4]) + z * z * SIN[5])
        value = r - ((z * (0.5 * rest - z * r * tail) - rest) - z * r * SIN[0])
    return value if turns % 4 in (0, 3) else -value


def part(given: LaneStreams, tasks: slice | list[int]) -> LaneStreams:
    """The streams of some of the tasks."""
    streams = {field.name: getattr(given, field.name) for field in fields(given)}
    return LaneStreams(**{name: None if each is None else each[tasks] for name, each in streams.items()})


class Choices:
    """UCB1 over policies (K, S), one choice an episode."""

    def __init__(
        self, policies, draws: Iterator[int], gamma: float, c: float, psi0: float, rho: float, nu: float
    ) -> None:
        self.policies, self.draws, self.gamma, self.c, self.nu, self.rho = policies, draws, gamma, c, nu, rho
        self.returns: list[list[float]] = [[] for _ in policies]
        self.mean, self.first_psi = [0.0] * len(policies), psi0
        self.choose()

    def choose(self) -> None:
        self.psi = self.first_psi
        untried = [policy for policy, returns in enumerate(self.returns) if not returns]
        if untried:
            self.chosen = untried[(next(self.draws) >> 32) * len(untried) >> 32]
            return
        best = max(max(returns) for returns in self.returns)
        k = sum(map(len, self.returns))
        bounds = [
            (mean / best if best > 0 else 0.0) + self.c * math.sqrt(2 * math.log(k) / len(returns))
            for mean, returns in zip(self.mean, self.returns, strict=True)
        ]
        self.chosen = bounds.index(max(bounds))

    def follows(self) -> bool:
        follows = unit(next(self.draws)) < self.psi
        self.psi *= self.nu
        return follows

    def share(self, length: int, reached: bool, gained: float) -> float:
        """What an episode is credited with: its return, as a share of the attainable one."""
        return self.gamma ** (length - 1) if reached else 0.0

    def episode_ended(self, length: int, reached: bool, gained: float) -> None:
        gained = self.share(length, reached, gained)
        self.returns[self.chosen].append(gained)
        self.mean[self.chosen] += (gained - self.mean[self.chosen]) / len(self.returns[self.chosen])
        self.first_psi *= self.rho
        self.choose()


@dataclass
class Weighed:
    """Tables (K, S, A) weighed by TD errors; the whole start table follows the weights at once.

    Tables and errors are shares of the attainable return; what is learned is returns.
    """

    tables: np.ndarray
    td_var: np.ndarray
    gamma: float
    temperature: float
    floor: float
    excess: float
    cap: float
    freeze: int
    threshold: float
    geometric: bool
    centred: bool
    bounds: ReturnBounds = UNIT

    def __post_init__(self) -> None:
        self.log_weight = np.zeros(len(self.tables))
        self.mixed = self.weight
        self.start = self.mean()
        self.history, self.goals, self.moves, self.frozen = [self.weight], 0, 0, -1

    @property
    def weight(self) -> np.ndarray:
        weight = np.exp(np.maximum(self.log_weight - self.log_weight.max(), -600.0))
        return weight / weight.sum()

    def mean(self) -> np.ndarray:
        """Of the tables that know a pair, under the weights; the least return where none does."""
        weight = self.mixed[:, None, None] * (self.tables > 0)
        terms = np.log(np.where(self.tables > 0, self.tables, 1)) if self.geometric else self.tables
        whole = weight.sum(axis=0)
        mean = (weight * terms).sum(axis=0) / np.where(whole > 0, whole, 1)
        return self.bounds.returns(np.where(whole > 0, np.exp(mean) if self.geometric else mean, 0))

    def learn(self, q, left, state: int, action: int, reward: float, after: int | None) -> None:
        """Weighs a step; what is `left` of the start in each value of q follows it."""
        if self.frozen >= 0:
            return
        returns = self.bounds.returns(self.tables)
        entering = reward if after is None else reward + self.gamma * returns[:, after].max(axis=1)
        error = (entering - returns[:, state, action]) / self.bounds.width
        known = self.tables[:, state, action] > 0  # a table that does not know the pair says nothing
        own = self.td_var[:, state, action]
        squares = (error**2 - self.centred * own) / (own + self.floor**2)
        least = -np.inf if self.centred else 0
        self.log_weight -= self.temperature * known * np.clip(squares - self.excess, least, self.cap)
        if np.abs(self.weight - self.mixed).sum() > self.threshold:
            self.mixed, self.moves, before = self.weight, self.moves + 1, self.start
            self.start = self.mean()
            change = np.array(left) * (self.start - before)
            for row, changes in zip(q, change, strict=True):
                row[:] = [float(value + more) for value, more in zip(row, changes, strict=True)]

    def episode_ended(self, reached: bool) -> None:
        self.goals += reached
        if reached and self.goals == self.freeze:
            self.frozen = len(self.history)
        self.history.append(self.weight)


def ended(world) -> bool:
    """True if the world can end without its goal, and has."""
    return getattr(world, "lost", False)


def cut_off(world) -> bool:
    """True if the world can cut an episode off, and has."""
    return getattr(world, "cut", False)


def evaluated(world, q, learning: Learning, draws: Iterator[int]) -> tuple[int, bool, float]:
    """Length of a greedy episode from the target start, whether it reached the goal, and its return."""
    world.reset_to_target(draws)
    length, reached, gained, discount, horizon = 0, False, 0.0, 1.0, learning.horizon
    while not (reached or ended(world) or cut_off(world)) and length < horizon:
        draw = next(draws)
        reached = world.step(draw, picked(draw, greedy_actions(q[world.state])), draws)
        gained += discount * getattr(world, "paid", float(reached))
        discount *= learning.gamma
        length += 1
    return length, reached, gained


def learn(
    world,
    learning: Learning,
    table,
    rng: Iterator[int],
    potential=None,
    every: int = 0,
    evaluation: Iterator[int] | None = None,
    choices: Choices | None = None,
    explore_while_following: bool = False,
    weighed: Weighed | None = None,
    coins: Iterator[int] | None = None,
    known_at: int | None = None,
    kind: type[Table] = list,
) -> Outcome:
    """One task learned from start to end; `coins` (0 or 1) are those of double Q-learning.

    `known_at`: updates after which a blended value is the learned one; `kind` of the table, which may be tiles.
    """
    q = kind([float(value) for value in row] for row in table)
    explore = EXPLORATIONS[learning.explore.name](learning, q)
    learner = LEARNERS[learning.learner.name](learning, q, potential, explore, coins)
    learner.weighed, learner.told = weighed, hasattr(world, "paid")
    learner.blend = None if known_at is None else Blend(q, known_at)
    out = Outcome(q, learner.visits, learner.td_var)
    for episode in range(learning.episodes + 1):
        if every > 0 and episode % every == 0:
            *told, gained = evaluated(world, q, learning, evaluation)
            out.evaluation.append(tuple(told))
            out.evaluated.append(gained)
        if episode == learning.episodes:
            break
        world.reset()
        explore.begin(episode)
        learner.begin(episode)
        length, reached, over, gained, discount = 0, False, False, 0.0, 1.0
        while not over:
            draw = next(rng)
            state = world.state
            action = explore.action(draw, state)
            explores = explore_while_following and explore.explores(draw)
            if choices is not None and choices.follows() and not explores:
                action = int(choices.policies[choices.chosen][state])
            learner.chose(state, action)
            reached = world.step(draw, action)
            explore.took(state, action)
            length += 1
            over = reached or ended(world)
            reward = world.paid if learner.told else float(reached)
            gained, discount = gained + discount * reward, discount * learning.gamma
            learner.step(state, action, reward, None if over else world.state)
            over = over or cut_off(world) or length == learning.horizon
        learner.end()
        out.returns.append(gained)
        out.steps.append(length)
        out.reached.append(reached)
        if choices is not None:
            choices.episode_ended(length, reached, gained)
        if weighed is not None:
            weighed.episode_ended(reached)
    return out
