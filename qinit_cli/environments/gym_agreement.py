"""Whether an environment steps as its table P has it: what happens beside P would never be learned.

An example is Taxi's fickle passenger: the first move with him aboard may change his destination, which is not in P. So a
table is believed once sampled steps agree with it. Every transition seen must have a probability in P, and what has one must come
about as often.
"""

from __future__ import annotations

import math
from collections import Counter, defaultdict
from dataclasses import dataclass, field
from functools import lru_cache
from typing import TYPE_CHECKING, Any

from qinit_cli.environments.foreign import fault
from qinit_cli.environments.gym_episodes import numbered, reset_state
from qinit_cli.environments.gym_making import opened
from qinit_cli.environments.gym_recipe import Recipe
from qinit_cli.environments.gym_tables import TransitionTable, read, table

if TYPE_CHECKING:
    import numpy as np

    from qinit_cli.arrays import Integers

# in turn: wide, along ways to the goal, and short, so that there are many first moves
LONGEST = {"wide": 100, "to the goal": 200, "short": 5}
SWEEPS = 200  # of value iteration, for the ways to the goal
# -ln of the probability that a sound table is doubted by one count, of some ten thousand that are looked at
DOUBT = 32.0
REWARD = 1e-6  # by which a reward may differ: single precision


@lru_cache(64)
def disagreement(recipe: Recipe, goal: str, steps: int) -> str:
    """The first of so many sampled steps that disagrees with the table, in words; empty if all agree.

    Seeds and actions are fixed, so that the answer is the same every time.
    """
    sampled = _Sampled(table(recipe, goal), _likelihoods(recipe))
    with opened(recipe) as env:
        return _seen_otherwise(recipe.env_id, env, sampled, steps) or sampled.unlikely()


Outcome = tuple[int, bool, float]  # the next state, whether the episode ends, and the reward


@dataclass
class _Sampled:
    """What was seen so far, beside what the table says."""

    table: TransitionTable
    said: list[list[dict[Outcome, float]]]  # of each state and action, the probability of each outcome
    tried: Counter[tuple[int, int]] = field(default_factory=Counter)
    came: defaultdict[tuple[int, int], Counter[Outcome]] = field(default_factory=lambda: defaultdict(Counter))
    started: Counter[int] = field(default_factory=Counter)

    def start(self, state: int) -> str:
        """Counts a start; what is wrong with it."""
        self.started[state] += 1
        return (
            ""
            if self.table.start[state] > 0
            else f"an episode started in state {state}, whose probability to be a start is 0"
        )

    def step(self, state: int, action: int, outcome: Outcome) -> str:
        """Counts a step; what is wrong with it."""
        there, end, reward = outcome
        self.tried[state, action] += 1
        if outcome in self.said[state][action]:
            self.came[state, action][outcome] += 1
            return ""
        for said in self.said[state][action]:
            if said[:2] == (there, end) and math.isclose(said[2], reward, rel_tol=REWARD, abs_tol=REWARD):
                self.came[state, action][said] += 1
                return ""
        ended = " and ended the episode" if end else ""
        return f"action {action} in state {state} led to state {there} with reward {reward:g}{ended}, of probability 0 in P"

    def unlikely(self) -> str:
        """What came far more or less often than it should; empty if nothing."""
        starts = sum(self.started.values())
        for state, probability in enumerate(self.table.start.tolist()):
            if _doubted(self.started[state], starts, probability):
                return f"{self.started[state]} of {starts} episodes started in state {state}, with probability {probability:.3g}"
        alike: defaultdict[tuple[float, ...], Counter[float]] = defaultdict(Counter)
        for (state, action), tried in self.tried.items():
            said, came = self.said[state][action], self.came[state, action]
            for outcome, probability in said.items():
                if _doubted(came[outcome], tried, probability):
                    return (
                        f"action {action} in state {state} led to state {outcome[0]} {came[outcome]} times of {tried}, "
                        f"whose probability in P is {probability:.3g}"
                    )
                alike[tuple(sorted(said.values()))][probability] += came[outcome]
        for (
            probabilities,
            times,
        ) in alike.items():  # of all states and actions whose outcomes have the same probabilities
            for probability, count in times.items():
                whole = probability * probabilities.count(probability)
                if _doubted(count, times.total(), whole):
                    return f"outcomes of probability {whole:.3g} in P came {count} times of {times.total()}"
        return ""


def _doubted(count: int, tried: int, probability: float) -> bool:
    """Whether so many of the tries are next to impossible at that probability: Chernoff's bound on either tail."""
    share = count / tried if tried else probability
    probability = min(max(probability, 1e-15), 1 - 1e-15)
    bound = sum(p * math.log(p / q) for p, q in ((share, probability), (1 - share, 1 - probability)) if p > 0)
    return tried * bound > DOUBT


def _likelihoods(recipe: Recipe) -> list[list[dict[Outcome, float]]]:
    there = read(recipe)
    said: list[list[dict[Outcome, float]]] = [[{} for _ in actions] for actions in there.ways]
    for state, action, (probability, after, reward, end) in there:
        outcome = (after, end, reward)
        said[state][action][outcome] = said[state][action].get(outcome, 0.0) + probability
    return said


def _seen_otherwise(env_id: str, env: Any, sampled: _Sampled, steps: int) -> str:
    """Plays so many steps; the first that is not in the table, in words."""
    import numpy as np

    states, actions = sampled.table.after.shape[:2]
    best = _ways_to_the_goal(sampled.table)
    ties = np.random.Generator(np.random.PCG64(0)).permuted(np.tile(np.arange(actions), (states, 1)), axis=1)
    seed = 0
    while steps > 0:
        kind = list(LONGEST)[seed % len(LONGEST)]
        state = reset_state(env_id, env, seed, lambda observed: numbered(observed, 0, states))
        if wrong := sampled.start(state):
            return wrong
        for _ in range(min(LONGEST[kind], steps)):
            steps -= 1
            action = int(best[state]) if kind == "to the goal" else _least_tried(sampled, state, ties[state])
            outcome, cut = _step(env_id, env, action, states)
            if wrong := sampled.step(state, action, outcome):
                return wrong
            state = outcome[0]
            if cut or outcome[1]:
                break
        seed += 1
    return ""


def _step(env_id: str, env: Any, action: int, states: int) -> tuple[Outcome, bool]:
    try:
        observed, reward, terminated, truncated, _ = env.step(action)
        return (numbered(observed, 0, states), bool(terminated), float(reward)), bool(truncated)
    except BaseException as error:
        raise fault(env_id, f"step({action})", error) from error


def _least_tried(sampled: _Sampled, state: int, ties: np.ndarray[Any, Any]) -> int:
    actions: list[int] = ties.tolist()
    return min(actions, key=lambda action: sampled.tried[state, action])


def _ways_to_the_goal(there: TransitionTable) -> Integers:
    """The action of each state that most likely leads to the goal soon, (S,)."""
    import numpy as np

    from qinit_cli.kernels.worlds import GOAL

    value = np.zeros(len(there.after))
    for _ in range(SWEEPS):
        worth = np.where(there.after >= 0, 0.95 * value[there.after], there.after == GOAL)
        q = (there.probability * worth).sum(axis=2)
        value = np.where(there.open, q.max(axis=1), 0.0)
    best: Integers = q.argmax(axis=1)
    return best
