"""What a study shows where its file names no table and no picture."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING

from qinit_cli.options import key_of, options
from qinit_cli.study.given import Given
from qinit_cli.study.planned import Metric, PlannedPicture, PlannedRun, PlannedShares, PlannedTable, Shown
from qinit_cli.study.showing import baseline_of, cut, family_of, metric_of, once, sizes

if TYPE_CHECKING:
    from qinit_cli.plots import Plot
    from qinit_cli.study.combining import Selectable

# what intervals are over, and how many targets
NO_SETTINGS = ("seed", "sources.seed", "targets.seed", "targets.tasks")


def usual(planned: Sequence[Selectable], study: Given) -> Iterator[Shown]:
    """Curves, bars and a table of all runs, then what the settings that vary decide."""
    from qinit_cli.plots.bars import BarsPlot
    from qinit_cli.plots.curves import CurvesPlot

    runs = once(
        one for one in sorted(planned, key=lambda one: one.place) if isinstance(one.artefact, PlannedRun)
    )
    if not runs:
        return
    metric, baseline = metric_of(study) or "return", baseline_of(study, planned) or "zero"
    # runs that learn otherwise stand in tables and pictures of their own
    apart = list(cut(runs, "targets"))
    for kind in (CurvesPlot, BarsPlot):
        for ending, those in apart:
            yield _picture(f"{kind.name}{ending}", kind(), those, ending[1:])
    for ending, those in apart:
        title = f"Methods on the same targets{f', {ending[1:]}' if ending else ''}"
        yield PlannedTable(f"compare{ending}", "compare", _runs(those), title, None, baseline, metric)
    yield from _sensitivity(runs, metric)


def _sensitivity(runs: Sequence[Selectable], metric: Metric) -> Iterator[Shown]:
    """A picture for each number that varies, one for the first two of them, ranks over distributions, and the shares."""
    from qinit_cli.plots.grid import GridPlot
    from qinit_cli.plots.ranks import FEWEST, RanksPlot
    from qinit_cli.plots.sensitivity import MOST_IN_REPORT, NO_PANELS, SensitivityPlot

    varied = _varied(runs)
    distributions = {family_of(one.artefact) for one in runs}
    methods = {one.artefact.method.label for one in runs if isinstance(one.artefact, PlannedRun)}
    for name, values in varied.items():
        others = math.prod(len(other) for key, other in varied.items() if key != name)
        panels = None if max(others, len(distributions) // len(values)) <= MOST_IN_REPORT else NO_PANELS
        plot = SensitivityPlot(over=name, panels=panels, metric=metric)
        yield _picture(f"sensitivity-{name.replace('.', '-')}", plot, runs, optional=True)
    if len(varied) > 1:
        over, by = list(varied)[:2]
        yield _picture("grid", GridPlot(over=over, by=by, metric=metric), runs, optional=True)
    if min(len(distributions), len(methods)) >= FEWEST:
        yield _picture("ranks", RanksPlot(metric=metric), runs, optional=True)
    if varied:
        yield PlannedShares(_runs(runs), metric)


def _varied(runs: Sequence[Selectable]) -> dict[str, list[float]]:
    """The settings of distributions, sources, fits and targets that are numbers and vary, by the names that `--over` has."""
    found: dict[str, dict[float, None]] = {}
    for one in runs:
        of_method = _options_of_method(one)
        for name, value in one.settings:
            if name not in NO_SETTINGS and name not in of_method and _is_number(value):
                found.setdefault(name.removeprefix("targets."), {})[float(value)] = None
    return {name: list(values) for name, values in found.items() if len(values) > 1}


def _options_of_method(one: Selectable) -> set[str]:
    kind = type(one.artefact.method) if isinstance(one.artefact, PlannedRun) else None
    return set() if kind is None else {key_of(each.name) for each in options(kind)}


def _is_number(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)


def _picture(
    name: str, plot: Plot, those: Sequence[Selectable], of: str = "", *, optional: bool = False
) -> PlannedPicture:
    artefacts = tuple(one.artefact for one in those)
    caption = f"{of}; {sizes(those)}." if of else f"{sizes(those)}."
    return PlannedPicture(name, plot.name, plot, artefacts, None, caption, optional)


def _runs(those: Sequence[Selectable]) -> tuple[PlannedRun, ...]:
    return tuple(one.artefact for one in those if isinstance(one.artefact, PlannedRun))
