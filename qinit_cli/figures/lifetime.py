"""What tasks earn one after another, and how the spread of what is known moves where finished tasks are added to it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import isfinite
from typing import TYPE_CHECKING, Any

from qinit_cli.figures import legend
from qinit_cli.figures.style import COLUMN, TEXT, line_styles, plain_numbers

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from qinit_cli.arrays import Floats, Integers

PANEL = 2.3  # inches
SPREAD_LABEL = "sd(ln Q), median over state-actions"
FITTED_LABEL = "sd(ln Q) as fitted"
FROZEN: dict[str, Any] = {"color": "0.3", "linestyle": (0, (1, 2)), "linewidth": 0.9}


@dataclass(frozen=True)
class Lived:
    """One lifetime, its tasks in order."""

    label: str
    tasks: Integers  # (T,) numbers, the first 1
    earned: Floats  # (T,) mean return of each task
    smooth: Floats  # (T,) the same, mean over the last tasks
    spread: Floats  # (T,) after each task; () long where nothing was added
    fitted: float = float("nan")  # the same before the first; NaN where nobody knows


def lifetime(shown: Sequence[Lived], title: str, window: int, width: float = TEXT) -> Figure:
    """Returns over the tasks' numbers, and the spread beside them where tasks were added. Call it within `house_style`."""
    from matplotlib.figure import Figure
    from matplotlib.ticker import MaxNLocator

    updated = [each for each in shown if len(each.spread)]
    frozen = [each.fitted for each in updated if isfinite(each.fitted)]
    beside = width > COLUMN and bool(updated)
    labels = [each.label for each in shown] + [FITTED_LABEL] * bool(frozen)
    rows = 1 if beside or not updated else 2
    height = rows * PANEL + legend.height(labels, width) + (0.25 if title else 0)
    figure = Figure(figsize=(width, height))
    panels = figure.subplots(rows, 2 if beside else 1, squeeze=False).ravel()
    handles = []
    for each, look in zip(shown, line_styles(len(shown)), strict=True):
        handles += panels[0].plot(each.tasks, each.smooth, label=each.label, **look)
        dots = {"s": 2, "alpha": 0.25, "linewidths": 0, "color": look["color"]}
        panels[0].scatter(each.tasks, each.earned, clip_on=False, **dots)  # whole at the edges too
        if len(each.spread):
            panels[-1].plot(each.tasks, each.spread, **look)
        if isfinite(each.fitted):
            alone = frozen.count(each.fitted) == 1
            panels[-1].axhline(each.fitted, **FROZEN | ({"color": look["color"]} if alone else {}))
    panels[0].set(
        xlabel=f"task (line: mean of the last {window})", ylabel="return of a task, mean over episodes"
    )
    panels[0].set_ylim(bottom=0)
    if updated:
        panels[-1].set(xlabel="task", ylabel=SPREAD_LABEL)
    if frozen:
        handles += panels[-1].plot([], [], **FROZEN)
    for axes in panels:
        axes.set_xlim(0.5, max(int(each.tasks[-1]) for each in shown) + 0.5)
        axes.xaxis.set_major_locator(MaxNLocator(6, integer=True, steps=[1, 2, 5, 10]))
        plain_numbers(axes.yaxis)
    columns = legend.columns(labels, width)
    figure.legend(handles, labels, loc="outside lower center", ncols=columns, handlelength=legend.SWATCH)
    if title:
        figure.suptitle(title)
    return figure
