"""`qinit sensitivity`: how the average changes with a setting, or what decides it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import typer

from qinit_cli.commands.option_groups import DISPLAY, READING, TABULAR, Display, Group, Reading, Tabular
from qinit_cli.commands.typer_commands import Reference, add_command
from qinit_cli.options import check, option


@dataclass(frozen=True)
class Varying:
    """Which setting is looked at."""

    over: str | None = option(
        None,
        "The setting whose values are rows, such as variance, sources.tasks, epsilon or distribution.",
        metavar="NAME",
        default_text="none: the share of each setting in the variance of the average",
    )
    metric: Literal["return", "success", "steps"] = option(
        "return", "Discounted return, share of episodes that reach the goal, or min(steps, horizon)."
    )
    greedy: bool = option(
        False, "Average the greedy evaluations (transfer --evaluate-every) instead of the episodes."
    )

    def __post_init__(self) -> None:
        check(self)


def add_to(app: typer.Typer) -> None:
    """Adds the command."""
    add_command(
        app,
        "sensitivity",
        sensitivity,
        {
            "varying": Group(Varying, "Sensitivity"),
            "tabular": TABULAR,
            "reading": READING,
            "display": DISPLAY,
        },
        references=(Reference("runs", "Runs: paths, names in the store, or - for stdin.", several=True),),
        help="Show which settings decide the average of runs, or how it changes over one, with 95 % intervals.",
    )


def sensitivity(
    runs: list[str], varying: Varying, tabular: Tabular, reading: Reading, display: Display
) -> None:
    """Prints one table: a row for each setting, or for each method at each value of one."""
    from qinit_cli.commands import references
    from qinit_cli.commands.tables import TableColumn, print_table
    from qinit_cli.comparison.runs import read_runs
    from qinit_cli.comparison.sensitivity import SCHEMA, SHARES, points_told, shares_told

    found = read_runs(references.many(runs, reading.store))
    if varying.greedy:
        found = [run.greedy() for run in found]
    if varying.over is None:
        told = shares_told(found, varying.metric)
        columns = [TableColumn(SHARES[0]), TableColumn(SHARES[1]), TableColumn(SHARES[2], digits=4)]
    else:
        told = points_told(found, varying.over, varying.metric)
        columns = [
            TableColumn("setting", dispensable=True),
            TableColumn("value"),
            TableColumn("method"),
            TableColumn("where"),
            TableColumn(varying.metric, digits=4, interval=True),
            TableColumn("sets", dispensable=True),
            TableColumn("targets", dispensable=True),
        ]
    extra = {"metric": told.metric, "about": told.about}
    print_table(SCHEMA, columns, told.rows, tabular, display, caption=told.about, extra=extra)
