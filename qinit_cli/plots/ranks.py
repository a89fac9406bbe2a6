"""Mean ranks of methods over distributions, those that are not distinguished joined: a critical-difference diagram."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, ClassVar, Literal

from qinit_cli.options import option
from qinit_cli.plots.drawn import Drawn
from qinit_cli.plots.names import METRIC_LABELS, listed
from qinit_cli.plots.plot import PLAIN, Frame, RunsPlot, Takes
from qinit_cli.plots.reported import Contents, Planned
from qinit_cli.plots.style import LETTER, TEXT, folded, house_style

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from qinit_cli.analysis.ranks import RankComparison
    from qinit_cli.comparison.runs import ComparedRun

FEWEST = 3  # methods, and distributions, of a picture that nobody asked for by name
ROW, HEAD, BAR = 0.2, 0.62, 0.13  # inches: a method's line, what stands above, a bar of a group
LINE = 0.16  # inches, a line of text

CAPTION = "Mean ranks over distributions, 1 the best, of averages over source sets and targets."


@dataclass(frozen=True)
class RanksPlot(RunsPlot):
    """Mean ranks of methods over distributions; bars join methods that Wilcoxon's signed-rank test with Holm's correction
    does not tell apart.
    """

    name: ClassVar[str] = "ranks"
    takes: ClassVar[Takes] = Takes(("run",), "Runs of several methods on several distributions", several=True)
    titled: ClassVar[str] = "none"
    heading: ClassVar[str] = "Ranks"

    metric: Literal["return", "success", "steps"] = option(
        "return", "Discounted return, share of episodes that reach the goal, or min(steps, horizon)."
    )

    def of_runs(self, runs: Sequence[ComparedRun], frame: Frame = PLAIN) -> Drawn:
        """The mean rank of each method, rank 1 the best by the metric."""
        from qinit_cli.comparison.sensitivity import Averages, ranked
        from qinit_cli.comparison.varied import VariedRuns

        varied = VariedRuns.of(runs)
        methods, distributions, found = ranked(Averages(varied, self.metric))
        said = rank_words(found)
        label = METRIC_LABELS[self.metric]
        with house_style():
            figure = ranks(methods, found, f"mean rank by {label}", said, frame.title or "", frame.width)
        left_out = [one for one in map(str, varied.distribution.values) if one not in distributions]
        notes = [f"{one} is left out: not every method was run on it" for one in left_out]
        order = sorted(zip(found.mean_ranks, methods, strict=True))
        places = listed([f"{method} {rank:.2f}" for rank, method in order])
        alt = f"Mean ranks over {len(distributions)} distributions by {label}: {places}. {said}."
        return Drawn(figure, frame.title or f"Ranks of methods, {label}", alt, tuple(notes))

    @classmethod
    def in_report(cls, contents: Contents) -> Iterator[Planned]:
        """One picture, where there are methods and distributions enough."""
        from qinit_cli.comparison.varied import VariedRuns

        if contents.runs:
            varied = VariedRuns.of(contents.runs)
            if min(len(varied.method.values), len(varied.distribution.values)) >= FEWEST:
                yield Planned(CAPTION, "", partial(cls().of_runs, contents.runs))


def rank_words(found: RankComparison) -> str:
    """What the tests say, and why they say nothing where the blocks are too few."""
    from qinit_cli.analysis.ranks import LEVEL

    over = f"{found.blocks} distributions"
    friedman = (
        ""
        if math.isnan(found.friedman)
        else f"Friedman over {over}: chi-squared {found.friedman:.2f}, p {_probability(found.friedman_p)}; "
    )
    if not found.tested:
        return (
            f"{friedman}no pair is tested: with {over} Wilcoxon's signed-rank test with Holm's correction over all pairs "
            f"cannot come to {LEVEL:g}, with {found.fewest_blocks} it can"
        )
    if not math.isnan(found.friedman) and found.friedman_p >= LEVEL:
        return f"{friedman}no method is distinguished from another"
    return f"{friedman}bars join methods that Wilcoxon's signed-rank test, Holm over all pairs, does not tell apart at {LEVEL:g}"


def _probability(p: float) -> str:
    return "< 0.0001" if p < 0.0001 else f"{p:.4f}"


def ranks(
    methods: Sequence[str], found: RankComparison, label: str, said: str, title: str, width: float = TEXT
) -> Figure:
    """The axis of ranks above, the better half of the methods named at its left, and bars. Call it within `house_style`."""
    from matplotlib.figure import Figure

    count = len(methods)
    order = sorted(range(count), key=lambda at: found.mean_ranks[at])
    groups = found.alike() if found.tested else []
    note = folded(said, 0.95 * width)
    levels = -(-count // 2)
    tall = HEAD + BAR * len(groups) + ROW * levels
    beneath = LINE * (2 + note.count("\n"))
    above = LINE * 1.3 * (1 + folded(title, width).count("\n")) if title else 0.05
    height = tall + beneath + above
    figure = Figure(figsize=(width, height))
    figure.set_layout_engine("none")  # all stands in inches
    axes = figure.add_axes((0.0, beneath / height, 1.0, tall / height))
    axes.set_xlim(0, width)
    axes.set_ylim(tall, 0)  # inches downwards
    axes.axis("off")
    names = max(len(name) + 6 for name in methods) * LETTER
    side = min(names, 0.36 * width)
    left, right = side + 0.1, width - side - 0.1

    def across(rank: float) -> float:
        return left + (rank - 1) / (count - 1) * (right - left)

    _axis(axes, count, label, left, right)
    for level, group in enumerate(groups):
        y = HEAD + BAR * (level + 0.35)
        ends = [across(found.mean_ranks[at]) for at in (group[0], group[-1])]
        axes.plot([ends[0] - 0.04, ends[1] + 0.04], [y, y], color="black", linewidth=3, solid_capstyle="butt")
    for at, method in enumerate(order):
        better = at < levels
        row = at if better else count - 1 - at
        y = HEAD + BAR * len(groups) + ROW * (row + 0.5)
        x, end = across(found.mean_ranks[method]), left - 0.04 if better else right + 0.04
        axes.plot([x, x, end], [HEAD - 0.12, y, y], color="#595959", linewidth=0.8)
        axes.plot([x], [HEAD - 0.12], marker="o", markersize=3.2, color="black")
        name = folded(methods[method], side, least=24)
        rank = f"{found.mean_ranks[method]:.2f}"
        words, where = (f"{name}  {rank}", "right") if better else (f"{rank}  {name}", "left")
        axes.text(end - 0.04 if better else end + 0.04, y, words, ha=where, va="center", fontsize=7)
    figure.text(0.5, 0.03 / height, note, ha="center", va="bottom", fontsize=7)
    if title:
        figure.suptitle(folded(title, width), y=1 - 0.04 / height, va="top")
    return figure


def _axis(axes: Axes, count: int, label: str, left: float, right: float) -> None:
    y = HEAD - 0.12
    axes.plot([left, right], [y, y], color="black", linewidth=0.8)
    for rank in range(1, count + 1):
        x = left + (rank - 1) / (count - 1) * (right - left)
        axes.plot([x, x], [y - 0.06, y], color="black", linewidth=0.8)
        axes.text(x, y - 0.08, str(rank), ha="center", va="bottom", fontsize=7)
    axes.text((left + right) / 2, 0.02, label, ha="center", va="top", fontsize=8)
