"""Methods as artefacts tell of them: by name, label and options, of plug-ins that may not be installed here."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from qinit_cli.methods import METHODS, Method
from qinit_cli.methods.zero import Zero
from qinit_cli.options import options


def stored(told: Mapping[str, Any]) -> Method | None:
    """The method with its options; None where it, or what it starts from, is not installed."""
    kind, first = METHODS.get(str(told["name"])), _first(told)
    if kind is None or first not in METHODS:
        return None
    given = {one.name: told[one.name] for one in options(kind) if one.name in told}
    return kind(**(given | {"init": first} if "init" in given else given))


def reads_sources(told: Mapping[str, Any]) -> bool:
    """Whether other sources would make it start otherwise; so it is of a method that is not installed."""
    method = stored(told)
    return method is None or method.reads_sources


def is_plus(told: Mapping[str, Any]) -> bool:
    """Whether it starts from another method instead of zero."""
    return _first(told) != Zero.name


def _first(told: Mapping[str, Any]) -> str:
    """The method that it starts from."""
    init = told.get("init", Zero.name)
    return str(init["name"] if isinstance(init, Mapping) else init)
