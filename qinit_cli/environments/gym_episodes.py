"""Episodes that gymnasium plays: step by step for the learner, and twice over to see whether they can be played again."""

from __future__ import annotations

import copy
import math
import operator
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import lru_cache
from typing import TYPE_CHECKING, Any, TypeVar

from qinit_cli.environments.foreign import Improper, aside, fault
from qinit_cli.environments.gym_making import close, has_table, opened
from qinit_cli.environments.gym_recipe import Recipe
from qinit_cli.environments.gym_tables import SURVIVED, verdict
from qinit_cli.errors import NotAllowed

if TYPE_CHECKING:
    from qinit_cli.arrays import Floats

Met = TypeVar("Met")

TRIED_STEPS = 100  # of the episodes that are played twice: some milliseconds of a task
TRIED_RESETS = 20  # beyond them: where an episode starts may be all the randomness there is
KEPT = 65_536  # tasks of which it is remembered that they can be played again


class Episodes:
    """One task, simulated by gymnasium; every episode is reset with a seed of its own. NotAllowed where the environment fails."""

    def __init__(
        self,
        env_id: str,
        env: Any,
        seen: Callable[[Any], int],
        goal: str,
        horizon: int,
        native: bool = False,
    ) -> None:
        self._id, self._env, self._seen, self._horizon = env_id, env, seen, horizon
        from qinit_cli.kernels import worlds

        self._goal, self._lost, self._cut = worlds.GOAL, worlds.LOST, worlds.CUT
        self._step = env.step
        self._reached, self._survival = verdict(goal), goal == SURVIVED
        self._time = 0
        self.paid = 0.0  # the last step's reward, where `native`
        self._native = native

    def start(self, seed: int) -> int:
        """The table's state in which an episode of this seed begins."""
        self._time = 0
        return reset_state(self._id, self._env, seed, self._seen)

    def step(self, action: int) -> int:
        """The state that the action leads to, GOAL, LOST, or CUT less the state in which the environment cuts the episode off."""
        try:
            observation, reward, terminated, truncated, _ = self._step(action)
            self._time += 1
            if self._native:
                self.paid = _finite(reward)
            if terminated:
                return self._goal if self._reached(reward) else self._lost
            if self._survival and self._time == self._horizon:
                return self._goal
            if not truncated:
                return self._seen(observation)
            if self._survival:
                raise NotAllowed(
                    f"{self._id} cut an episode off after {self._time} steps, and --goal survived makes the horizon of "
                    f"{self._horizon} the goal; give --horizon {self._time}"
                )
            return self._cut - self._seen(observation)
        except BaseException as error:
            raise fault(self._id, f"step({action})", error) from error

    def close(self) -> None:
        """Closes the environment."""
        close(self._env, self._id)


@dataclass
class OneAtATime:
    """The episodes of the task that is learned: those of the task before it are closed. Entered while tasks are learned."""

    # of a task's place in the batch and the horizon, and of the continuous state that they write, if there is one
    of: Callable[..., Episodes]
    _now: Episodes | None = None

    def __call__(self, place: int, horizon: int, *state: Floats) -> Episodes:
        """The task's episodes."""
        self._leave()
        self._now = self.of(place, horizon, *state)
        return self._now

    def __enter__(self) -> OneAtATime:
        self._aside = aside()
        self._aside.__enter__()
        return self

    def __exit__(self, kind: type[BaseException] | None, *error: object) -> None:
        try:
            self._leave()
        except NotAllowed:
            if kind is None:  # else what ended the learning is told
                raise
        finally:
            self._aside.__exit__(None, None, None)

    def _leave(self) -> None:
        now, self._now = self._now, None
        if now is not None:
            now.close()


def played(
    world: Episodes, policy: Callable[[int], tuple[Met, int]], horizon: int, episodes: int
) -> list[tuple[list[tuple[Met, int]], bool]]:
    """Of episodes with seeds from 0 on: what the policy notes at each step and its action, and whether the goal was reached."""
    from qinit_cli.kernels.worlds import GOAL

    found = []
    for seed in range(episodes):
        state = world.start(seed)
        trail: list[tuple[Met, int]] = []
        while state >= 0 and len(trail) < horizon:
            trail.append(policy(state))
            state = world.step(trail[-1][1])
        found.append((trail, state == GOAL))
    return found


def reset_state(env_id: str, env: Any, seed: int, seen: Callable[[Any], int]) -> int:
    """The table's state that a reset with this seed leads to; NotAllowed where the environment fails."""
    try:
        observation, _ = env.reset(seed=seed)
        return seen(observation)
    except BaseException as error:
        raise fault(env_id, f"reset(seed={seed})", error) from error


def _finite(reward: Any) -> float:
    """The reward as a number; Improper where it is none, or is not finite."""
    try:
        number = float(reward)
    except (TypeError, ValueError):
        number = math.nan
    if not math.isfinite(number):
        raise Improper(f"the environment gave the reward {reward!r:.80}, which is no finite number")
    return number


def numbered(observation: Any, first: int, states: int) -> int:
    """The row of the table that a numbered observation has; Improper where it is none of them."""
    try:
        number = operator.index(observation) - first
    except TypeError:
        number = -1
    if not 0 <= number < states:  # the compiled loop would write beyond its table
        raise Improper(
            f"the environment observed {observation!r:.80}, which is none of the {states} states that it says it has"
        )
    return number


@lru_cache(KEPT)
def shortest_cut(recipe: Recipe) -> int:
    """Steps after which the environment was first seen to cut an episode off, 0: never, where it is the same made twice.

    It is made twice, and both play the same episodes step by step in turn, so that shared randomness shows too; then the first
    one once more. NotAllowed where their tables, numbers, observations, rewards or ends differ: no seed could bring such a
    task back.
    """
    import numpy as np

    with opened(recipe) as one, opened(recipe) as other:
        both = _Both(recipe, one, other)
        actions = np.random.Generator(np.random.PCG64(0)).integers(int(one.action_space.n), size=TRIED_STEPS)
        seed = time = cut = 0
        begins = True
        for action in actions.tolist():
            if begins:
                both.begin(seed)
                both.expect_alike()
                seed, time = seed + 1, 0
            _, terminated, truncated, _ = both.give(f"step({action})", _step, action)
            time += 1
            begins = bool(terminated or truncated)
            if truncated and not terminated:
                cut = min(cut or time, time)
        for later in range(seed, seed + TRIED_RESETS):
            both.begin(later)
        both.expect_again()
        return cut


@dataclass(frozen=True)
class _Both:
    """An environment that was made twice."""

    recipe: Recipe
    one: Any
    other: Any
    begun: list[int] = field(default_factory=list)  # the seeds of the episodes
    first: list[tuple[str, Callable[[Any, int], Any], int, Any]] = field(
        default_factory=list
    )  # episode's calls

    def begin(self, seed: int) -> Any:
        """What a reset gives in both."""
        self.begun.append(seed)
        return self.give(f"reset(seed={seed})", _reset, seed)

    def give(self, call: str, does: Callable[[Any, int], Any], value: int) -> Any:
        """What a call gives in both; NotAllowed where that differs."""
        try:
            mine, theirs = does(self.one, value), does(self.other, value)
        except BaseException as error:
            raise fault(self.recipe.env_id, call, error) from error
        if not _same(mine, theirs):
            raise self._unlike(f"what {call} gives")
        if len(self.begun) == 1:  # copied, because some environments give the same array again and again
            self.first.append((call, does, value, copy.deepcopy(mine)))
        return mine

    def expect_alike(self) -> None:
        """NotAllowed where their tables or numbers differ after both were reset with one seed."""
        mine, theirs = self.one.unwrapped, self.other.unwrapped
        if has_table(self.one) and not (
            _same(mine.P, theirs.P) and _same(mine.initial_state_distrib, theirs.initial_state_distrib)
        ):
            raise self._unlike("its table P")
        for name, value in getattr(mine, "__dict__", {}).items():
            if _is_number(value) and not _same(value, getattr(theirs, name, None)):
                raise self._unlike(f"its {name}")

    def expect_again(self) -> None:
        """NotAllowed where the first episode is another one after others; its rewards may be, as no state depends on them."""
        self.begun.append(self.begun[0])
        for call, does, value, (*gave, _) in self.first:
            *gives, _ = self.give(call, does, value)
            if not _same(gives, gave):
                raise self._unlike(f"after other episodes, what {call} gives")

    def _unlike(self, difference: str) -> NotAllowed:
        return NotAllowed(
            f"{self.recipe.told} is not the same when it is made and played twice: {difference} "
            "differs; all its randomness must come from reset(seed=...), or what it draws must be given by --set"
        )


def _reset(env: Any, seed: int) -> tuple[Any, None]:
    """What is observed, and no reward."""
    observation, _ = env.reset(seed=seed)
    return observation, None


def _step(env: Any, action: int) -> tuple[Any, Any, Any, Any]:
    """What is observed, whether the episode has ended or is cut off, and the reward."""
    observation, reward, terminated, truncated, _ = env.step(action)
    return observation, terminated, truncated, reward


def _is_number(value: Any) -> bool:
    import numpy as np

    if isinstance(value, np.ndarray | np.generic):
        return value.dtype.kind in "biuf"
    return isinstance(value, int | float)


def _same(one: Any, other: Any) -> bool:
    """Whether two things are equal, through dicts, lists and arrays; what is no number is equal to itself."""
    if isinstance(one, dict):
        return (
            isinstance(other, dict)
            and one.keys() == other.keys()
            and all(_same(one[k], other[k]) for k in one)
        )
    if isinstance(one, list | tuple):
        return isinstance(other, list | tuple) and len(one) == len(other) and all(map(_same, one, other))
    if one is None or isinstance(one, int | float | str):
        return bool(one == other or (one != one and other != other))
    import numpy as np

    mine, theirs = np.asarray(one), np.asarray(other)
    return np.array_equal(mine, theirs, equal_nan=mine.dtype.kind == theirs.dtype.kind == "f")
