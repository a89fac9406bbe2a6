"""The tables of transitions that gymnasium's environments have."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import TYPE_CHECKING, Any

from qinit_cli.environments.foreign import Improper
from qinit_cli.environments.gym_making import opened
from qinit_cli.environments.gym_recipe import Recipe
from qinit_cli.environments.gym_transitions import Transitions, transitions
from qinit_cli.errors import NotAllowed, UsageError

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from qinit_cli.arrays import Flags, Floats

KEPT = 1024  # tasks whose tables are kept in memory: each is asked for several times
KEPT_UNREAD = 16  # tasks whose P is kept as it was read, which takes far more
TOLD = 8  # states or rewards that a sentence names
RULE = re.compile(r"reward(>=|<=|>|<)(-?\d+(?:\.\d*)?(?:[eE][+-]?\d+)?)")
PAID_BEST, TERMINATED, SURVIVED = "", "terminated", "survived"

End = tuple[float, int]  # the reward, and the state in which the episode ends


@dataclass(frozen=True, eq=False)
class TransitionTable:
    """One task's transitions, O outcomes at most."""

    after: NDArray[np.int32]  # (S, A, O) the next state, stepping.GOAL or stepping.LOST
    probability: Floats  # (S, A, O)
    start: Floats  # (S,)
    open: Flags  # (S,)
    goals: frozenset[End]  # ends that are the goal ...
    lost: frozenset[End]  # ... and those that are not
    reward: Floats | None = None  # (S, A, O) the environment's own, where outcomes are kept apart by it


def verdict(goal: str) -> Callable[[Any], bool]:
    """Whether an episode that the environment ends with such a reward has reached the goal; UsageError for no rule.

    What is given back raises Improper for a reward that is not a number, where the rule asks for it.
    """
    if goal == TERMINATED:
        return lambda reward: True
    if goal == SURVIVED:
        return lambda reward: False
    rule = RULE.fullmatch(goal.replace(" ", ""))
    if rule is None:
        raise UsageError(f"--goal {goal}: it is terminated, survived, or a rule such as reward>0")
    limit = float(rule[2])
    compare = {">": float.__gt__, ">=": float.__ge__, "<": float.__lt__, "<=": float.__le__}[rule[1]]

    def reached(reward: Any) -> bool:
        if math.isnan(number := float(reward)):
            raise Improper(
                "the environment ended an episode with the reward nan, which no rule on the reward can judge"
            )
        return compare(number, limit)

    return reached


@lru_cache(KEPT)
def table(recipe: Recipe, goal: str, native: bool = False) -> TransitionTable:
    """The task's table, with its rewards if `native`; NotAllowed where it is faulty, or no end of it is the goal."""
    import numpy as np

    from qinit_cli.kernels.worlds import GOAL, LOST

    there = read(recipe)
    open = _open(there)
    ends = {(way[2], way[1]) for state, _, way in there if open[state] and way[3]}
    rewards = {reward for reward, _ in ends}
    best = max(rewards, default=0.0)
    reached = verdict(goal) if goal else lambda reward: reward == best
    if not any(map(reached, rewards)):
        told = f"its episodes end with {named('reward', sorted(rewards))}" if ends else "it never ends"
        raise NotAllowed(f"no end of {recipe} is the goal{f' by --goal {goal}' if goal else ''}: {told}")
    merged: list[dict[End, float]] = []  # by the reward, 0 unless native, and where they lead
    for ways in (ways for actions in there.ways for ways in actions):
        outcomes: dict[End, float] = {}
        for odds, after_it, reward, done in ways:
            end = (GOAL if reached(reward) else LOST) if done else after_it
            kept = (reward if native else 0.0, end)
            outcomes[kept] = outcomes.get(kept, 0.0) + odds
        merged.append(outcomes)
    most = max(map(len, merged))
    after, probability = np.full((len(merged), most), LOST, np.int32), np.zeros((len(merged), most))
    rewards_of = np.zeros_like(probability)
    for place, outcomes in enumerate(merged):
        after[place, : len(outcomes)] = [end for _, end in outcomes]
        rewards_of[place, : len(outcomes)] = [reward for reward, _ in outcomes]
        probability[place, : len(outcomes)] = np.array(list(outcomes.values())) / sum(outcomes.values())
    shape = (len(there.ways), len(there.ways[0]), most)
    goals = frozenset(end for end in ends if reached(end[0]))
    return TransitionTable(
        after.reshape(shape),
        probability.reshape(shape),
        there.start,
        open,
        goals,
        frozenset(ends) - goals,
        rewards_of.reshape(shape) if native else None,
    )


@lru_cache(KEPT_UNREAD)
def read(recipe: Recipe) -> Transitions:
    """What the environment's own table says; NotAllowed where it is faulty."""
    with opened(recipe) as env:
        return transitions(recipe, env)


def named(noun: str, numbers: Sequence[float]) -> str:
    """The numbers behind their noun, the first TOLD of them: reward 1; states 5, 7, 11."""
    said, more = [f"{number:g}" for number in numbers[:TOLD]], len(numbers) - TOLD
    return f"{noun}{'s' if numbers[1:] else ''} {', '.join(said)}{f' and {more} more' if more > 0 else ''}"


def _open(there: Transitions) -> Flags:
    """Where episodes go on, (S,): not where they only ever come to end."""
    import numpy as np

    ended, entered = np.zeros(len(there.start), bool), there.start > 0
    for state, _, (_, after, _, done) in there:
        if done:
            ended[after] = True
        elif after != state:
            entered[after] = True
    open: Flags = ~ended | entered
    return open
