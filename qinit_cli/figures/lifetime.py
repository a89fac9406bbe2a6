"""What tasks earn one after another, and how the spread of what is known moves where finished tasks are added to it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from qinit_cli.figures.style import COLUMN, TEXT, line_styles, plain_numbers

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from qinit_cli.arrays import Floats, Integers

PANEL, KEY = 2.3, 0.17  # inches
SPREAD_LABEL = "sd(ln Q), median over state-actions"


@dataclass(frozen=True)
class Lived:
    """One lifetime, its tasks in order."""

    label: str
    tasks: Integers  # (T,) numbers, the first 1
    earned: Floats  # (T,) mean return of each task
    smooth: Floats  # (T,) the same, mean over the last tasks
    spread: Floats  # (T,) after each task; () long where nothing was added


def lifetime(shown: Sequence[Lived], title: str, window: int, width: float = TEXT) -> Figure:
    """Returns over the tasks' numbers, and the spread beside them where tasks were added. Call it within `house_style`."""
    from matplotlib.figure import Figure

    updated = [each for each in shown if len(each.spread)]
    beside = width > COLUMN and bool(updated)
    keys = KEY * -(-len(shown) // (3 if width > COLUMN else 1))
    rows = 1 if beside or not updated else 2
    figure = Figure(figsize=(width, rows * PANEL + keys + (0.25 if title else 0)))
    panels = figure.subplots(rows, 2 if beside else 1, squeeze=False).ravel()
    for each, look in zip(shown, line_styles(len(shown)), strict=True):
        panels[0].plot(each.tasks, each.smooth, label=each.label, **look)
        panels[0].scatter(each.tasks, each.earned, s=2, alpha=0.25, linewidths=0, color=look["color"])
        if len(each.spread):
            panels[-1].plot(each.tasks, each.spread, **look)
    panels[0].set(
        xlabel=f"task (line: mean of the last {window})", ylabel="return of a task, mean over episodes"
    )
    panels[0].set_ylim(bottom=0)
    if updated:
        panels[-1].set(xlabel="task", ylabel=SPREAD_LABEL)
    for axes in panels:
        axes.set_xlim(1, max(int(each.tasks[-1]) for each in shown))
        plain_numbers(axes.yaxis)
    handles, labels = panels[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=3 if width > COLUMN else 1)
    if title:
        figure.suptitle(title)
    return figure
