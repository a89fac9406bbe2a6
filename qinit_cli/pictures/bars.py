"""Methods side by side, a group of bars for each set of targets: the averages of `qinit compare`; Figures 6 and 9."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from qinit_cli.errors import NotAllowed
from qinit_cli.figures.style import TEXT
from qinit_cli.pictures.names import METRIC_LABELS, legible, listed, number
from qinit_cli.pictures.order import KINDS, of_kind, ordered
from qinit_store.wording import shell_line

if TYPE_CHECKING:
    from qinit_cli.analysis.intervals import Estimate
    from qinit_cli.comparison.rows import GroupComparison, Row
    from qinit_cli.comparison.runs import ComparedRun
    from qinit_cli.comparison.scores import Metric
    from qinit_cli.figures.bars import Bars
    from qinit_cli.figures.drawn import Drawn


def drawn(
    runs: Sequence[ComparedRun],
    metric: Metric = "return",
    minus: str | None = None,
    *,
    by_kind: bool = False,
    title: str | None = None,
    width: float = TEXT,
) -> Drawn:
    """Averages over all episodes with 95 % intervals, or differences to `minus` on the same targets.

    Groups in the order of the runs; `by_kind` two panels, as those of curves.
    """
    from qinit_cli.comparison import rows as compare
    from qinit_cli.comparison.source_sets import grouped
    from qinit_cli.figures import bars as drawing
    from qinit_cli.figures.drawn import Drawn
    from qinit_cli.figures.style import house_style
    from qinit_cli.pictures.groups import families, group_names

    comparisons = compare.compare(runs, minus or "", metric)
    series = ordered(_series(comparisons, minus))
    groups = grouped(runs)
    names = group_names(groups)
    label = f"{METRIC_LABELS[metric]}, minus {minus}" if minus else METRIC_LABELS[metric]
    intervals = "\n".join(dict.fromkeys(comparison.intervals for comparison in comparisons))
    panels = _apart(series) if by_kind else {"": series}
    with house_style():
        figure = drawing.bars(panels, names, intervals, label, title or "", width)
    return Drawn(figure, title or f"Bars of methods, {families(groups)}, {label}", _alt(series, names, label))


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
    from qinit_cli.analysis.intervals import Interval
    from qinit_cli.figures.bars import Bars

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
