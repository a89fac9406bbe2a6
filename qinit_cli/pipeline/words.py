"""A dataclass of options as the words that a command line has for it."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import Any

from qinit_cli.options import flag, options


def option_words(instance: Any) -> list[str]:
    """The options that make this instance of a dataclass of options; what stands there anyway is left out."""
    return [word for field in options(type(instance)) for word in _option(instance, field)]


def _option(instance: Any, field: Any) -> Iterator[str]:
    value = getattr(instance, field.name)
    if value == field.default or _made_anyway(instance, field):
        return
    if field.metadata["positional"]:
        yield str(value)
        return
    for one in value if isinstance(value, list | tuple) else [value]:
        yield flag(field.name)
        if one is not True:
            yield _spelled(one)


def _made_anyway(instance: Any, field: Any) -> bool:
    """Whether the option's default leads to the same instance, as --variance of goals that are normal anyway."""
    try:
        return bool(replace(instance, **{field.name: field.default}) == instance)
    except ValueError:
        return False


def _spelled(value: Any) -> str:
    return str(int(value)) if isinstance(value, float) and value.is_integer() else str(value)
