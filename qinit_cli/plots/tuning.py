"""What choosing a method's parameters found: each candidate's return on the sources, to the method as it is by default."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

from qinit_cli.errors import UsageError
from qinit_cli.plots.drawn import Drawn
from qinit_cli.plots.names import MINUS, number
from qinit_cli.plots.plot import PLAIN, Frame, Plot, Takes
from qinit_cli.plots.reported import Contents, Planned
from qinit_cli.plots.style import COLUMN, LETTER, TEXT, folded, house_style, line_styles, plain_numbers

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from qinit_cli.analysis.intervals import Interval
    from qinit_cli.arrays import Flags, Integers
    from qinit_cli.artefacts.choice import Candidate, Choice

MOST_LINES, MOST_PANELS = 7, 12  # that can be told apart, and that fit on a page
# inches: a row of panels alone, one of several, all; a line of the legend
ALONE, SEVERAL, MOST, KEY = 2.5, 1.9, 7.8, 0.17
APART, SPREAD = 0.06, 0.5  # of the distance between values: from line to line, and all lines at most
DEFAULT: dict[str, Any] = {"marker": "o", "markersize": 10, "markerfacecolor": "none", "color": "black"}
CHOSEN: dict[str, Any] = {"marker": "*", "markersize": 7, "markeredgewidth": 0, "color": "black"}

CAPTION = (
    "Return on the sources minus that of the method as it is by default, each source in the place of a "
    "target."
)  # in a report


@dataclass(frozen=True)
class TuningPlot(Plot):
    """Return on the sources minus that of the method by default, with 95 % intervals, over the parameter of
    most values; a second makes lines, others panels.
    """

    name: ClassVar[str] = "tuning"
    takes: ClassVar[Takes] = Takes(("tuning",), "What qinit tune chose")
    titled: ClassVar[str] = "the method, the distribution and the default's return"

    def drawn(self, paths: Sequence[Path], frame: Frame = PLAIN) -> Drawn:
        """Paired differences with their intervals over the parameter of most values."""
        [path] = paths
        from qinit_cli.artefacts.choice import Choice
        from qinit_cli.artefacts.opening import open_artefact

        with open_artefact(path, "tuning") as artefact:
            choice = Choice.of(artefact)
        along, *others = sorted(choice.names, key=lambda name: -len(_values(choice, name)))
        lines, panels = others[:1], others[1:]
        values = _values(choice, along)
        shown = _panels(choice, along, lines, panels)
        own = f"{choice.label}: the default returns {number(choice.default.average.value)}"
        with house_style():
            figure = tuning(
                shown,
                [_told(value) for value in values],
                along,
                "return minus the default's",
                "".join(lines),
                own if frame.title is None else frame.title,
                frame.width,
            )
        return Drawn(figure, frame.title or own, _alt(choice))

    @classmethod
    def in_report(cls, contents: Contents) -> Iterator[Planned]:
        """A picture of each tuning."""
        from qinit_cli.comparison.distinctions import distinctions

        tunings = contents.kinds["tuning"]
        words = distinctions([told["settings"] for told in tunings.values()])
        for path, own in zip(tunings, words, strict=True):
            yield Planned(CAPTION, own, partial(cls().drawn, [path]))


def _values(choice: Choice, name: str) -> list[float]:
    return sorted({one.parameters[name] for one in choice.candidates})


def _panels(choice: Choice, along: str, lines: Sequence[str], panels: Sequence[str]) -> list[TuningPanel]:

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
    import numpy as np

    from qinit_cli.analysis.intervals import Interval

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


@dataclass(frozen=True)
class Line:
    """The candidates that differ in the parameter along the axis alone, P of them."""

    label: str
    at: Integers  # (P,) which of the axis' values
    gain: Interval  # (P,) to the default
    default: Flags  # (P,)
    chosen: Flags  # (P,)


@dataclass(frozen=True)
class TuningPanel:
    """The lines of one combination of all parameters but two."""

    title: str
    lines: Sequence[Line]


def tuning(
    panels: Sequence[TuningPanel],
    values: Sequence[str],
    xlabel: str,
    ylabel: str,
    key: str,
    title: str,
    width: float = TEXT,
) -> Figure:
    """All panels on the same axes; the values stand evenly, in their order. Call it within `house_style`.

    `key` names what the lines differ in, "" where there is one.
    """
    from matplotlib.figure import Figure

    labels = list(dict.fromkeys(line.label for panel in panels for line in panel.lines))
    styles = dict(zip(labels, line_styles(len(labels)), strict=True))
    columns = min(len(panels), 3 if width > COLUMN else 1 if len(panels) < 4 else 2)
    rows = -(-len(panels) // columns)
    tall = ALONE if rows == 1 else min(SEVERAL, MOST / rows)
    keys = KEY * -(-(2 + len(labels) * bool(key)) // _abreast(width))
    heading = folded(title, width) if title else ""
    above = 0.16 * (1 + heading.count("\n")) if title else 0
    figure = Figure(figsize=(width, rows * tall + keys + above))
    drawn = figure.subplots(rows, columns, sharex=True, sharey=True, squeeze=False)
    for axes, panel in zip(drawn.flat, panels, strict=False):
        _panel(axes, panel, labels, styles)
        axes.set_title(panel.title, fontsize=7)
        axes.tick_params(labelbottom=True)
    for axes in drawn.flat[len(panels) - columns : len(panels)]:
        axes.set_xlabel(xlabel)
    for axes in drawn.flat[len(panels) :]:
        axes.remove()
    first = drawn.flat[0]
    crowded = sum(len(value) + 2 for value in values) * LETTER > 0.8 * width / columns
    first.set_xticks(range(len(values)), values)
    first.set_xlim(-0.5, len(values) - 0.5)
    for axes in drawn.flat[: len(panels)]:
        axes.tick_params(axis="x", rotation=90 if crowded else 0)
    plain_numbers(first.yaxis)
    figure.supylabel(folded(ylabel, rows * tall))
    _legend(figure, styles if key else {}, key, width)
    if heading:
        figure.suptitle(heading)
    return figure


def _panel(axes: Axes, panel: TuningPanel, labels: Sequence[str], styles: dict[str, dict[str, Any]]) -> None:
    """Points and their intervals, those of one value beside each other; the default and the choice are marked."""
    import numpy as np

    step = min(APART, SPREAD / len(labels))
    axes.axhline(0, color="black", linewidth=0.6)
    for line in panel.lines:
        at = line.at + step * (labels.index(line.label) - (len(labels) - 1) / 2)
        known = ~line.default  # to itself it has no interval
        around = np.array([line.gain.estimate - line.gain.low, line.gain.high - line.gain.estimate])
        axes.plot(at, line.gain.estimate, label=line.label, marker=".", markersize=4, **styles[line.label])
        axes.errorbar(
            at[known], line.gain.estimate[known], around[:, known], fmt="none",
            ecolor=styles[line.label]["color"], elinewidth=0.8, capsize=2, capthick=0.8,
        )  # fmt: skip
        for which, mark in ((line.default, DEFAULT), (line.chosen, CHOSEN)):
            if not which.any():
                continue  # a line of no points that is not clipped would stand at the far end of the page
            axes.plot(at[which], line.gain.estimate[which], linestyle="", zorder=3, clip_on=False, **mark)


def _legend(figure: Figure, styles: dict[str, dict[str, Any]], key: str, width: float) -> None:
    from matplotlib.lines import Line2D

    handles = [
        Line2D([], [], marker=".", markersize=4, label=f"{key} {label}", **look)
        for label, look in styles.items()
    ]
    marks = (("the default", DEFAULT), ("chosen", CHOSEN))
    handles += [Line2D([], [], linestyle="", label=label, **mark) for label, mark in marks]
    figure.legend(
        handles=handles,
        loc="outside lower center",
        ncols=min(len(handles), _abreast(width)),
    )


def _abreast(width: float) -> int:
    """Entries of the legend in a row."""
    return 6 if width > COLUMN else 3
