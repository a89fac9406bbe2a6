"""Environments as gymnasium makes them: their tables of transitions, where they have one, and their episodes, where not."""

from __future__ import annotations

import inspect
import re
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from functools import lru_cache
from typing import TYPE_CHECKING, Any

from qinit_cli.errors import NotAllowed, UsageError

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from qinit_cli.arrays import Flags, Floats

KEPT = 1024  # tasks whose tables are kept in memory: each is asked for several times
ROUNDING = 1e-9  # of chances that were added up or divided
RULE = re.compile(r"reward(>=|<=|>|<)(-?\d+(?:\.\d*)?(?:[eE][+-]?\d+)?)")
PAID_BEST, TERMINATED, SURVIVED = "", "terminated", "survived"

Settings = tuple[tuple[str, Any], ...]


@dataclass(frozen=True, eq=False)
class Table:
    """One task's transitions, O outcomes at most."""

    after: NDArray[np.int32]  # (S, A, O) the next state, stepping.GOAL or stepping.LOST
    chance: Floats  # (S, A, O)
    start: Floats  # (S,)
    open: Flags  # (S,)


def made(env_id: str, settings: Settings) -> Any:
    """The unwrapped environment with constructor arguments and attributes as set; UsageError where that cannot be."""
    try:
        import gymnasium
    except ImportError as error:
        raise UsageError("gym needs the package gymnasium: pip install 'qinit[gym]'") from error
    try:
        spec = gymnasium.spec(env_id)
        creator: Any = spec.entry_point
        kind = creator if callable(creator) else gymnasium.envs.registration.load_env_creator(creator)
        known = _arguments(kind)
        given = {name: value for name, value in settings if name in known}
        _check_flags(env_id, kind, given)
        env = gymnasium.make(env_id, disable_env_checker=True, **given).unwrapped
    except UsageError:
        raise
    except Exception as error:  # of any kind: the environment is somebody else's
        told = " ".join(str(error).split())
        kind_told = "" if isinstance(error, gymnasium.error.Error) else f"{type(error).__name__}: "
        raise UsageError(f"gymnasium cannot make {env_id}: {kind_told}{told}") from error
    for name, value in settings:
        if name not in given:
            _set(env, env_id, name, value, known)
    return env


def _arguments(kind: Callable[..., Any]) -> list[str]:
    """The names of a constructor's arguments."""
    parameters = inspect.signature(kind).parameters.values()
    return [each.name for each in parameters if each.kind in (each.POSITIONAL_OR_KEYWORD, each.KEYWORD_ONLY)]


def _check_flags(env_id: str, kind: Callable[..., Any], given: dict[str, Any]) -> None:
    """UsageError where an argument that is true or false is drawn: any number but 0 would be true."""
    parameters = inspect.signature(kind).parameters
    for name, value in given.items():
        if isinstance(parameters[name].default, bool) and isinstance(value, float):
            raise UsageError(
                f"{name} of {env_id} is True or False, no number: --set {name}=True, or vary another"
            )


def _set(env: Any, env_id: str, name: str, value: Any, known: Iterable[str]) -> None:
    numbers = [
        key for key, old in vars(env).items() if isinstance(old, int | float) and not key.startswith("_")
    ]
    if name not in numbers:
        raise UsageError(
            f"{env_id} has no {name}: its constructor takes {', '.join(known) or 'nothing'}; its numbers are "
            f"{', '.join(numbers) or 'none'}"
        )
    if has_table(env):
        raise UsageError(
            f"{env_id} has made its transitions by the time that {name} could be set; "
            f"what its constructor takes can change: {', '.join(known)}"
        )
    setattr(env, name, value)


def has_table(env: Any) -> bool:
    """Whether all that it does stands in a table."""
    return isinstance(getattr(env, "P", None), dict) and hasattr(env, "initial_state_distrib")


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

    env = made(env_id, settings)
    start: Floats = np.array(env.initial_state_distrib, np.float64)
    ways = env.P
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
        told = ", ".join(f"{name}={value}" for name, value in settings) or "its defaults"
        raise NotAllowed(
            f"{env_id} with {told} has a move whose outcomes have the chances "
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


class Episodes:
    """One task, simulated by gymnasium; every episode is reset with a seed of its own."""

    def __init__(self, env: Any, seen: Callable[[Any], int], goal: str, horizon: int) -> None:
        self._env, self._seen, self._horizon = env, seen, horizon
        self._reached, self._survival = verdict(goal), goal == SURVIVED
        self._time = 0

    def start(self, seed: int) -> int:
        """The table's state in which an episode of this seed begins."""
        self._time = 0
        observation, _ = self._env.reset(seed=seed)
        return self._seen(observation)

    def step(self, action: int) -> int:
        """The state that the action leads to; LOST too where the environment itself cuts the episode off."""
        from qinit_cli.kernels.stepping import GOAL, LOST

        observation, reward, terminated, truncated, _ = self._env.step(action)
        self._time += 1
        if terminated:
            return GOAL if self._reached(float(reward)) else LOST
        if self._survival and self._time == self._horizon:
            return GOAL
        return LOST if truncated else self._seen(observation)
