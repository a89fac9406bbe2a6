"""Settings as they are typed, NAME:KEY=VALUE,... and KEY=VALUE, free of numpy so that help stays fast."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields
from pathlib import Path
from typing import Any, TypeVar, get_args, get_type_hints

from qinit_cli.nearest import nearest
from qinit_cli.options import key_of, options

Kind = TypeVar("Kind")
TRUTH = {"true": True, "false": False}


def read(text: str, kinds: Mapping[str, type[Kind]], also: tuple[str, ...] = ()) -> Kind:
    """The instance of one of the kinds that NAME:KEY=VALUE,... writes.

    ValueError, the end of a sentence, where it writes none; `also` names what else might have stood there.
    """
    name, colon, rest = text.partition(":")
    if name not in kinds:
        raise ValueError(f"is {text!r}; {nearest(name, [*kinds, *also])}")
    kind, given = kinds[name], dict[str, Any]()
    for part in rest.split(",") if colon else ():
        try:
            key, value = setting(part, kind, name)
        except ValueError as error:
            raise ValueError(f"is {text!r}: {error}") from error
        if key in given:
            raise ValueError(f"is {text!r}: {part.partition('=')[0]} is given twice")
        given[key] = value
    try:
        return kind(**given)
    except ValueError as error:
        raise ValueError(f"is {text!r}: {str(error).removeprefix('--')}") from error


def write(one: Any) -> str:
    """What `read` reads as this instance: its name, and the options that are not the usual ones."""
    given = [
        f"{key_of(field.name)}={value}"
        for field in fields(one)
        if (value := getattr(one, field.name)) != field.default
    ]
    return ":".join([one.name, *([",".join(given)] if given else [])])


def setting(text: str, owner: type[Any], called: str) -> tuple[str, Any]:
    """The field and the value of KEY=VALUE, of a dataclass of options that is `called` so; ValueError, one sentence."""
    hints = get_type_hints(owner)
    known = {key_of(option.name): option.name for option in options(owner)}
    key, equals, value = text.partition("=")
    key = key.strip().replace("_", "-")
    if not known:
        raise ValueError(f"{called} has no options")
    if not equals:
        raise ValueError(f"write KEY=VALUE, KEY one of {', '.join(sorted(known))}")
    if key not in known:
        raise ValueError(f"{called} has no {key}; {nearest(key, sorted(known))}")
    return known[key], _typed(value, hints[known[key]])


def _typed(value: str, hint: Any) -> Any:
    """The value as the annotation has it, a number, true or false or a path; as it is where it has none of them."""
    hints = get_args(hint) or (hint,)
    if bool in hints and value in TRUTH:
        return TRUTH[value]
    for kind, noun in ((int, "whole number"), (float, "number")):
        if kind in hints:
            try:
                return kind(value)
            except ValueError as error:
                raise ValueError(f"{value!r} is no {noun}") from error
    return Path(value) if Path in hints else value
