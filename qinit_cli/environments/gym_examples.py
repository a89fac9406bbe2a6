"""A few tasks that stand for a whole distribution: whether its tables are believed, and what is varied without effect."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from functools import lru_cache, partial
from typing import Any

from qinit_cli.environments.foreign import fault
from qinit_cli.environments.gym_agreement import disagreement
from qinit_cli.environments.gym_making import opened
from qinit_cli.environments.gym_recipe import KeywordArguments, Recipe
from qinit_cli.environments.gym_tables import End, TransitionTable, table
from qinit_cli.environments.variation import Variation
from qinit_cli.errors import NotAllowed, UsageError
from qinit_cli.rewards import PaidRange

DRAWN = 4  # tasks, with seeds 0 to 3; the first is the example
# steps in which the first must agree with its table, and each of the others: about a tenth of a second in all
STEPS, FEWER_STEPS = 4_000, 1_000
PLAYED = 300  # steps of each task without a table in which what is varied may show


def with_values(recipe: Recipe, drawn: Iterable[tuple[Variation, Any]]) -> Recipe:
    """The recipe, and what was drawn for each variation."""
    values = ((each.name, each.value(value)) for each, value in drawn)
    return recipe.given(KeywordArguments((*recipe.settings, *values)))


@lru_cache(64)
def examples(recipe: Recipe, variations: tuple[Variation, ...]) -> tuple[Recipe, ...]:
    """What some tasks are made with; one of them where nothing is varied."""
    import numpy as np

    drawn: list[Recipe] = []
    for seed in range(DRAWN if variations else 1):
        rng = np.random.Generator(np.random.PCG64(seed))
        try:
            drawn.append(with_values(recipe, [(each, each.draw(rng, seed, "source")) for each in variations]))
        except NotAllowed:  # a file has fewer rows
            if not drawn:
                raise
    return tuple(drawn)


@lru_cache(64)
def doubt(recipe: Recipe, variations: tuple[Variation, ...], goal: str) -> str:
    """Why the tables of these tasks are not believed; empty if they are. NotAllowed where the example's is faulty."""
    first, *others = examples(recipe, variations)
    found = [(first, disagreement(first, goal, STEPS))]
    for other in others:
        found += [(other, why) for why in _if_sound(lambda one: disagreement(one, goal, FEWER_STEPS), other)]
    told = [(one, why) for one, why in found if why]
    if not told:
        return ""
    one, why = told[0]
    return f"the table P of {one.told} is not all that happens: {why}"


def ends(recipe: Recipe, variations: tuple[Variation, ...], goal: str) -> tuple[list[End], list[End]]:
    """The ends of these tasks that are the goal, and the others."""
    tables = [there for one in examples(recipe, variations) for there in _if_sound(_table_of(goal), one)]
    goals = {end for there in tables for end in there.goals}
    return sorted(goals), sorted({end for there in tables for end in there.lost})


@lru_cache(64)
def paid_range(recipe: Recipe, variations: tuple[Variation, ...], goal: str) -> PaidRange:
    """The least and the largest reward in the tables of these tasks; NotAllowed where the example's is faulty."""
    import numpy as np

    first, *others = examples(recipe, variations)
    tables = [table(first, goal, True)]
    for other in others:
        tables += _if_sound(lambda one: table(one, goal, True), other)
    going_on, ending = [0.0], [0.0]
    for there in tables:
        possible = (there.probability > 0) & there.open[:, None, None]
        rewards = np.zeros_like(there.probability) if there.reward is None else there.reward
        going_on += rewards[possible & (there.after >= 0)].tolist()
        ending += rewards[possible & (there.after < 0)].tolist()
    return PaidRange((min(going_on), max(going_on)), (min(ending), max(ending)))


@lru_cache(64)
def idle(
    recipe: Recipe,
    variations: tuple[Variation, ...],
    goal: str | None,
    native: bool = False,
) -> tuple[str, ...]:
    """Names of what is varied and seems to change nothing, by the tables, or by played steps if `goal` is None."""
    first, *_ = examples(recipe, variations)
    alike = _played if goal is None else partial(_bits, native=native)
    found = []
    for each in variations:
        others = [
            first.given(
                KeywordArguments(
                    (name, dict(one.settings)[name] if name == each.name else value)
                    for name, value in first.settings
                )
            )
            for one in examples(recipe, variations)
        ]
        shown = [bits for one in others for bits in _if_sound(lambda one: alike(one, goal or ""), one)]
        if len(shown) > 1 and all(bits == shown[0] for bits in shown):
            found.append(each.name)
    return tuple(found)


def _if_sound(does: Callable[[Recipe], Any], recipe: Recipe) -> Iterator[Any]:
    """What is found of a task; nothing if that fails, which is reported once such a task is drawn."""
    try:
        yield does(recipe)
    except (NotAllowed, UsageError):
        return


def _table_of(goal: str) -> Callable[[Recipe], TransitionTable]:
    return lambda recipe: table(recipe, goal)


def _bits(recipe: Recipe, goal: str, *, native: bool) -> Any:
    """The table, in a form that can be compared."""
    there = table(recipe, goal, native)
    parts: list[Any] = [there.after, there.probability, there.start, there.open]
    parts += [] if there.reward is None else [there.reward]
    return there.after.shape, *(each.tobytes() for each in parts)


def _played(recipe: Recipe, goal: str) -> Any:
    """What PLAYED steps show, whose seeds and actions are fixed."""
    import numpy as np

    with opened(recipe) as env:
        actions = np.random.Generator(np.random.PCG64(0)).integers(int(env.action_space.n), size=PLAYED)
        shown: list[str] = []
        seed, begins = 0, True
        for action in actions.tolist():
            call = f"reset(seed={seed})"
            try:
                if begins:
                    shown.append(repr(np.asarray(env.reset(seed=seed)[0]).tolist()))
                    seed += 1
                call = f"step({action})"
                observed, reward, terminated, truncated, _ = env.step(action)
            except BaseException as error:
                raise fault(recipe.env_id, call, error) from error
            shown.append(repr((np.asarray(observed).tolist(), float(reward), terminated, truncated)))
            begins = bool(terminated or truncated)
    return shown
