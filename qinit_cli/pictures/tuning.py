"""What choosing a method's parameters found: each candidate's return on the sources, to the method as it is by default."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from qinit_cli.errors import UsageError
from qinit_cli.figures.style import TEXT
from qinit_cli.pictures.names import MINUS, number

if TYPE_CHECKING:
    from collections.abc import Sequence

    from qinit_cli.artefacts.choice import Candidate, Choice
    from qinit_cli.figures.drawn import Drawn
    from qinit_cli.figures.tuning import Line, TuningPanel

MOST_LINES, MOST_PANELS = 7, 12  # that can be told apart, and that fit on a page


def drawn(path: Path, *, title: str | None = None, width: float = TEXT) -> Drawn:
    """Paired differences with their intervals over the parameter of most values; a second makes lines, others panels."""
    from qinit_cli.artefacts.choice import Choice
    from qinit_cli.artefacts.opening import open_artefact
    from qinit_cli.figures import tuning as drawing
    from qinit_cli.figures.drawn import Drawn
    from qinit_cli.figures.style import house_style

    with open_artefact(path, "tuning") as artefact:
        choice = Choice.of(artefact)
    along, *others = sorted(choice.names, key=lambda name: -len(_values(choice, name)))
    lines, panels = others[:1], others[1:]
    values = _values(choice, along)
    shown = _panels(choice, along, lines, panels)
    own = f"{choice.label}: the default returns {number(choice.default.average.value)}"
    with house_style():
        figure = drawing.tuning(
            shown,
            [_told(value) for value in values],
            along,
            "return minus the default's",
            "".join(lines),
            own if title is None else title,
            width,
        )
    return Drawn(figure, title or own, _alt(choice))


def _values(choice: Choice, name: str) -> list[float]:
    return sorted({one.parameters[name] for one in choice.candidates})


def _panels(choice: Choice, along: str, lines: Sequence[str], panels: Sequence[str]) -> list[TuningPanel]:
    from qinit_cli.figures.tuning import TuningPanel

    places = {value: place for place, value in enumerate(_values(choice, along))}
    groups: dict[str, dict[str, list[Candidate]]] = {}
    for one in sorted(
        choice.candidates, key=lambda one: [one.parameters[name] for name in (*panels, *lines, along)]
    ):
        own = ", ".join(f"{name} {_told(one.parameters[name])}" for name in panels)
        label = "".join(_told(one.parameters[name]) for name in lines)
        groups.setdefault(own, {}).setdefault(label, []).append(one)
    several = len({label for group in groups.values() for label in group})
    if several > MOST_LINES or len(groups) > MOST_PANELS:
        raise UsageError(
            f"panels: {len(groups)}, lines in each: {several}; at most {MOST_PANELS} and {MOST_LINES} fit, "
            "and qinit export writes the numbers"
        )
    return [
        TuningPanel(own, [_line(label, found, along, places) for label, found in group.items()])
        for own, group in groups.items()
    ]


def _line(label: str, found: Sequence[Candidate], along: str, places: dict[float, int]) -> Line:
    from qinit_cli.analysis.intervals import Interval
    from qinit_cli.figures.tuning import Line

    return Line(
        label=label,
        at=np.array([places[one.parameters[along]] for one in found]),
        gain=Interval(
            estimate=np.array([one.difference.value for one in found]),
            low=np.array([one.difference.low for one in found]),
            high=np.array([one.difference.high for one in found]),
        ),
        default=np.array([one.default for one in found]),
        chosen=np.array([one.chosen for one in found]),
    )


def _told(value: float) -> str:
    """As it is read on an axis: six digits at most."""
    return f"{value:.6g}".replace("-", MINUS)


def _alt(choice: Choice) -> str:
    """The default, the best and the worst, and what choosing is worth on sources that did not choose."""
    ranked = sorted(choice.candidates, key=lambda one: -one.difference.value)
    default, worth = choice.default, choice.worth
    best = "the default is the best" if choice.chosen.default else f"the best is {_said(choice.chosen)}"
    return (
        f"Return of {choice.label} on {choice.sources} of its sources under {len(ranked)} choices of parameters, minus that of "
        f"the default ({_named(default)}), {number(default.average.value)}: {best}, the least {_said(ranked[-1])}. "
        f"Chosen by four folds and judged by the fifth, a choice is worth {number(worth.value)}, from "
        f"{number(worth.low)} to {number(worth.high)}."
    )


def _said(one: Candidate) -> str:
    gained = one.difference
    return f"{_named(one)} with {number(gained.value)}, from {number(gained.low)} to {number(gained.high)}"


def _named(one: Candidate) -> str:
    return " and ".join(f"{name} {_told(value)}" for name, value in one.parameters.items())
