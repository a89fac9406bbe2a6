"""How each method is drawn, the same in every picture: its colour, its dashes and marks, its hatching.

A method is told by its colour, and without colour by the rest: a "+" has its method's colour with other dashes and hatching, and
other options of one method differ in the same way. Names that are not listed, of plug-ins, take what is free.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any, Protocol

# where a method has none; ours are after Okabe and Ito (2008) and Tol (2021), these too
OTHERS = ("#44AA99", "#999933", "#AA4499", "#661100", "#6699CC", "#DDCC77")
OTHER_MARKERS = ("h", "p", "8", "H", "1", "2")
DASHES = ("-", "--", "-.", ":", (0, (5, 1, 1, 1, 1, 1)), (0, (1, 3)))
DENSER = ("xxxx", "++++", "oooo", "OOO", "***")  # hatching of the variants of a method


class OfMethod(Protocol):
    """What is drawn of a method."""

    @property
    def label(self) -> str: ...
    @property
    def method(self) -> str: ...
    @property
    def plus(self) -> bool: ...


@dataclass(frozen=True)
class Appearance:
    """How one line, or one set of bars, is drawn."""

    colour: str
    dashes: Any
    marker: str
    hatch: str
    variant: int  # of the method: 0 is its first

    def line(self, points: int, at: int) -> dict[str, Any]:
        """For a line of so many points, the `at`-th of the picture: its few marks stand beside the others'."""
        apart = max(1, points // 8)
        return {
            "color": self.colour,
            "linestyle": self.dashes,
            "marker": self.marker or None,
            "markersize": 3.2,
            "markerfacecolor": "white" if self.variant else self.colour,
            "markeredgewidth": 0.8,
            "markevery": (apart * (1 + at % 5) // 6, apart),
        }

    def bar(self) -> dict[str, Any]:
        """For a set of bars."""
        return {"facecolor": self.colour, "hatch": self.hatch}


def appearances(drawn: Iterable[OfMethod]) -> dict[str, Appearance]:
    """How each label appears, no two alike; a label that comes again appears as before."""
    from qinit_cli.methods import METHODS, Method

    found, seen = dict[str, Appearance](), dict[str, int]()
    strangers: list[str] = []  # whose methods have no colour of their own
    for one in {one.label: one for one in drawn}.values():
        variant = seen.get(one.method, int(one.plus))
        seen[one.method] = variant + 1
        kind = METHODS.get(one.method, Method)
        colour, marker, hatch, dashes = kind.look
        if not colour:
            if one.method not in strangers:
                strangers.append(one.method)
            at = strangers.index(one.method)
            colour, marker = OTHERS[at % len(OTHERS)], OTHER_MARKERS[at % len(OTHER_MARKERS)]
        found[one.label] = Appearance(
            colour, dashes or DASHES[variant % len(DASHES)], marker, _hatch(hatch, variant), variant
        )
    return found


def _hatch(own: str, variant: int) -> str:
    return DENSER[(variant - 1) % len(DENSER)] if variant else own
