"""In which order methods stand, and which belong together, in every picture."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING, Protocol

from qinit_cli.figures.looks import method_of
from qinit_cli.methods import METHODS
from qinit_cli.methods.method import Initialisation

if TYPE_CHECKING:
    from typing import TypeVar

    T = TypeVar("T", bound="Labelled")

IN_BOTH = ("zero", "optimal", "logqinit-median")  # what every other method is measured by
KINDS = ("initialisations", "other transfer methods")


class Labelled(Protocol):
    """What has a method's label: its name, what it starts from, its options."""

    @property
    def label(self) -> str: ...


def ordered(found: Iterable[T]) -> list[T]:
    """As the methods are registered, each before its variants, plug-ins that are not installed here last."""
    known = list(METHODS)

    def key(one: T) -> tuple[int, bool]:
        name, plus = method_of(one.label)
        return known.index(name) if name in known else len(known), plus

    return sorted(found, key=key)


def of_kind(label: str, kind: str) -> bool:
    """Whether a method of that label belongs to the kind: those of IN_BOTH to either."""
    name, plus = method_of(label)
    if name in IN_BOTH and not plus:
        return True
    method = METHODS.get(name)
    return (method is not None and issubclass(method, Initialisation)) == (kind == KINDS[0])
