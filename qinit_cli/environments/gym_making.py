"""Environments as gymnasium makes them, with all that stands around them, and with arguments and attributes as set."""

from __future__ import annotations

import copy
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress
from typing import Any

from qinit_cli.environments.foreign import aside, calling, ends_our_work, told
from qinit_cli.environments.gym_arguments import arguments, check_arguments, check_kind, takes_others
from qinit_cli.environments.gym_recipe import KeywordArguments, Recipe
from qinit_cli.environments.modules import factory, registered_id
from qinit_cli.errors import UsageError

# wrappers that change nothing of what happens before an episode is cut off
TRANSPARENT = {
    "HumanRendering",
    "OrderEnforcing",
    "PassiveEnvChecker",
    "RecordEpisodeStatistics",
    "RecordVideo",
    "RenderCollection",
    "TimeLimit",
}


@contextmanager
def opened(recipe: Recipe) -> Iterator[Any]:
    """The environment, closed behind whoever uses it; what it prints goes to stderr, and what it raises bears its name."""
    with aside():
        env = made(recipe)
        try:
            yield env
        except BaseException:
            with suppress(Exception):  # what ended the work before it is told
                env.close()
            raise
        close(env, recipe.env_id)


def close(env: Any, env_id: str) -> None:
    """Closes it; NotAllowed where it raises."""
    with calling(env_id, "close()"):
        env.close()


def made(recipe: Recipe) -> Any:
    """The environment that gymnasium makes, constructor arguments and attributes as set; UsageError where that cannot be."""
    try:
        with aside():  # its plug-ins are imported with it
            import gymnasium
    except ImportError as error:
        raise UsageError(
            "gym needs the package gymnasium: in your clone of qinit, pip install -e '.[gym]'"
        ) from error
    env_id = recipe.env_id
    bare = registered_id(env_id)
    with aside():
        try:
            env, known, left = _constructed(env_id, bare, recipe.settings)
        except gymnasium.error.UnregisteredEnv as error:
            hint = "" if ":" in env_id else f" (one of your own is named as MODULE:{env_id})"
            raise UsageError(f"gymnasium cannot make {env_id}: {_plain(error)}{hint}") from error
        except gymnasium.error.Error as error:
            raise UsageError(f"gymnasium cannot make {env_id}: {_plain(error)}") from error
        except BaseException as error:  # of any kind: the environment is somebody else's
            if ends_our_work(error):
                raise
            raise UsageError(f"gymnasium cannot make {env_id}: {told(error)}") from error
        try:
            for name, value in left.items():
                with calling(env_id, f"setting {name}={value!r}"):
                    _set(env, env_id, name, copy.deepcopy(value), known)
            env = _surrounded(env, recipe)
        except BaseException:
            with suppress(Exception):  # what ended the work before it is told
                env.close()
            raise
    return env


def takes(env_id: str, name: str) -> bool:
    """Whether the environment's constructor is known to take an argument of this name."""
    with aside():
        import gymnasium

        try:
            return name in arguments(_constructor(registered_id(env_id)))
        except gymnasium.error.Error:  # there is no such environment, which making it reports
            return False


def _constructor(bare: str) -> Any:
    import gymnasium

    creator: Any = gymnasium.spec(bare).entry_point
    return creator if callable(creator) else gymnasium.envs.registration.load_env_creator(creator)


def _surrounded(env: Any, recipe: Recipe) -> Any:
    """The environment with what is put around it."""
    import gymnasium

    from qinit_cli.environments.gym_leaves import is_numbered
    from qinit_cli.environments.gym_wrappers import AttributeState, NumberedActions

    for wrap in recipe.wraps:
        around = factory(wrap)
        with calling(recipe.env_id, f"--wrap {wrap}"):
            env = around(env)
        if not isinstance(env, gymnasium.Env):
            raise UsageError(f"--wrap {wrap} gives {env!r:.80}, which is no environment")
    if recipe.state:
        env = AttributeState(env, recipe.env_id, recipe.state)
    actions = env.action_space
    plain = type(actions).__name__ == "Discrete" and actions.start == 0
    return env if plain or not is_numbered(actions) else NumberedActions(env)


def _constructed(env_id: str, bare: str, settings: KeywordArguments) -> tuple[Any, list[str], dict[str, Any]]:
    """The environment, the names that its constructor is known to take, and the settings that it was not given."""
    import gymnasium

    kind = _constructor(bare)
    known = arguments(kind)
    given = {name: value for name, value in settings if name in known}
    left = {name: value for name, value in settings if name not in known}
    check_arguments(env_id, kind, known, given)
    env = gymnasium.make(bare, disable_env_checker=True, **copy.deepcopy(given))
    there = {*numbers(env.unwrapped), *(name for each in wrappers(env) for name in vars(each))}
    handed = {name: value for name, value in left.items() if name not in there}
    if not (handed and takes_others(kind)):
        return env, list(known), left
    env.close()
    env = gymnasium.make(bare, disable_env_checker=True, **copy.deepcopy(given | handed))
    return env, list(known), {name: value for name, value in left.items() if name not in handed}


def wrappers(env: Any) -> Iterator[Any]:
    """What stands around the environment, from the outside in."""
    import gymnasium

    while isinstance(env, gymnasium.Wrapper):
        yield env
        env = env.env


def time_limit(env: Any) -> int:
    """Steps after which gymnasium's own wrapper cuts an episode off; 0: never."""
    import gymnasium

    limits = [
        int(each._max_episode_steps)
        for each in wrappers(env)
        if isinstance(each, gymnasium.wrappers.TimeLimit)
    ]
    return min(limits, default=0)


def has_table(env: Any) -> bool:
    """Whether all that it does stands in a table: nothing around it changes what the table says."""
    return _owns_table(env.unwrapped) and all(_is_transparent(each) for each in wrappers(env))


def numbers(env: Any) -> dict[str, Any]:
    """The numbers of an unwrapped environment that can be set, its classes' among them, by name."""
    import gymnasium

    found: dict[str, Any] = {}
    for kind in reversed(type(env).__mro__):
        if kind is not object and kind is not gymnasium.Env:
            found |= vars(kind)
    for name, there in list(found.items()):
        if isinstance(there, property):
            found[name] = getattr(env, name, None) if there.fset is not None else None
    found |= getattr(env, "__dict__", {})
    return {
        name: value
        for name, value in found.items()
        if isinstance(value, int | float) and not name.startswith("_")
    }


def _is_transparent(wrapper: Any) -> bool:
    import gymnasium

    return any(type(wrapper) is getattr(gymnasium.wrappers, name, None) for name in TRANSPARENT)


def _owns_table(bare: Any) -> bool:
    return isinstance(getattr(bare, "P", None), dict | list | tuple) and hasattr(
        bare, "initial_state_distrib"
    )


def _plain(error: BaseException) -> str:
    return " ".join(str(error).split())


def _set(env: Any, env_id: str, name: str, value: Any, known: Iterable[str]) -> None:
    bare = env.unwrapped
    there = numbers(bare)
    if name not in there:
        raise UsageError(_no_such(env, env_id, name, known, there))
    if _owns_table(bare):
        raise UsageError(
            f"{env_id} has made its transitions by the time that {name} could be set; "
            f"what its constructor takes can change: {', '.join(known)}"
        )
    check_kind(env_id, name, value, there[name])
    setattr(bare, name, value)


def _no_such(env: Any, env_id: str, name: str, known: Iterable[str], there: dict[str, Any]) -> str:
    takes = (
        f"its constructor takes {', '.join(known) or 'nothing'}; its numbers are {', '.join(there) or 'none'}"
    )
    if isinstance(getattr(type(env.unwrapped), name, None), property):
        return f"{name} of {env_id} is computed and cannot be set: {takes}"
    if hasattr(env.unwrapped, name):
        return f"{name} of {env_id} is no number, and of its attributes only numbers can be set: {takes}"
    for each in wrappers(env):
        if name in vars(each):
            return (
                f"{name} belongs to {type(each).__name__}, which stands around {env_id}; only numbers of the "
                f"environment itself can be set: {takes}"
            )
    return f"{env_id} has no {name}: {takes}"
