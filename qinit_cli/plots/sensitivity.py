"""The average over all episodes against a setting that varies, a line a method: `qinit sensitivity --over` as a picture."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from typing import TYPE_CHECKING, Any, ClassVar, Literal

from qinit_cli.comparison.setting_text import setting_text
from qinit_cli.errors import NotAllowed, UsageError
from qinit_cli.options import option
from qinit_cli.plots import legend
from qinit_cli.plots.drawn import Drawn
from qinit_cli.plots.looks import Appearance, appearances
from qinit_cli.plots.names import METRIC_LABELS, listed, marked, number
from qinit_cli.plots.order import ordered
from qinit_cli.plots.plot import PLAIN, Frame, RunsPlot, Takes
from qinit_cli.plots.reported import Contents, Planned
from qinit_cli.plots.style import COLUMN, LETTER, TEXT, folded, house_style, plain_numbers

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from qinit_cli.analysis.intervals import Estimate
    from qinit_cli.comparison.runs import ComparedRun
    from qinit_cli.comparison.sensitivity import SensitivityPoint
    from qinit_cli.comparison.varied import Value, VariedRuns, VariedSetting

MOST_PANELS, MOST_IN_REPORT = 12, 4  # where a report has more, what else varies is averaged over
NO_PANELS = "none"
DECADES = 100  # values that span more are drawn on a logarithmic axis
ALONE, SEVERAL, LINE = 2.6, 1.9, 0.16  # inches: one panel, a row of several, a line of text
MARGIN = 0.06  # of the axes, about what is drawn
BESIDE = 1.6  # points from line to line, so that intervals at one value can be told apart
SINGLE = {"marker": "o", "markersize": 3.2}  # of a method without a mark of its own

CAPTION = "Means over all episodes: a description of how they change, each value with its own targets where it changes these."


@dataclass(frozen=True)
class SensitivityPlot(RunsPlot):
    """Averages over all episodes against a setting that varies among the runs, a line for each method, with 95 % intervals."""

    name: ClassVar[str] = "sensitivity"
    takes: ClassVar[Takes] = Takes(("run",), "Runs that differ in a setting", several=True)
    titled: ClassVar[str] = "none"
    heading: ClassVar[str] = "Sensitivity"

    over: str | None = option(
        None,
        "The setting along the axis: variance, sources.tasks, epsilon, distribution.",
        metavar="NAME",
        default_text="the one of most values",
    )
    panels: str | None = option(
        None,
        "A panel for each value of this setting, what else varies being averaged over; none: one panel.",
        metavar="NAME",
        default_text="a panel for each combination of what else varies",
    )
    metric: Literal["return", "success", "steps"] = option(
        "return", "Discounted return, share of episodes that reach the goal, or min(steps, horizon)."
    )

    def of_runs(self, runs: Sequence[ComparedRun], frame: Frame = PLAIN) -> Drawn:
        """A panel for each combination of the other settings, or as `panels` says. UsageError where too many would not fit."""
        from qinit_cli.comparison.sensitivity import Averages, averaged_over, intervals_of, sensitivity_points
        from qinit_cli.comparison.varied import VariedRuns

        varied = VariedRuns.of(runs)
        over = most_varied(varied) if self.over is None else varied.named(self.over, "--over")
        others = self._others(varied, over)
        points = sensitivity_points(Averages(varied, self.metric), over, others)
        shown = _panels(points, varied, over)
        if len(shown) > MOST_PANELS:
            names = ", ".join(one.name for one in others)
            raise UsageError(
                f"{len(shown)} panels, of {names}, do not fit, {MOST_PANELS} do; name one of them with --panels, or none"
            )
        pooled = averaged_over(varied, over, *others) if self.panels else ""
        beneath = "; ".join([intervals_of(points), *([pooled] if pooled else [])])
        label = METRIC_LABELS[self.metric]
        with house_style():
            figure = sensitivity(shown, over, beneath, label, frame.title or "", frame.width)
        title = frame.title or f"Sensitivity to {over.name}, {label}"
        return Drawn(figure, title, _alt(shown, over, label))

    def _others(self, varied: VariedRuns, over: VariedSetting) -> list[VariedSetting]:
        if self.panels is None:
            return varied.others(over)
        if self.panels == NO_PANELS:
            return []
        one = varied.named(self.panels, "--panels")
        if one in (over, varied.method):
            raise UsageError(f"--panels {self.panels}: that is drawn already; name another setting, or none")
        return [one]

    @classmethod
    def in_report(cls, contents: Contents) -> Iterator[Planned]:
        """A picture for each setting of numbers; what else varies in panels while they are few, else averaged over."""
        from qinit_cli.comparison.varied import VariedRuns

        if not contents.runs:
            return
        varied = VariedRuns.of(contents.runs)
        for setting in varied.varied:
            if setting.numeric and varied.drawable(setting):
                few = len(varied.combinations(varied.others(setting))) <= MOST_IN_REPORT
                plot = cls(over=setting.name, panels=None if few else NO_PANELS)
                yield Planned(CAPTION, "", partial(plot.of_runs, contents.runs))


def most_varied(varied: VariedRuns, *but: VariedSetting) -> VariedSetting:
    """The setting of most values, methods apart; UsageError where none varies but those named."""
    found = [one for one in (*varied.varied, varied.distribution) if one not in but and len(one.values) > 1]
    if not found:
        names = " but ".join(["nothing", *(one.name for one in but)])
        raise UsageError(
            f"{names} varies among these runs besides the method; give runs that differ in a setting"
        )
    return max(found, key=lambda one: len(one.values))


@dataclass(frozen=True)
class SensitivityLine:
    """A method's averages at the values that it was run with."""

    label: str
    method: str  # its name
    plus: bool  # whether it starts from another
    averages: dict[Value, Estimate] = field(default_factory=dict)


Panels = dict[str, list[SensitivityLine]]  # by title


def _panels(points: Sequence[SensitivityPoint], varied: VariedRuns, over: VariedSetting) -> Panels:
    of = {str(known["method"]): run for run, known in zip(varied.runs, varied.known, strict=True)}
    found: dict[str, dict[str, dict[Value, Estimate]]] = {}
    for point in points:
        title = ", ".join(f"{name} {setting_text(value)}" for name, value in point.where)
        found.setdefault(title, {}).setdefault(point.method, {})[point.value] = point.average
    if not found:
        raise NotAllowed(
            f"{over.name} varies, but no run can be drawn over it; give runs of several values of it"
        )
    return {
        title: ordered(
            replace(method_line(label, of.get(label)), averages=own) for label, own in lines.items()
        )
        for title, lines in found.items()
    }


def method_line(label: str, run: ComparedRun | None) -> SensitivityLine:
    """The line of a run's method, without points, with what a reader must know of it; without a run that of all methods."""
    if run is None:
        return SensitivityLine("all runs", "", False)
    method = run.settings.method
    shown = marked(label, method.name, imported=run.settings.imported, blended=method.blended)
    return SensitivityLine(shown, method.name, method.plus)


def sensitivity(
    panels: Panels, over: VariedSetting, beneath: str, ylabel: str, title: str, width: float = TEXT
) -> Figure:
    """The panels on the same axes, with one legend. Call it within `house_style`."""
    from matplotlib.figure import Figure

    lines = [line for own in panels.values() for line in own]
    labels = list(dict.fromkeys(line.label for line in lines))
    looks = appearances(lines)
    columns = min(len(panels), 3 if width > COLUMN else 1)
    rows = -(-len(panels) // columns)
    note = folded(beneath, 0.85 * width)
    height = rows * (ALONE if rows == 1 else SEVERAL) + LINE * (note.count("\n") + bool(title))
    figure = Figure(figsize=(width, height + legend.height(labels, width, note)))
    drawn = figure.subplots(rows, columns, sharex=True, sharey=True, squeeze=False)
    for axes, (name, own) in zip(drawn.flat, panels.items(), strict=False):
        _draw(axes, own, labels, looks, over)
        axes.set_title(folded(name, 0.9 * width / columns), fontsize=7)
        axes.tick_params(labelbottom=True)
    for axes in drawn.flat[len(panels) :]:
        axes.remove()
    _limits(drawn.flat[0], lines, over)
    _values(list(drawn.flat[: len(panels)]), over, width / columns)
    for axes in drawn.flat[max(0, len(panels) - columns) : len(panels)]:
        axes.set_xlabel(over.name)
    figure.supylabel(folded(ylabel, rows * SEVERAL))
    legend.legend(figure, labels, width, title=note)
    if title:
        figure.suptitle(folded(title, width))
    return figure


def _draw(
    axes: Axes,
    lines: Sequence[SensitivityLine],
    labels: Sequence[str],
    looks: dict[str, Appearance],
    over: VariedSetting,
) -> None:
    from matplotlib.transforms import ScaledTranslation

    for line in lines:
        at = labels.index(line.label)
        aside = BESIDE * (at - (len(labels) - 1) / 2) / 72
        beside = ScaledTranslation(aside, 0, axes.figure.dpi_scale_trans)
        places = [place(over, value) for value in line.averages]
        found = list(line.averages.values())
        look: dict[str, Any] = {**looks[line.label].line(len(found), at), "markevery": None}
        if look["marker"] is None:
            look |= SINGLE
        bars = axes.errorbar(
            places,
            [one.value for one in found],
            [[one.value - one.low for one in found], [one.high - one.value for one in found]],
            label=line.label,
            elinewidth=0.7,
            capsize=1.5,
            capthick=0.7,
            **look,
        )
        for artist in bars.get_children():
            artist.set_transform(axes.transData + beside)
    plain_numbers(axes.yaxis)


def _limits(axes: Axes, lines: Sequence[SensitivityLine], over: VariedSetting) -> None:
    """As wide as the values and as high as the intervals: matplotlib does not count what stands aside of its data."""
    from math import isnan

    found = [one for line in lines for one in line.averages.values()]
    bounds = [end for one in found for end in (one.low, one.value, one.high) if not isnan(end)]
    low, high = min(bounds), max(bounds)
    margin = MARGIN * (high - low) or abs(high) or 1.0
    axes.set_ylim(low - margin, high + margin)
    if not over.numeric:
        axes.set_xlim(-0.5, len(over.values) - 0.5)
        return
    first, last = (float(over.values[end]) for end in (0, -1))
    if _logarithmic(over):
        axes.set_xscale("log")
        beyond = (last / first) ** MARGIN
        axes.set_xlim(first / beyond, last * beyond)
    else:
        axes.set_xlim(first - MARGIN * (last - first), last + MARGIN * (last - first))


def _logarithmic(over: VariedSetting) -> bool:
    """Whether the values are positive numbers that span more than two decades."""
    first, last = place(over, over.values[0]), place(over, over.values[-1])
    return over.numeric and first > 0 and last / first > DECADES


def place(over: VariedSetting, value: Value) -> float:
    """Where a value stands: a number at itself, a category at its number."""
    return float(value) if over.numeric else float(over.values.index(value))


def _values(panels: Sequence[Axes], over: VariedSetting, width: float) -> None:
    """The axis of the values: each is labelled where they are few, in decades where they span many."""
    from matplotlib.ticker import FixedLocator, NullLocator

    first = panels[0]
    places = [place(over, value) for value in over.values]
    logarithmic = _logarithmic(over)
    names = [setting_text(value) for value in over.values]
    if not over.numeric:
        folds = [folded(name, 0.9 * width / len(names)) for name in names]
        first.set_xticks(places, folds)
        crowded = max(len(line) for fold in folds for line in fold.split("\n")) * LETTER > width / len(names)
        for axes in panels:
            axes.tick_params(axis="x", rotation=90 if crowded else 0)
        return
    for axes in panels:
        plain_numbers(axes.xaxis)
    if _apart(places, logarithmic, 0.75 * width, names):
        first.xaxis.set_major_locator(FixedLocator(places))
    if logarithmic:
        first.xaxis.set_minor_locator(NullLocator())


def _apart(places: Sequence[float], logarithmic: bool, width: float, names: Sequence[str]) -> bool:
    """Whether a label at every value leaves room between them."""
    from math import log

    at = [log(one) for one in places] if logarithmic else list(places)
    scale = width / (at[-1] - at[0])
    return all(
        (after - before) * scale > (len(one) + len(other) + 2) / 2 * LETTER
        for before, after, one, other in zip(at, at[1:], names, names[1:], strict=False)
    )


def _alt(panels: Panels, over: VariedSetting, label: str) -> str:
    """The ends of every line."""
    parts = []
    for title, lines in panels.items():
        ends = []
        for line in lines:
            (first, low), *_, (last, high) = [*line.averages.items()] * (1 + (len(line.averages) == 1))
            ends.append(
                f"{line.label} {number(low.value)} at {setting_text(first)} and {number(high.value)} at {setting_text(last)}"
            )
        parts.append(f"{title}: {', '.join(ends)}" if title else ", ".join(ends))
    return f"Lines by method over {over.name} with 95 % intervals, {label}. {listed(parts)}."
