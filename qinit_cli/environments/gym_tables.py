"""The tables of transitions that gymnasium's environments have."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache
from typing import TYPE_CHECKING, Any

from qinit_cli.environments.gym_making import Settings, opened
from qinit_cli.errors import NotAllowed, UsageError

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from qinit_cli.arrays import Flags, Floats

KEPT = 1024  # tasks whose tables are kept in memory: each is asked for several times
ROUNDING = 1e-9  # of chances that were added up or divided
RULE = re.compile(r"reward(>=|<=|>|<)(-?\d+(?:\.\d*)?(?:[eE][+-]?\d+)?)")
PAID_BEST, TERMINATED, SURVIVED = "", "terminated", "survived"


@dataclass(frozen=True, eq=False)
class Table:
    """One task's transitions, O outcomes at most."""

    after: NDArray[np.int32]  # (S, A, O) the next state, stepping.GOAL or stepping.LOST
    chance: Floats  # (S, A, O)
    start: Floats  # (S,)
    open: Flags  # (S,)


def verdict(goal: str) -> Callable[[float], bool]:
    """Whether an episode that the environment ends with such a reward has reached the goal; UsageError for no rule."""
    if goal == TERMINATED:
        return lambda reward: True
    if goal == SURVIVED:
        return lambda reward: False
    rule = RULE.fullmatch(goal.replace(" ", ""))
    if rule is None:
        raise UsageError(f"--goal {goal}: it is terminated, survived, or a rule such as reward>0")
    limit = float(rule[2])
    compare = {">": float.__gt__, ">=": float.__ge__, "<": float.__lt__, "<=": float.__le__}[rule[1]]
    return lambda reward: compare(float(reward), limit)


@lru_cache(KEPT)
def table(env_id: str, settings: Settings, goal: str) -> Table:
    """The task's table; NotAllowed where no end of it is the goal."""
    import numpy as np

    from qinit_cli.kernels.stepping import GOAL, LOST

    with opened(env_id, settings) as env:
        start: Floats = np.array(env.unwrapped.initial_state_distrib, np.float64)
        ways = env.unwrapped.P
    states, actions = len(ways), len(ways[0])
    open = _open(ways, start)
    ends = [
        float(reward)
        for state in np.flatnonzero(open)
        for outcomes in ways[int(state)].values()
        for chance, _, reward, done in outcomes
        if done and chance > 0
    ]
    best = max(ends, default=0.0)
    reached = verdict(goal) if goal else lambda reward: reward == best
    if not any(map(reached, ends)):
        told = f"its episodes end with rewards {', '.join(f'{end:g}' for end in sorted(set(ends)))}"
        raise NotAllowed(
            f"no end of {env_id} is the goal by --goal {goal}: {told if ends else 'it never ends'}"
        )
    merged: list[dict[int, float]] = []
    for state in range(states):
        for action in range(actions):
            outcomes: dict[int, float] = {}
            _check_chances(env_id, settings, [float(way[0]) for way in ways[state][action]])
            for odds, there, reward, done in ways[state][action]:
                end = (GOAL if reached(float(reward)) else LOST) if done else int(there)
                outcomes[end] = outcomes.get(end, 0.0) + float(odds)
            merged.append({end: odds for end, odds in outcomes.items() if odds > 0})
    most = max(map(len, merged))
    after, chance = np.full((len(merged), most), LOST, np.int32), np.zeros((len(merged), most))
    for place, outcomes in enumerate(merged):
        after[place, : len(outcomes)] = list(outcomes)
        chance[place, : len(outcomes)] = np.array(list(outcomes.values())) / sum(outcomes.values())
    shape = (states, actions, most)
    return Table(after.reshape(shape), chance.reshape(shape), start / start.sum(), open)


def _check_chances(env_id: str, settings: Settings, chances: list[float]) -> None:
    """NotAllowed where the chances of an action's outcomes are none: a constructor may take any number for one."""
    if min(chances) < -ROUNDING or abs(sum(chances) - 1) > ROUNDING:
        raise NotAllowed(
            f"{env_id} with {settings.told} has a move whose outcomes have the chances "
            f"{', '.join(f'{chance:g}' for chance in chances)}: they must be within 0 and 1, and sum to 1"
        )


def _open(ways: Any, start: Floats) -> Flags:
    """Where episodes go on, (S,): not where they only ever come to end."""
    import numpy as np

    ended, entered = np.zeros(len(start), bool), start > 0
    for state, actions in ways.items():
        for outcomes in actions.values():
            for chance, there, _, done in outcomes:
                if chance > 0 and done:
                    ended[there] = True
                elif chance > 0 and there != state:
                    entered[there] = True
    open: Flags = ~ended | entered
    return open
