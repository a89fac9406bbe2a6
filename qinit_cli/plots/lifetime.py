"""What tasks earn one after another: runs of `qinit lifelong`, or of `qinit transfer`, which are lifetimes without memory."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import isfinite
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

from qinit_cli.comparison.distinctions import distinctions, with_words
from qinit_cli.errors import UsageError
from qinit_cli.plots import legend
from qinit_cli.plots.drawn import Drawn
from qinit_cli.plots.names import legible, listed
from qinit_cli.plots.plot import PLAIN, Frame, Plot, Takes
from qinit_cli.plots.style import COLUMN, TEXT, house_style, line_styles, plain_numbers
from qinit_store.wording import counted

if TYPE_CHECKING:
    from pathlib import Path

    from matplotlib.figure import Figure

    from qinit_cli.arrays import Floats, Integers
    from qinit_store.reading import Artefact

MOST = 6  # lines that can be told apart
WINDOW = 20  # tasks of a running mean: single tasks differ by their distance to the goal
PANEL = 2.3  # inches
SPREAD_LABEL = "sd(ln Q), median over state-actions"
FITTED_LABEL = "sd(ln Q) as fitted"
FROZEN: dict[str, Any] = {"color": "0.3", "linestyle": (0, (1, 2)), "linewidth": 0.9}


@dataclass(frozen=True)
class LifetimePlot(Plot):
    """Return against the number of the task; where finished tasks were added (lifelong --update), the spread of
    ln Q, and what it was as fitted.
    """

    name: ClassVar[str] = "lifetime"
    takes: ClassVar[Takes] = Takes(("run",), "Runs of lifelong or transfer", several=True)
    titled: ClassVar[str] = "what is shown"

    def drawn(self, paths: Sequence[Path], frame: Frame = PLAIN) -> Drawn:
        """A line for each run, in their order, and sd(ln Q) where finished tasks were added.

        What it was as fitted is that of the fit that the run names, in the store or beside it; a note reports where that is
        missing.
        """
        from qinit_cli.artefacts.opening import describe, settings_of

        if len(paths) > MOST:
            raise UsageError(f"{len(paths)} runs do not fit; draw at most {MOST}")
        notes: list[str] = []
        words = distinctions([told for path in paths if (told := settings_of(describe(path)))])
        shown = [_lived(path, own, frame.store, notes) for path, own in zip(paths, words, strict=True)]
        own = "returns of tasks that are learned one after another"
        with house_style():
            figure = lifetime(shown, own if frame.title is None else frame.title, WINDOW, frame.width)
        return Drawn(figure, frame.title or own, _alt(shown), tuple(dict.fromkeys(notes)))


def _lived(path: Path, words: str, store: Path, notes: list[str]) -> Lived:
    import numpy as np

    from qinit_cli.analysis import returns
    from qinit_cli.artefacts.opening import open_artefact
    from qinit_cli.artefacts.settings import RunSettings

    with open_artefact(path, "run") as artefact:
        settings = RunSettings.read(artefact.spec)
        named = f"{settings.method.label}, {settings.family.label}"
        label = legible(with_words(named, words))
        gamma, columns = settings.learning.gamma, {column.name for column in artefact.schema.columns}
        rows: dict[str, Any] = {
            name: artefact.read(name) for name in ("steps", "reached", "return") if name in columns
        }
        earned = returns.earned(rows, settings.family.payment(gamma), gamma).mean(axis=1)
        updated = "log_std" in columns
        spread = artefact.read("log_std") if updated else np.empty(0)
        fitted = _as_fitted(artefact, store, notes) if updated else float("nan")
        return Lived(label, artefact.tasks + 1, earned, returns.smoothed(earned, WINDOW), spread, fitted)


def _as_fitted(run: Artefact, store: Path, notes: list[str]) -> float:
    """sd(ln Q) of the fit that the run started from; NaN, and a note, where it is not found."""
    from qinit_cli.artefacts.kinds import KINDS
    from qinit_cli.artefacts.settings import RunSettings
    from qinit_cli.pipeline.knowledge import Knowledge
    from qinit_cli.pipeline.lifelong import Known, log_std

    content = RunSettings.read(run.spec).content
    [name] = [f"{one['name']}.h5" for one in run.inputs if one["role"] == "fit"]
    for path in (store / KINDS["fit"].folder / name, run.path.with_name(name)):
        if path.exists() and (known := Knowledge.read(path)).content_sha256 == content:
            return log_std(Known.of(known.fit).log_q)
    notes.append(
        f"sd(ln Q) as fitted is not drawn: {name}, which {run.path} started from, is neither in {store} nor beside it"
    )
    return float("nan")


def _alt(shown: Sequence[Lived]) -> str:
    """What each lifetime earned in all and in its last tasks, and where its spread went."""
    parts = []
    for each in shown:
        mean, last = each.earned.mean(), each.smooth[-1]
        said = f"{each.label}: mean return {mean:.4f} over {counted(len(each.earned), 'task')}, {last:.4f} over the last"
        if len(each.spread):
            said += f", sd(ln Q) from {each.spread[0]:.3f} after the first task to {each.spread[-1]:.3f}"
        if isfinite(each.fitted):
            said += f", as fitted {each.fitted:.3f}"
        parts.append(said)
    return f"Return against the number of the task, running means of {WINDOW}. {listed(parts)}."


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
