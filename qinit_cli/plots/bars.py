"""Methods side by side, a group of bars for each set of targets: the averages of `qinit compare`; Figures 6 and 9."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, ClassVar, Literal

from qinit_cli.errors import NotAllowed
from qinit_cli.options import option
from qinit_cli.plots import legend
from qinit_cli.plots.drawn import Drawn
from qinit_cli.plots.looks import Appearance, appearances
from qinit_cli.plots.names import METRIC_LABELS, families, group_names, legible, listed, number
from qinit_cli.plots.order import KINDS, of_kind, ordered
from qinit_cli.plots.plot import PLAIN, Frame, RunsPlot, Takes
from qinit_cli.plots.reported import Contents, Planned
from qinit_cli.plots.style import TEXT, folded, house_style, plain_numbers
from qinit_store.wording import shell_line

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from qinit_cli.analysis.intervals import Estimate, Interval
    from qinit_cli.comparison.rows import GroupComparison, Row
    from qinit_cli.comparison.runs import ComparedRun

GROUP = 0.84  # of the distance between groups that their bars take
ALONE, HEIGHT, LINE = 2.3, 1.9, 0.16  # inches: one panel, one of several, a line beneath

CAPTION = "Means over all episodes."


@dataclass(frozen=True)
class BarsPlot(RunsPlot):
    """Averages over all episodes by method, a group of bars for each set of targets, with 95 % intervals."""

    name: ClassVar[str] = "bars"
    takes: ClassVar[Takes] = Takes(("run",), "Runs", several=True)
    titled: ClassVar[str] = "none"
    heading: ClassVar[str] = "Bars"

    metric: Literal["return", "success", "steps"] = option(
        "return", "Discounted return, share of episodes that reach the goal, or min(steps, horizon)."
    )
    minus: str | None = option(
        None,
        "Draw differences to this method on the same targets.",
        metavar="METHOD",
        default_text="none: averages",
    )
    by_kind: bool = option(
        False,
        "Initialisations and other methods in panels of their own, with zero, optimal and logqinit-median in both.",
    )

    def of_runs(self, runs: Sequence[ComparedRun], frame: Frame = PLAIN) -> Drawn:
        """Averages, or differences to `minus` on the same targets, groups in the order of the runs."""
        from qinit_cli.comparison import rows as compare
        from qinit_cli.comparison.source_sets import grouped

        comparisons = compare.compare(runs, self.minus or "", self.metric)
        series = ordered(_series(comparisons, self.minus))
        groups = grouped(runs)
        names = group_names(groups)
        label = (
            f"{METRIC_LABELS[self.metric]}, minus {self.minus}" if self.minus else METRIC_LABELS[self.metric]
        )
        intervals = "\n".join(dict.fromkeys(comparison.intervals for comparison in comparisons))
        panels = _apart(series) if self.by_kind else {"": series}
        with house_style():
            figure = bars(panels, names, intervals, label, frame.title or "", frame.width)
        return Drawn(
            figure, frame.title or f"Bars of methods, {families(groups)}, {label}", _alt(series, names, label)
        )

    @classmethod
    def in_report(cls, contents: Contents) -> Iterator[Planned]:
        """A picture of each family's runs."""
        families: dict[str, list[ComparedRun]] = {}
        for run in contents.runs:
            families.setdefault(run.settings.family.name, []).append(run)
        for same in families.values():
            yield Planned(CAPTION, "", partial(cls().of_runs, same))


def _apart(series: Sequence[Bars]) -> dict[str, list[Bars]]:
    """The bars of either kind; NotAllowed where there are none of one."""
    panels = {kind: [bars for bars in series if of_kind(bars, kind)] for kind in KINDS}
    for kind, found in panels.items():
        if not found:
            raise NotAllowed(f"there are no runs of {kind}; draw these in one panel")
    return panels


def _alt(series: list[Bars], groups: list[str], label: str) -> str:
    """Every bar with its interval."""
    parts = []
    for at, group in enumerate(groups):
        heights = [
            f"{bars.label} {number(bars.height.estimate[at])}{_bounds(bars, at)}"
            for bars in series
            if bars.height.estimate[at] == bars.height.estimate[at]
        ]
        parts.append(f"{group.replace(chr(10), ', ')}: {', '.join(heights)}")
    return f"Bars by method with 95 % intervals, {label}. {listed(parts)}."


def _bounds(bars: Bars, at: int) -> str:
    low, high = (float(bound[at]) for bound in (bars.height.low, bars.height.high))
    return "" if low != low else f" ({number(low)} to {number(high)})"


def _series(comparisons: list[GroupComparison], baseline: str | None) -> list[Bars]:
    """One set of bars a method, with gaps where a group has no run of it."""
    import numpy as np

    from qinit_cli.analysis.intervals import Interval

    heights: dict[str, dict[int, Estimate]] = {}
    of: dict[str, Row] = {}
    for at, comparison in enumerate(comparisons):
        if baseline is not None and comparison.baseline is None:
            raise NotAllowed(
                f"{comparison.title}: no run of {baseline}; {shell_line('qinit', 'transfer', baseline, 'FIT')} makes one"
            )
        for row in comparison.rows:
            height = row.average if baseline is None else row.difference
            if height is not None:
                label = legible(f"{row.label} ({row.remark})" if row.remark else row.label)
                heights.setdefault(label, {})[at] = height
                of[label] = row
    if not heights:
        raise NotAllowed(f"there are runs of {baseline} alone; nothing differs from it")
    series = []
    for label, of_group in heights.items():
        bounds = np.full((3, len(comparisons)), np.nan)
        for at, height in of_group.items():
            bounds[:, at] = height.value, height.low, height.high
        series.append(Bars(label, Interval(*bounds), of[label].method, of[label].plus))
    return series


@dataclass(frozen=True)
class Bars:
    """One method's means over the groups, and their intervals; NaN where a group has none."""

    label: str
    height: Interval  # (G,)
    method: str = ""  # its name
    plus: bool = False  # whether it starts from another


def bars(
    panels: Mapping[str, Sequence[Bars]],
    groups: Sequence[str],
    xlabel: str,
    ylabel: str,
    title: str,
    width: float = TEXT,
) -> Figure:
    """The groups side by side, one bar a method in each; panels, by their titles, beneath each other, with one legend.

    Call it within `house_style`.
    """
    from matplotlib.figure import Figure

    labels = list(dict.fromkeys(method.label for series in panels.values() for method in series))
    own = appearances(one for series in panels.values() for one in series)
    beneath = folded(xlabel, 0.85 * width)
    several = len(panels) > 1
    height = (len(panels) * HEIGHT + 0.4 if several else ALONE) + LINE * beneath.count("\n")
    figure = Figure(figsize=(width, height + legend.height(labels, width)))
    drawn = figure.subplots(len(panels), 1, squeeze=False)[:, 0]
    for axes, (name, series) in zip(drawn, panels.items(), strict=True):
        _bars(axes, series, own, groups, width)
        axes.set_ylabel(ylabel)
        axes.set_title(name if several else title)
    drawn[-1].set_xlabel(beneath)
    figure.align_ylabels(drawn)
    if several and title:
        figure.suptitle(title)
    legend.legend(figure, labels, width)
    return figure


def _bars(
    axes: Axes, series: Sequence[Bars], own: Mapping[str, Appearance], groups: Sequence[str], width: float
) -> None:
    import numpy as np
    from matplotlib.patheffects import withStroke
    from matplotlib.ticker import MaxNLocator

    halo = [withStroke(linewidth=2.0, foreground="white")]  # or it would not be seen before a black bar
    thick = GROUP / len(series)
    for at, method in enumerate(series):
        places = np.arange(len(groups)) + (at - (len(series) - 1) / 2) * thick
        height = method.height
        axes.bar(
            places,
            height.estimate,
            thick,
            label=method.label,
            edgecolor="white",
            linewidth=0.4,
            **own[method.label].bar(),
        )
        reach = np.array([height.estimate - height.low, height.high - height.estimate])
        axes.errorbar(
            places,
            height.estimate,
            reach,
            fmt="none",
            ecolor="black",
            elinewidth=0.8,
            capsize=min(2.0, 8 * width / len(groups) * thick),
            capthick=0.8,
            path_effects=halo,
        )
    axes.axhline(0, color="black", linewidth=0.6)
    axes.set_xticks(range(len(groups)), [folded(group, 0.9 * width / len(groups)) for group in groups])
    axes.set_xlim(-0.5, len(groups) - 0.5)
    axes.tick_params(axis="x", length=0)
    axes.yaxis.set_major_locator(MaxNLocator(6, steps=[1, 2, 5, 10]))
    plain_numbers(axes.yaxis)
