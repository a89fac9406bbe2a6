"""`qinit plot bars`: methods side by side, one group of bars for each set of targets."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

import typer

from qinit_cli.commands.build import Group, Reference, add_command
from qinit_cli.commands.groups import DISPLAY, READING, Display, Reading
from qinit_cli.commands.plot.picture import METRIC_LABELS, Picture, Usual, distinct, distribution, publish
from qinit_cli.errors import NotAllowed
from qinit_cli.fields import check, option

if TYPE_CHECKING:
    from qinit_cli.figures.bars import Bars
    from qinit_cli.stages.compare import Comparison, Estimate
    from qinit_cli.stages.source_sets import Group as SharedTargets

USUAL = Usual("bars", "text", "none")


@dataclass(frozen=True)
class Barring:
    """What the bars show."""

    metric: Literal["return", "success", "steps"] = option(
        "return", "Discounted return, share of episodes that reach the goal, or min(steps, horizon)."
    )
    minus: str | None = option(
        None,
        "Draw differences to this method on the same targets.",
        metavar="METHOD",
        default_text="none: averages",
    )

    def __post_init__(self) -> None:
        check(self)


def add_to(plots: typer.Typer) -> None:
    """Adds the picture."""
    add_command(
        plots,
        "bars",
        bars,
        {"picture": USUAL.group, "barring": Group(Barring, "Bars"), "reading": READING, "display": DISPLAY},
        references=(Reference("runs", "Runs: paths, names in the store, or - for stdin.", several=True),),
        help="Averages over all episodes by method, a group of bars for each set of targets, with 95 % intervals.",
    )


def bars(runs: list[str], picture: Picture, barring: Barring, reading: Reading, display: Display) -> None:
    """Draws the picture and prints its path; groups and methods stand in the order of the runs."""
    from qinit_cli.commands.compare import read_runs
    from qinit_cli.figures import bars as drawing
    from qinit_cli.figures.style import house_style
    from qinit_cli.stages import compare as stage
    from qinit_cli.stages.source_sets import grouped

    path = USUAL.path(picture)
    found = read_runs(runs, reading.store)
    comparisons = stage.compare(found, barring.minus or "", barring.metric)
    label = METRIC_LABELS[barring.metric]
    with house_style():
        figure = drawing.bars(
            _series(comparisons, barring.minus),
            _groups(grouped(found)),
            "\n".join(dict.fromkeys(comparison.intervals for comparison in comparisons)),
            f"{label}, minus {barring.minus}" if barring.minus else label,
            picture.title or "",
            USUAL.inches(picture),
        )
        publish(figure, path)


def _series(comparisons: list[Comparison], baseline: str | None) -> list[Bars]:
    """One set of bars a method, with gaps where a group has no run of it."""
    import numpy as np

    from qinit_cli.analysis.intervals import Interval
    from qinit_cli.figures.bars import Bars

    heights: dict[str, dict[int, Estimate]] = {}
    for at, comparison in enumerate(comparisons):
        if baseline is not None and comparison.baseline is None:
            raise NotAllowed(
                f"{comparison.title}: no run of {baseline}; qinit transfer {baseline} FIT makes one"
            )
        for row in comparison.rows:
            height = row.average if baseline is None else row.difference
            if height is not None:
                label = f"{row.label} ({row.remark})" if row.remark else row.label
                heights.setdefault(label, {})[at] = height
    if not heights:
        raise NotAllowed(f"there are runs of {baseline} alone; nothing differs from it")
    series = []
    for label, of_group in heights.items():
        bounds = np.full((3, len(comparisons)), np.nan)
        for at, height in of_group.items():
            bounds[:, at] = height.mean, height.low, height.high
        series.append(Bars(label, Interval(*bounds)))
    return series


def _groups(groups: list[SharedTargets]) -> list[str]:
    """What stands beneath each group: the distribution, and the seed of its targets where there are several of it."""
    from qinit_cli.environments import family_of

    runs = [group.any_run for group in groups]
    families = [family_of(run.spec) for run in runs]
    return distinct(
        [distribution(family.name, family.label) for family in families],
        [f"seed {run.spec['seed']}" for run in runs],
        [f"targets {run.target_digest[:8]}" for run in runs],
    )
