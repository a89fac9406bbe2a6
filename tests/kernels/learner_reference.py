"""Learners and explorations as their sources write them down: one task, plain Python.

A step goes from `state` by `action` to `after`, and pays `reward`: 1 for entering the goal, else 0, or what the world `paid`.
`after` is None where the episode ended by itself; where it was cut off, what would have followed still counts.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from functools import reduce
from operator import add
from typing import Any

from qinit_cli.learning import Learning
from qinit_cli.schedules import ByVisits, Schedule

Table = list[list[float]]


def in_order(numbers: list[float]) -> float:
    """Their sum from left to right; Python's own `sum` corrects its rounding from 3.12 on."""
    return reduce(add, numbers)


def greedy_actions(values: list[float]) -> list[int]:
    return [action for action, value in enumerate(values) if value == max(values)]


def picked(draw: int, tied: list[int]) -> int:
    """One of them, by bits 0 to 11 of the draw."""
    return tied[(draw & 4095) * len(tied) >> 12]


def flipped(draws: Iterator[int]) -> Iterator[int]:
    """Coins: 63 of each draw, its lowest bit first."""
    for draw in draws:
        for bit in range(63):
            yield draw >> bit & 1


def of_episode(value: float | Schedule, episodes: int, episode: int) -> float:
    return value.values(episodes)[episode] if isinstance(value, Schedule) else value


class EpsilonGreedy:
    """Sutton & Barto (2018), section 2.2; whether a step explores is decided by bits 12 to 31 of its draw."""

    def __init__(self, learning: Learning, q: Table) -> None:
        self.learning, self.options, self.q = learning, learning.explore, q

    def begin(self, episode: int) -> None:
        epsilon = of_episode(self.learning.epsilon, self.learning.episodes, episode)
        self.limit = round(epsilon * 2**20)

    def explores(self, draw: int) -> bool:
        return (draw >> 12 & 2**20 - 1) < self.limit

    def action(self, draw: int, state: int) -> int:
        values = self.q[state]
        return picked(draw, list(range(len(values))) if self.explores(draw) else greedy_actions(values))

    def took(self, state: int, action: int) -> None:
        """Whatever chose it, the action was taken."""

    def expected(self, state: int) -> float:
        """The mean of the state's values under this exploration."""
        epsilon, values = self.limit * 2.0**-20, self.q[state]
        return epsilon * (in_order(values) / len(values)) + (1.0 - epsilon) * max(values)


class Boltzmann(EpsilonGreedy):
    """Sutton & Barto (2018), section 13.1: the softmax of the values, here over a temperature."""

    def begin(self, episode: int) -> None:
        pass

    def explores(self, draw: int) -> bool:
        return False

    def weights(self, state: int) -> list[float]:
        values, sharpness = self.q[state], 1.0 / self.options.temperature
        return [math.exp((value - max(values)) * sharpness) for value in values]

    def action(self, draw: int, state: int) -> int:
        weights = self.weights(state)
        drawn = (draw & 2**32 - 1) * 2.0**-32 * in_order(weights)
        for action in range(len(weights)):
            if in_order(weights[: action + 1]) > drawn:
                return action
        return len(weights) - 1

    def expected(self, state: int) -> float:
        weights = self.weights(state)
        shares = [weight * value for weight, value in zip(weights, self.q[state], strict=True)]
        return in_order(shares) / in_order(weights)


class Ucb(EpsilonGreedy):
    """UCB1 of Auer et al. (2002) in each state, c in place of the root of 2: every action once, then the largest bound."""

    def __init__(self, learning: Learning, q: Table) -> None:
        super().__init__(learning, q)
        self.taken = [[0] * len(row) for row in q]

    def begin(self, episode: int) -> None:
        pass

    def explores(self, draw: int) -> bool:
        return False

    def best(self, state: int) -> list[int]:
        taken = self.taken[state]
        untried = [action for action, times in enumerate(taken) if times == 0]
        if untried:
            return untried
        log = math.log(sum(taken))
        bounds = [
            value + self.options.c * math.sqrt(log / times)
            for value, times in zip(self.q[state], taken, strict=True)
        ]
        return greedy_actions(bounds)

    def action(self, draw: int, state: int) -> int:
        return picked(draw, self.best(state))

    def took(self, state: int, action: int) -> None:
        self.taken[state][action] += 1

    def expected(self, state: int) -> float:
        best = self.best(state)
        return in_order([self.q[state][action] for action in best]) / len(best)


class Tiles(Table):
    """Weights (T, A); a state is the tuple of its active tiles, its values their sums."""

    def __getitem__(self, state: Any) -> Any:
        if isinstance(state, tuple):
            return [in_order(list(own)) for own in zip(*(self[tile] for tile in state), strict=True)]
        return super().__getitem__(state)


class Blend:
    """Keeps in q the mix (1 - k) Q0 + k Q of each of its numbers, k = min(1, n / known_at) after n updates of that number."""

    def __init__(self, q: Table, known_at: int) -> None:
        self.q, self.known_at = q, known_at
        self.start = [list(row) for row in q]
        self.learned = type(q)([0.0] * len(row) for row in q)
        self.updates = [[0] * len(row) for row in q]

    def add(self, state: Any, action: int, amount: float) -> None:
        tiles = state if isinstance(state, tuple) else (state,)
        for tile in tiles:
            self.learned[tile][action] += amount * (1.0 / len(tiles))
            self.updates[tile][action] += 1
            k = min(1.0, self.updates[tile][action] / self.known_at)
            start, learned = self.start[tile][action], self.learned[tile][action]
            self.q[tile][action] = (1.0 - k) * start + k * learned


class Learner:
    """What all have: the table, its tallies, targets and step sizes."""

    def __init__(
        self,
        learning: Learning,
        q: Table,
        potential: Any,
        explore: EpsilonGreedy,
        coins: Iterator[int] | None,
    ) -> None:
        self.learning, self.options, self.gamma = learning, learning.learner, learning.gamma
        self.q, self.potential, self.explore, self.coins = q, potential, explore, coins
        self.visits = type(q)([0] * len(row) for row in q)
        self.td_var = type(q)([0.0] * len(row) for row in q)
        self.left = type(q)([1.0] * len(row) for row in q)  # the share of its start in a value
        self.told = False  # whether the world tells its rewards: then R-Max sums them before what follows
        self.blend: Blend | None = None  # None: what is learned is what acts
        self.weighed: Any = None  # hypotheses that an update's step is weighed by

    def begin(self, episode: int) -> None:
        """A new episode."""
        self.episode = episode

    def chose(self, state: int, action: int) -> None:
        """The action of the coming step is known, the step not yet done."""

    def step(self, state: int, action: int, reward: float, after: int | None) -> None:
        raise NotImplementedError

    def end(self) -> None:
        """The episode is over."""

    def target(self, state: int, reward: float, after: int | None, future: float) -> float:
        """r + gamma V(s'), shaped; the potential of an end is 0 (Ng et al., 1999)."""
        target = reward + self.gamma * future
        if self.potential is not None:
            target += 0.0 if after is None else self.gamma * float(self.potential[after])
            target -= float(self.potential[state])
        return target

    def largest(self, after: int | None) -> float:
        return 0.0 if after is None else max(self.q[after])

    def step_size(self, updates: int) -> float:
        """Of the next update of a value that has had so many."""
        alpha = self.learning.alpha
        if isinstance(alpha, ByVisits):
            return 1.0 / math.pow(updates + 1, alpha.power)
        return of_episode(alpha, self.learning.episodes, self.episode)

    def tally(self, state: int, action: int, error: float) -> None:
        self.visits[state][action] += 1
        self.td_var[state][action] += 0.01 * (error * error - self.td_var[state][action])

    def update(self, state: int, action: int, reward: float, after: int | None, future: float) -> None:
        learned = self.q if self.blend is None else self.blend.learned
        error = self.target(state, reward, after, future) - learned[state][action]
        alpha = self.step_size(self.visits[state][action])
        if self.blend is None:
            self.q[state][action] += alpha * error
        else:
            self.blend.add(state, action, alpha * error)
        self.tally(state, action, error)
        self.left[state][action] *= 1.0 - alpha
        if self.weighed is not None:
            self.weighed.learn(self.q, self.left, state, action, reward, after)


class QLearning(Learner):
    """Watkins (1989); Sutton & Barto (2018), section 6.5."""

    def step(self, state: int, action: int, reward: float, after: int | None) -> None:
        self.update(state, action, reward, after, self.largest(after))


class ExpectedSarsa(Learner):
    """Sutton & Barto (2018), section 6.6."""

    def step(self, state: int, action: int, reward: float, after: int | None) -> None:
        future = 0.0 if after is None else self.explore.expected(after)
        self.update(state, action, reward, after, future)


class Sarsa(Learner):
    """Sutton & Barto (2018), section 6.4. Where an episode is cut off no action follows: the mean over them takes its place."""

    def begin(self, episode: int) -> None:
        super().begin(episode)
        self.waiting: tuple[int, int, float, int] | None = None

    def chose(self, state: int, action: int) -> None:
        self.learn_from(self.q[state][action])

    def step(self, state: int, action: int, reward: float, after: int | None) -> None:
        if after is None:
            self.update(state, action, reward, None, 0.0)
        else:
            self.waiting = state, action, reward, after

    def end(self) -> None:
        if self.waiting is not None:
            self.learn_from(self.explore.expected(self.waiting[3]))

    def learn_from(self, future: float) -> None:
        """The update that waited for what follows its step."""
        if self.waiting is not None:
            state, action, reward, after = self.waiting
            self.waiting = None
            self.update(state, action, reward, after, future)


class DoubleQ(Learner):
    """van Hasselt (2010), algorithm 1; UPDATE(A) where the coin shows 0. The mean of both tables acts."""

    def __init__(self, *given: Any) -> None:
        super().__init__(*given)
        self.tables = [[list(row) for row in self.q] for _ in range(2)]
        self.updates = [[[0] * len(row) for row in self.q] for _ in range(2)]

    def step(self, state: int, action: int, reward: float, after: int | None) -> None:
        coin = next(self.coins)
        own, other, updates = self.tables[coin], self.tables[1 - coin], self.updates[coin][state]
        future = 0.0 if after is None else other[after][greedy_actions(own[after])[0]]
        error = self.target(state, reward, after, future) - own[state][action]
        own[state][action] += self.step_size(updates[action]) * error
        updates[action] += 1
        self.q[state][action] = (self.tables[0][state][action] + self.tables[1][state][action]) * 0.5
        self.tally(state, action, error)


class Traces(Learner):
    """Eligibility traces: Sutton & Barto (2018), sections 12.7 and 12.10."""

    def begin(self, episode: int) -> None:
        super().begin(episode)
        self.traces: dict[tuple[int, int], float] = {}

    def fade(self) -> None:
        share = self.gamma * self.options.lambda_
        faded = {pair: trace * share for pair, trace in self.traces.items()}
        self.traces = {pair: trace for pair, trace in faded.items() if trace >= self.options.least}

    def update(self, state: int, action: int, reward: float, after: int | None, future: float) -> None:
        error, pair = self.target(state, reward, after, future) - self.q[state][action], (state, action)
        accumulates = self.options.traces == "accumulating"
        self.traces[pair] = self.traces.get(pair, 0.0) + 1.0 if accumulates else 1.0
        change = self.step_size(self.visits[state][action]) * error
        for (there, then), trace in self.traces.items():
            self.q[there][then] += change * trace
        self.tally(state, action, error)


class QLambda(Traces, QLearning):
    """Watkins' Q(lambda)."""

    def chose(self, state: int, action: int) -> None:
        if self.q[state][action] == max(self.q[state]):
            self.fade()
        else:
            self.traces = {}


class SarsaLambda(Traces, Sarsa):
    """Sarsa(lambda) of a table: one feature a pair."""

    def update(self, state: int, action: int, reward: float, after: int | None, future: float) -> None:
        super().update(state, action, reward, after, future)
        self.fade()


class DelayedQ(Learner):
    """Strehl et al. (2006), algorithm 1, in its own letters."""

    def __init__(self, *given: Any) -> None:
        super().__init__(*given)
        pairs = [(state, action) for state, row in enumerate(self.q) for action in range(len(row))]
        self.u, self.l = dict.fromkeys(pairs, 0.0), dict.fromkeys(pairs, 0)
        self.t_of, self.learns = dict.fromkeys(pairs, 0), dict.fromkeys(pairs, True)
        self.t = self.t_star = 0

    def step(self, state: int, action: int, reward: float, after: int | None) -> None:
        q, pair, target = (
            self.q[state],
            (state, action),
            self.target(state, reward, after, self.largest(after)),
        )
        self.tally(state, action, target - q[action])
        self.t += 1
        if self.learns[pair]:
            self.u[pair] += target
            self.l[pair] += 1
            if self.l[pair] == self.options.m:
                mean = self.u[pair] / self.options.m
                if q[action] - mean >= 2 * self.options.epsilon1:
                    q[action] = mean + self.options.epsilon1
                    self.t_star = self.t
                elif self.t_of[pair] >= self.t_star:
                    self.learns[pair] = False
                self.t_of[pair], self.u[pair], self.l[pair] = self.t, 0.0, 0
        elif self.t_of[pair] < self.t_star:
            self.learns[pair] = True


class RMax(Learner):
    """Brafman & Tennenholtz (2002), discounted: the model is the mean of the first steps from a pair, once there are enough."""

    def __init__(self, *given: Any) -> None:
        super().__init__(*given)
        self.met: dict[tuple[int, int], list[tuple[float, int | None]]] = {}
        self.ways: list[tuple[int, int, int | None]] = []  # all that were met, in the order of time

    def step(self, state: int, action: int, reward: float, after: int | None) -> None:
        target = self.target(state, reward, after, self.largest(after))
        self.tally(state, action, target - self.q[state][action])
        if not self.knows(state, action):
            self.met.setdefault((state, action), []).append((reward, after))
            self.ways.append((state, action, after))
            if self.knows(state, action):
                self.plan(state)

    def knows(self, state: int, action: int) -> bool:
        return len(self.met.get((state, action), [])) == self.options.known

    def backup(self, state: int, action: int) -> float:
        met = self.met[state, action]
        rewards, follow = (
            [reward for reward, _ in met],
            [self.gamma * self.largest(after) for _, after in met],
        )
        if self.told:
            return in_order([in_order(rewards), *follow]) / len(met)
        return in_order([reward + value for reward, value in zip(rewards, follow, strict=True)]) / len(met)

    def plan(self, first: int) -> None:
        """Value iteration in the model, of what a change reaches, first in, first out."""
        waiting = [first]
        while waiting:
            state = waiting.pop(0)
            before = max(self.q[state])
            known = [action for action in range(len(self.q[state])) if self.knows(state, action)]
            values = [self.backup(state, action) for action in known]
            for action, value in zip(known, values, strict=True):
                self.q[state][action] = value
            if abs(max(self.q[state]) - before) > self.options.tolerance:
                for there, action, after in reversed(self.ways):
                    if after == state and self.knows(there, action) and there not in waiting:
                        waiting.append(there)


class Still(Learner):
    """Nothing is learned."""

    def step(self, state: int, action: int, reward: float, after: int | None) -> None:
        pass


EXPLORATIONS = {"epsilon-greedy": EpsilonGreedy, "boltzmann": Boltzmann, "ucb": Ucb}
LEARNERS: dict[str, type[Learner]] = {
    "q-learning": QLearning,
    "sarsa": Sarsa,
    "expected-sarsa": ExpectedSarsa,
    "double-q": DoubleQ,
    "q-lambda": QLambda,
    "sarsa-lambda": SarsaLambda,
    "delayed-q": DelayedQ,
    "r-max": RMax,
    "none": Still,
}
