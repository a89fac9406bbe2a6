"""The table of transitions that an environment brings, read so that nothing faulty in it passes.

P is somebody else's: a next state of -1 would be read as our goal, a probability that is not a number would be worth nothing.
"""

from __future__ import annotations

import math
import operator
from collections.abc import Iterator
from dataclasses import dataclass
from numbers import Real
from typing import TYPE_CHECKING, Any

from qinit_cli.environments.gym_recipe import Recipe
from qinit_cli.errors import NotAllowed

if TYPE_CHECKING:
    from qinit_cli.arrays import Floats

ROUNDING = 1e-6  # of probabilities that were added up or divided, in single precision too
ENTRIES = ("probability", "next state", "reward", "end")

Way = tuple[
    float, int, float, bool
]  # a probability above 0, the next state, the reward, and whether the episode ends there


@dataclass(frozen=True)
class Transitions:
    """What P and initial_state_distrib of an environment say."""

    ways: list[list[list[Way]]]  # of each state and action
    start: Floats  # (S,)

    def __iter__(self) -> Iterator[tuple[int, int, Way]]:
        """Every way, with its state and action."""
        for state, actions in enumerate(self.ways):
            for action, ways in enumerate(actions):
                for way in ways:
                    yield state, action, way


class Faulty(ValueError):
    """What is wrong with a table, and where."""


def transitions(recipe: Recipe, env: Any) -> Transitions:
    """The environment's table; NotAllowed, with the state and the action, where it is none for the spaces it has."""
    states, actions = int(env.observation_space.n), int(env.action_space.n)
    bare = env.unwrapped
    try:
        ways = [
            [_ways(f"action {action} in state {state}", there, states) for action, there in enumerate(row)]
            for state, row in enumerate(_rows(bare.P, states, actions))
        ]
        return Transitions(ways, _start(bare.initial_state_distrib, states))
    except Faulty as fault:
        raise NotAllowed(f"the table P of {recipe.told} cannot be learned: {fault}") from fault


def _rows(table: Any, states: int, actions: int) -> list[list[Any]]:
    """The outcomes of each state and action, unread."""
    rows = _numbered(table, states, "state", "it")
    return [_numbered(row, actions, "action", f"state {state}") for state, row in enumerate(rows)]


def _numbered(there: Any, count: int, noun: str, where: str) -> list[Any]:
    """The entries numbered 0 to `count` - 1 of a dict or a list."""
    if isinstance(there, list | tuple):
        there = dict(enumerate(there))
    if not isinstance(there, dict):
        raise Faulty(f"{where} is a {type(there).__name__}, which has no {noun}s")
    lacking = next((number for number in range(count) if number not in there), None)
    if lacking is not None:
        raise Faulty(f"{where} has no {noun} {lacking}, of {count} {noun}s")
    if len(there) > count:
        beyond = next(key for key in there if key not in range(count))
        raise Faulty(f"{where} has {noun} {beyond!r}, which is none of its {count} {noun}s")
    return [there[number] for number in range(count)]


def _ways(where: str, outcomes: Any, states: int) -> list[Way]:
    """The outcomes of a probability above 0."""
    if not isinstance(outcomes, list | tuple) or not outcomes:
        raise Faulty(f"{where} has no outcomes")
    for outcome in outcomes:
        if not isinstance(outcome, list | tuple) or len(outcome) != len(ENTRIES):
            raise Faulty(f"{where} has the outcome {_told(outcome)}, which is not ({', '.join(ENTRIES)})")
        if not isinstance(outcome[0], Real):
            raise Faulty(f"{where} has an outcome of probability {_told(outcome[0])}, which is no number")
    probabilities = [float(outcome[0]) for outcome in outcomes]
    # not (a and b): what is not a number fits no bound
    if not (
        min(probabilities) >= -ROUNDING
        and max(probabilities) <= 1 + ROUNDING
        and abs(sum(probabilities) - 1) <= ROUNDING
    ):
        raise Faulty(
            f"for {where} the outcomes have the probabilities {', '.join(f'{p:g}' for p in probabilities)}, "
            f"{sum(probabilities):g} in sum: they must be within 0 and 1, and sum to 1"
        )
    return [_way(where, outcome, states) for outcome in outcomes if outcome[0] > 0]


def _way(where: str, outcome: Any, states: int) -> Way:
    probability, there, reward, end = outcome
    try:
        state = operator.index(there)
    except TypeError:
        state = -1
    if not 0 <= state < states:
        raise Faulty(f"{where} leads to {_told(there)}, which is none of the {states} states")
    if not isinstance(reward, Real) or not math.isfinite(reward):
        raise Faulty(f"{where} has the reward {_told(reward)}, which is no finite number")
    if end not in (True, False):
        raise Faulty(f"{where} has the end {_told(end)}, which is neither True nor False")
    return float(probability), state, float(reward), bool(end)


def _start(given: Any, states: int) -> Floats:
    """How likely episodes start in each state, (S,), 1 in sum."""
    import numpy as np

    try:
        start: Floats = np.array(given, np.float64)
    except (TypeError, ValueError):
        raise Faulty(f"its initial_state_distrib is {_told(given)}, which are no numbers") from None
    if start.shape != (states,):
        raise Faulty(f"its initial_state_distrib has the shape {start.shape}, of {states} states")
    improper = ~((start >= 0) & (start <= 1 + ROUNDING))  # NaN is neither
    if improper.any():
        state = int(improper.argmax())
        raise Faulty(
            f"state {state} is where episodes start with probability {start[state]:g}, which is not within 0 and 1"
        )
    if abs(start.sum() - 1) > ROUNDING:
        raise Faulty(f"the probabilities of where episodes start sum to {start.sum():g}, not 1")
    start /= start.sum()
    return start


def _told(value: Any) -> str:
    return f"{value!r:.80}"
