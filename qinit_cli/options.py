"""Options as dataclass fields: a family or a method declares each of its options once, with its default, help and range.

The command line reads them as options, `asdict` of the instance is what is stored, and construction checks the ranges, for
those who build a family in Python as for those who type one.
"""

from __future__ import annotations

import dataclasses
import math
import operator
from collections.abc import Callable
from functools import cache
from numbers import Integral, Real
from types import NoneType, UnionType
from typing import TYPE_CHECKING, Any, Literal, Union, get_args, get_origin, get_type_hints

from qinit_cli.nearest import nearest

if TYPE_CHECKING:
    from _typeshed import DataclassInstance


UNIONS = (Union, UnionType)  # one type or another: a Literal's is of the first kind


def option(
    default: Any,
    help: str,
    *,
    low: float | None = None,
    high: float | None = None,
    above: float | None = None,
    below: float | None = None,
    default_text: str | None = None,
    metavar: str | None = None,
    short: str | None = None,
    panel: str | None = None,
    grid: tuple[float, ...] = (),
    positional: bool = False,
    seldom: bool = False,
) -> Any:
    """A dataclass field that is also a command-line option.

    `low` and `high` bound a number (both included), `above` and `below` too (not included); `default_text` tells in the help
    where a default of None comes from; `short` is a one-letter flag; `panel` the help group, if not that of the whole
    dataclass; `grid` what `qinit tune` tries. A `positional` one is an argument without a flag, which
    must be given where the default is "".

    `--help` shows what a family or a method is made of, how many tasks and episodes, the seed, where the artefact goes and how
    much of the machine is used; a `seldom` one stands in `--help-all` alone.
    """
    return dataclasses.field(
        default=default,
        metadata={
            "help": help,
            "low": low,
            "high": high,
            "above": above,
            "below": below,
            "default_text": default_text,
            "metavar": metavar,
            "short": short,
            "positional": positional,
            "panel": panel,
            "grid": grid,
            "seldom": seldom,
        },
    )


def flag(name: str) -> str:
    """How a field is spelled on the command line: `p_low` is `--p-low`, and `import_` is `--import`."""
    return "--" + name.rstrip("_").replace("_", "-")


def key_of(name: str) -> str:
    """How a field is typed as a key: as its flag is, without dashes before it."""
    return flag(name).removeprefix("--")


def help_of(option: dataclasses.Field[Any]) -> str:
    """The help of an option, with its range: "Probability that a step explores. [0 to 1]"."""
    bounds = _bounds(option)
    return (
        f"{option.metadata['help']} [{bounds.removeprefix('from ')}]" if bounds else option.metadata["help"]
    )


def options(owner: type[Any]) -> tuple[dataclasses.Field[Any], ...]:
    """The fields of a dataclass that were declared by `option`."""
    return tuple(field for field in dataclasses.fields(owner) if "help" in field.metadata)


def tunable(owner: type[Any]) -> dict[str, tuple[float, ...]]:
    """The options that `qinit tune` can choose, with the values that it tries unless told otherwise."""
    return {field.name: field.metadata["grid"] for field in options(owner) if field.metadata["grid"]}


def numbers(owner: type[Any]) -> tuple[dataclasses.Field[Any], ...]:
    """The options that are numbers, always."""
    hints = get_type_hints(owner)
    return tuple(field for field in options(owner) if hints[field.name] in (int, float))


def check(instance: DataclassInstance) -> None:
    """Raises ValueError, one sentence, for the first option of a wrong type, out of its range, not finite or no choice.

    Numbers become Python's own, floats where the option is one.
    """
    hints = _types(type(instance))
    for field in options(type(instance)):
        value = getattr(instance, field.name)
        if not is_of(value, hints[field.name]):
            raise ValueError(f"{flag(field.name)} is {value!r}; it must be {_named(hints[field.name])}")
        choices = _choices(hints[field.name])
        if choices and value not in (*choices, field.default):  # which may be None
            raise ValueError(f"{flag(field.name)} is {value!r}; {nearest(str(value), choices)}")
        if isinstance(value, Real) and not isinstance(value, bool):
            _check_number(field, value)
            # as the command line reads it, and as it is stored: 7 and numpy's 7.0 are one setting
            object.__setattr__(instance, field.name, _plain(value, hints[field.name]))


@cache
def _types(owner: type[Any]) -> dict[str, Any]:
    """The type of every field by name, which Python reads from its text each time."""
    return get_type_hints(owner)


def _plain(value: Any, hint: Any) -> int | float:
    """A number as Python's own, of the type that the annotation names."""
    whole = int in (hint, *get_args(hint)) and isinstance(value, Integral)
    return int(value) if whole else float(value)


def is_of(value: Any, hint: Any) -> bool:
    """Whether a value is of the type that an annotation names: numbers, text, lists of them, classes; any for another."""
    if get_origin(hint) in UNIONS:
        return any(is_of(value, part) for part in get_args(hint))
    if get_origin(hint) is list:  # a shift brings one alone
        several = value if isinstance(value, list | tuple) else [value]
        return all(is_of(one, get_args(hint)[0]) for one in several)
    if hint in (int, float):
        return isinstance(value, Integral if hint is int else Real) and not isinstance(value, bool)
    return isinstance(value, hint) if isinstance(hint, type) else True


def _named(hint: Any) -> str:
    """What a type is called in a message."""
    names = {
        bool: "true or false",
        int: "a whole number",
        float: "a number",
        str: "a text",
        NoneType: "nothing",
    }
    parts = get_args(hint) if get_origin(hint) in UNIONS else (hint,)
    classes = {part: f"{_article(part.__name__)} {part.__name__}" for part in parts if isinstance(part, type)}
    return " or ".join(
        (classes | names).get(part, "a list of texts" if get_origin(part) is list else "a text")
        for part in parts
    )


def _article(noun: str) -> str:
    return "an" if noun[0] in "AEIOU" else "a"


def _choices(hint: Any) -> tuple[str, ...]:
    """What a Literal allows, also where None may stand instead; () for any other type."""
    if get_origin(hint) is Literal:
        return get_args(hint)
    literals = [part for part in get_args(hint) if get_origin(part) is Literal]
    return get_args(literals[0]) if literals else ()


BOUNDS: dict[str, tuple[str, Callable[[float, float], bool]]] = {
    "low": ("at least", operator.ge),
    "above": ("above", operator.gt),
    "high": ("at most", operator.le),
    "below": ("below", operator.lt),
}


def _check_number(field: dataclasses.Field[Any], value: Any) -> None:
    if not math.isfinite(value):
        raise ValueError(f"{flag(field.name)} is {value}; it must be a finite number")
    for name, (_, holds) in BOUNDS.items():
        bound = field.metadata[name]
        if bound is not None and not holds(value, bound):
            raise ValueError(f"{flag(field.name)} is {value}; it must be {_bounds(field)}")


def _bounds(field: dataclasses.Field[Any]) -> str:
    """The range of a number in words; "" where it has none."""
    low, high = field.metadata["low"], field.metadata["high"]
    if low is not None and high is not None:
        return f"from {low} to {high}"
    there = {name: bound for name in BOUNDS if (bound := field.metadata[name]) is not None}
    return " and ".join(f"{BOUNDS[name][0]} {bound}" for name, bound in there.items())
