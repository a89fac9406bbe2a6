"""The average over all episodes by two settings that vary, a heatmap a method with its numbers in the cells."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, ClassVar, Literal

from qinit_cli.comparison.setting_text import setting_text
from qinit_cli.errors import NotAllowed, UsageError
from qinit_cli.options import option
from qinit_cli.plots.drawn import Drawn
from qinit_cli.plots.names import METRIC_LABELS, MINUS, listed, number
from qinit_cli.plots.order import ordered
from qinit_cli.plots.plot import PLAIN, Frame, RunsPlot, Takes
from qinit_cli.plots.sensitivity import method_line, most_varied
from qinit_cli.plots.style import LETTER, TEXT, UNKNOWN_COLOUR, VALUE_COLOURS, folded, house_style

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from qinit_cli.arrays import Floats
    from qinit_cli.comparison.runs import ComparedRun
    from qinit_cli.comparison.sensitivity import Averages
    from qinit_cli.comparison.varied import VariedSetting

MOST_PANELS, MOST_VALUES = 12, 16
ROW, HEAD, LINE = 0.22, 0.75, 0.16  # inches: a row of cells, what stands about a panel, a line of text
BAR = 0.9  # inches beside the panels, of the scale of colours
MISSING = "\N{MULTIPLICATION SIGN}"
DIGITS = 6  # letters that a number takes in a cell
LIGHT = 0.6  # of the colour scale, from where on black letters are legible


@dataclass(frozen=True)
class GridPlot(RunsPlot):
    """Averages over all episodes by two settings that vary among the runs: a heatmap for each method, numbers in its cells."""

    name: ClassVar[str] = "grid"
    takes: ClassVar[Takes] = Takes(("run",), "Runs that differ in two settings", several=True)
    titled: ClassVar[str] = "none"
    heading: ClassVar[str] = "Grid"

    over: str | None = option(
        None, "The setting along the axis.", metavar="NAME", default_text="the one of most values"
    )
    by: str | None = option(
        None, "The setting up the axis.", metavar="NAME", default_text="the one of most values but that"
    )
    metric: Literal["return", "success", "steps"] = option(
        "return", "Discounted return, share of episodes that reach the goal, or min(steps, horizon)."
    )

    def of_runs(self, runs: Sequence[ComparedRun], frame: Frame = PLAIN) -> Drawn:
        """A panel for each method; what else varies is averaged over. UsageError where it would not fit."""
        from qinit_cli.comparison.sensitivity import Averages, averaged_over
        from qinit_cli.comparison.varied import VariedRuns

        varied = VariedRuns.of(runs)
        given = [] if self.by is None else [varied.named(self.by, "--by")]
        over = most_varied(varied, *given) if self.over is None else varied.named(self.over, "--over")
        by = given[0] if given else most_varied(varied, over)
        if over == by or varied.method in (over, by):
            raise UsageError(
                f"--over {over.name} --by {by.name}: methods have a panel each, and the two settings are to differ"
            )
        panels = _panels(Averages(varied, self.metric), over, by)
        if len(panels) > MOST_PANELS or max(len(over.values), len(by.values)) > MOST_VALUES:
            raise UsageError(
                f"{len(panels)} methods of {len(over.values)} by {len(by.values)} cells do not fit; {MOST_PANELS} of "
                f"{MOST_VALUES} by {MOST_VALUES} do, and qinit sensitivity prints the numbers"
            )
        label = METRIC_LABELS[self.metric]
        note = averaged_over(varied, over, by)
        with house_style():
            figure = grid(panels, over, by, label, note, frame.title or "", frame.width)
        return Drawn(
            figure,
            frame.title or f"Sensitivity to {over.name} and {by.name}, {label}",
            _alt(panels, over, by, label),
        )


def _panels(averages: Averages, over: VariedSetting, by: VariedSetting) -> dict[str, Floats]:
    """Means (by, over) of each method, NaN where there is no run; methods in their order."""
    import numpy as np

    from qinit_cli.comparison.sensitivity import sensitivity_points

    varied = averages.varied
    runs = {str(known["method"]): run for run, known in zip(varied.runs, varied.known, strict=True)}
    tables: dict[str, Floats] = {}
    for point in sensitivity_points(averages, over, [by]):
        table = tables.setdefault(point.method, np.full((len(by.values), len(over.values)), np.nan))
        row = by.values.index(dict(point.where)[by.name])
        table[row, over.values.index(point.value)] = point.average.value
    if not tables:
        raise NotAllowed(f"no run has both {over.name} and {by.name}; give runs of several values of both")
    found = ordered(method_line(label, runs[label]) for label in tables)
    return {
        line.label: tables[name] for line in found for name in tables if method_line(name, runs[name]) == line
    }


def grid(
    panels: dict[str, Floats],
    over: VariedSetting,
    by: VariedSetting,
    label: str,
    note: str,
    title: str,
    width: float = TEXT,
) -> Figure:
    """The panels in one scale of colours; cells without a run are grey and crossed. Call it within `house_style`."""
    import numpy as np
    from matplotlib.figure import Figure

    columns = max(1, min(len(panels), int((width - BAR) / (0.7 + len(over.values) * DIGITS * LETTER))))
    rows = -(-len(panels) // columns)
    beneath = folded(note, width) if note else ""
    height = rows * (len(by.values) * ROW + HEAD) + LINE * (bool(note) + bool(title))
    figure = Figure(figsize=(width, max(height, 1.6)))
    drawn = figure.subplots(rows, columns, sharex=True, sharey=True, squeeze=False)
    known = np.concatenate([table[~np.isnan(table)] for table in panels.values()])
    ends = float(known.min()), float(known.max())
    cells = (width - BAR) / columns / len(over.values)
    for axes, (name, table) in zip(drawn.flat, panels.items(), strict=False):
        image = _draw(axes, table, ends, small=cells < DIGITS * LETTER)
        axes.set_title(folded(name, width / columns), fontsize=7)
        axes.tick_params(labelbottom=True)
    for axes in drawn.flat[len(panels) :]:
        axes.remove()
    crowded = max(len(setting_text(value)) + 1 for value in over.values) * LETTER > cells
    first = drawn.flat[0]
    first.set_xticks(range(len(over.values)), [setting_text(value) for value in over.values])
    first.set_yticks(range(len(by.values)), [setting_text(value) for value in by.values])
    for axes in drawn.flat[: len(panels)]:
        axes.tick_params(length=0)
        axes.tick_params(axis="x", rotation=90 if crowded else 0)
    bar = figure.colorbar(image, ax=list(drawn.flat[: len(panels)]), label=folded(label, height), aspect=30)
    bar.outline.set_visible(False)
    figure.supylabel(by.name)
    figure.supxlabel(f"{over.name}\n{beneath}" if beneath else over.name)
    if title:
        figure.suptitle(folded(title, width))
    return figure


def _draw(axes: Axes, table: Floats, ends: tuple[float, float], *, small: bool) -> Any:
    import numpy as np

    axes.set_facecolor(UNKNOWN_COLOUR)
    image = axes.imshow(
        np.ma.masked_invalid(table),
        cmap=VALUE_COLOURS,
        vmin=ends[0],
        vmax=ends[1],
        origin="lower",
        aspect="auto",
    )
    axes.spines[:].set_visible(False)
    span = ends[1] - ends[0] or 1.0
    for (row, column), value in np.ndenumerate(table):
        missing = bool(np.isnan(value))
        dark = not missing and (value - ends[0]) / span < LIGHT
        axes.text(
            column,
            row,
            MISSING if missing else _cell(float(value)),
            ha="center",
            va="center",
            fontsize=5 if small else 6.5,
            color="white" if dark else "black",
        )
    return image


def _cell(value: float) -> str:
    """Three decimals, one of large numbers."""
    return (f"{value:.3f}" if abs(value) < 10 else f"{value:.1f}").replace("-", MINUS)


def _alt(panels: dict[str, Floats], over: VariedSetting, by: VariedSetting, label: str) -> str:
    """Each method's least and largest mean, where they stand, and how many cells have no run."""
    import numpy as np

    parts = []
    for name, table in panels.items():
        ends = []
        for word, at in (("least", np.nanargmin(table)), ("largest", np.nanargmax(table))):
            row, column = divmod(int(at), table.shape[1])
            where = f"{over.name} {setting_text(over.values[column])} and {by.name} {setting_text(by.values[row])}"
            ends.append(f"{word} {number(float(table.flat[at]))} at {where}")
        missing = int(np.isnan(table).sum())
        parts.append(f"{name}: {', '.join(ends)}" + (f", {missing} cells without a run" if missing else ""))
    return f"Heatmaps by method over {over.name} and {by.name}, {label}. {listed(parts)}."
