# mypy: disable-error-code="untyped-decorator"
"""Parts of the compiled loop: functions whose body is chosen by the class of their first argument, when they are compiled."""

from __future__ import annotations

from collections.abc import Callable
from functools import wraps
from typing import Any

from numba.extending import overload

from qinit_cli.kernels.compiled import INLINED

Function = Callable[..., Any]

_BODIES: dict[Function, dict[type | None, Function]] = {}


def part(default: Function) -> Function:
    """The function as a part: compiled as it stands, but for the classes (NamedTuples) that `body` gives another.

    Its callers are compiled with it inlined; they must not be kept apart from the code of these classes.
    """
    bodies = _BODIES[default] = {}
    options: Any = INLINED  # the types that Numba states are narrower than what it takes

    @wraps(default)  # Numba compares the names of the arguments
    def choose(*arguments: Any) -> Function:
        return bodies.get(getattr(arguments[0], "instance_class", None), default)

    overload(default, jit_options=options)(choose)
    return default


def body(of: Function, *classes: type) -> Callable[[Function], Function]:
    """Registers the body of a part for the classes; its arguments have the names of the part's."""

    def register(function: Function) -> Function:
        function.__annotations__ = {}  # Numba compares them too
        _BODIES[of].update(dict.fromkeys(classes, function))
        return function

    return register
