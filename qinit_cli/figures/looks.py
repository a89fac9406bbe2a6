"""How each method is drawn, the same in every picture: its colour, its dashes and marks, its hatching.

A method is told by its colour, and without colour by the rest: a "+" has its method's colour with other dashes and hatching, and
other options of one method differ in the same way. Names that are not listed, of plug-ins, take what is free.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

# after Okabe and Ito (2008) and Tol (2021); the greys and black are for what is no transfer or no method of its own
KNOWN = {  # colour, marker, hatching
    "zero": ("#000000", "", ""),
    "mean": ("#888888", "v", "////"),
    "maxqinit": ("#D55E00", "^", "...."),
    "ucoi": ("#E69F00", "s", "\\\\\\\\"),
    "logqinit-median": ("#0072B2", "o", ""),
    "logqinit-mean": ("#56B4E9", "D", "////"),
    "logqinit-quantile": ("#332288", "P", "...."),
    "optimal": ("#000000", "*", "----"),
    "ptrs": ("#CC79A7", "<", ""),
    "drs": ("#8C6D31", ">", "...."),
    "ops-tl": ("#009E73", "d", "\\\\\\\\"),
    "posterior": ("#882255", "X", "////"),
}
OTHERS = ("#44AA99", "#999933", "#AA4499", "#661100", "#6699CC", "#DDCC77")
OTHER_MARKERS = ("h", "p", "8", "H", "1", "2")
DASHES = ("-", "--", "-.", ":", (0, (5, 1, 1, 1, 1, 1)), (0, (1, 3)))
DENSER = ("xxxx", "++++", "oooo", "OOO", "***")  # hatching of the variants of a method


@dataclass(frozen=True)
class Look:
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


def looks(labels: Sequence[str]) -> list[Look]:
    """The look of each label, such as "ptrs+logqinit-mean" or "ops-tl rho=1"; no two alike."""
    methods = [method_of(label) for label in labels]
    strangers = [base for base in dict(methods) if base not in KNOWN]
    found, seen = [], dict[str, int]()
    for base, plus in methods:
        variant = seen.get(base, int(plus))
        seen[base] = variant + 1
        if base in KNOWN:
            colour, marker, hatch = KNOWN[base]
        else:
            at = strangers.index(base)
            colour, marker, hatch = OTHERS[at % len(OTHERS)], OTHER_MARKERS[at % len(OTHER_MARKERS)], ""
        dashes = DASHES[variant % len(DASHES)] if base != "optimal" else ":"
        found.append(Look(colour, dashes, marker, _hatch(hatch, variant), variant))
    return found


def method_of(label: str) -> tuple[str, bool]:
    """The method of a label and whether it is a "+", without what it starts from, its options and what else is said."""
    name, plus, _ = label.split(" ")[0].rstrip(",").partition("+")
    return name, bool(plus)


def _hatch(own: str, variant: int) -> str:
    return DENSER[(variant - 1) % len(DENSER)] if variant else own
