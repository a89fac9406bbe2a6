"""The arguments of an environment's constructor, and whether a value is of the kind of an argument's or attribute's default.

Python checks neither: any text but the empty one is true, and a rate of 'abc' is a TypeError of the environment later on.
"""

from __future__ import annotations

import inspect
import re
from collections.abc import Callable
from typing import Any

from qinit_cli.errors import UsageError

LETTERS = "SFHG"  # of a FrozenLake map: start, frozen, hole, goal
KINDS = {
    "bool": False,
    "int": 0,
    "float": 0.0,
    "str": "",
    "list": [],
    "tuple": (),
}  # as annotations name them


def arguments(kind: Callable[..., Any]) -> dict[str, inspect.Parameter]:
    """A constructor's arguments; of one that hands others on, also those of the classes it is made from."""
    found: dict[str, inspect.Parameter] = {}
    for parameters in _signatures(kind):
        named = [one for one in parameters if one.kind in (one.POSITIONAL_OR_KEYWORD, one.KEYWORD_ONLY)]
        found = {one.name: one for one in named} | found
    return found


def takes_others(kind: Callable[..., Any]) -> bool:
    """Whether a constructor takes arguments of any name."""
    return any(one.kind is one.VAR_KEYWORD for one in _signatures(kind)[-1])


def _signatures(kind: Callable[..., Any]) -> list[list[inspect.Parameter]]:
    """The parameters of a constructor and, while each hands others on, of those of the classes it is made from."""
    classes = (
        [each for each in kind.__mro__ if "__init__" in vars(each)] if isinstance(kind, type) else [kind]
    )
    found: list[list[inspect.Parameter]] = []
    for each in classes:
        found.append(list(inspect.signature(each).parameters.values()))
        if not any(one.kind is one.VAR_KEYWORD for one in found[-1]):
            break
    return found


def check_arguments(
    env_id: str, kind: Callable[..., Any], known: dict[str, inspect.Parameter], given: dict[str, Any]
) -> None:
    """UsageError, one sentence, where a value is of another kind than its argument, or no map of FrozenLake."""
    for name, value in given.items():
        if name == "desc" and _is_frozen_lake(kind):
            _check_map(env_id, value)
        else:
            check_kind(env_id, name, value, _usual(known[name]))


def check_kind(env_id: str, name: str, value: Any, usual: Any) -> None:
    """UsageError where a value is of another kind than the `usual` one; None is of every kind, and of None all are."""
    if value is None or usual is None:
        return
    such = f"{name} of {env_id} is"
    if isinstance(usual, bool):
        if _is_number(value):
            raise UsageError(f"{such} True or False, no number: --set {name}=True, or vary another")
        if not isinstance(value, bool):
            raise UsageError(f"{such} True or False, and {value!r:.80} is neither: --set {name}=True")
    elif _is_number(usual):
        if not _is_number(value):
            raise UsageError(f"{such} a number, such as {usual!r:.40}, and {value!r:.80} is none")
    elif isinstance(usual, str):
        if not isinstance(value, str):
            raise UsageError(f"{such} text, such as {usual!r:.40}, and {value!r:.80} is none")
    elif isinstance(usual, list | tuple) and not isinstance(value, list | tuple):
        raise UsageError(f"{such} a list, such as {usual!r:.40}, and {value!r:.80} is none")


def _is_number(value: Any) -> bool:
    import numpy as np

    return isinstance(value, int | float | np.integer | np.floating) and not isinstance(value, bool)


def _usual(parameter: inspect.Parameter) -> Any:
    """The default of an argument, or an example of the kind that it is annotated with; None if that is unknown."""
    if parameter.default is not parameter.empty and parameter.default is not None:
        return parameter.default
    annotation = parameter.annotation
    told = annotation.__name__ if isinstance(annotation, type) else str(annotation)
    words = set(re.findall(r"[A-Za-z_]\w*", re.sub(r"\[.*\]", "", told))) - {
        "None",
        "Optional",
        "Union",
        "typing",
    }
    if words == {"int", "float"}:
        words = {"float"}
    return KINDS.get(words.pop()) if len(words) == 1 else None


def _is_frozen_lake(kind: Callable[..., Any]) -> bool:
    from gymnasium.envs.toy_text.frozen_lake import FrozenLakeEnv

    return isinstance(kind, type) and issubclass(kind, FrozenLakeEnv)


def _check_map(env_id: str, rows: Any) -> None:
    """UsageError where these are no rows of a map: ragged ones are filled up with holes, odd letters are frozen."""
    if rows is None:
        return
    if (
        not isinstance(rows, list | tuple)
        or not rows
        or not all(isinstance(row, str | list | tuple) for row in rows)
    ):
        raise UsageError(
            f'desc of {env_id} is a list of rows, such as ["SF", "HG"], and {rows!r:.80} is none'
        )
    for place, row in enumerate(rows):
        odd = next(
            (letter for letter in row if not isinstance(letter, str) or letter not in tuple(LETTERS)), None
        )
        if odd is not None:
            raise UsageError(
                f"row {place} of desc of {env_id} has {odd!r:.40}; a map has the letters S (start), F (frozen), H (hole) "
                "and G (goal)"
            )
        if len(row) != len(rows[0]) or not row:
            raise UsageError(
                f"row {place} of desc of {env_id} has {len(row)} letters and row 0 {len(rows[0])}; all need as many, "
                "and at least one"
            )
    for letter, noun in (("S", "start"), ("G", "goal")):
        if not any(letter in row for row in rows):
            raise UsageError(f"desc of {env_id} has no {letter}, so the map has no {noun}")
