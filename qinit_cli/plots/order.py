"""In which order methods stand, and which belong together, in every picture."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING

from qinit_cli.plots.looks import OfMethod

if TYPE_CHECKING:
    from typing import TypeVar

    T = TypeVar("T", bound=OfMethod)

KINDS = ("initialisations", "other transfer methods")


def ordered(found: Iterable[T]) -> list[T]:
    """As the methods are registered, each before its variants, plug-ins that are not installed here last."""
    from qinit_cli.methods import METHODS

    known = list(METHODS)

    def key(one: T) -> tuple[int, bool]:
        return known.index(one.method) if one.method in known else len(known), one.plus

    return sorted(found, key=key)


def of_kind(one: OfMethod, kind: str) -> bool:
    """Whether its method belongs to the kind: a reference to either."""
    from qinit_cli.methods import METHODS
    from qinit_cli.methods.method import Initialisation

    method = METHODS.get(one.method)
    if method is not None and method.reference and not one.plus:
        return True
    return (method is not None and issubclass(method, Initialisation)) == (kind == KINDS[0])
