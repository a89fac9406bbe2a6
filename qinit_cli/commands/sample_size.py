"""`qinit sample-size`: how many sources MaxQInit asks for."""

from __future__ import annotations

from dataclasses import dataclass

import typer

from qinit_cli.commands.option_groups import DISPLAY, TABULAR, Display, Group, Tabular
from qinit_cli.commands.typer_commands import add_command
from qinit_cli.errors import UsageError
from qinit_cli.options import check, option


@dataclass(frozen=True)
class Sampling:
    """What must be sampled, and how surely."""

    p_min: float = option(0.01, "Probability of the least likely task.", above=0, high=1)
    delta: float = option(0.05, "Probability that it is missed after all.", above=0, below=1)
    targets: int | None = option(
        None, "How many tasks must all be sampled.", low=1, default_text="as many as p-min allows, 1 / p-min"
    )

    def __post_init__(self) -> None:
        check(self)


def add_to(app: typer.Typer) -> None:
    """Adds the command."""
    add_command(
        app,
        "sample-size",
        sample_size,
        {"sampling": Group(Sampling, "Sampling"), "tabular": TABULAR, "display": DISPLAY},
        help="Source tasks that MaxQInit needs: m >= ln(delta) / ln(1 - p_min) (Abel et al., 2018).",
    )


def sample_size(sampling: Sampling, tabular: Tabular, display: Display) -> None:
    """Prints the bound for one given task, and the one that covers every task."""
    from qinit_cli.analysis.sample_size import tasks_for_all_targets, tasks_for_one_target
    from qinit_cli.commands.tables import TableColumn, print_table

    try:
        one = tasks_for_one_target(sampling.p_min, sampling.delta)
        tasks = sampling.targets or int(1 / sampling.p_min + 1e-9)
        every = tasks_for_all_targets(sampling.p_min, sampling.delta, tasks)
    except ValueError as error:
        raise UsageError(str(error)) from error
    bounds = {"one given task": (1, one), "every task": (tasks, every)}
    rows = [
        {
            "covers": covers,
            "tasks": count,
            "sources": sources,
            "p_min": sampling.p_min,
            "delta": sampling.delta,
        }
        for covers, (count, sources) in bounds.items()
    ]
    columns = [TableColumn(name) for name in ("covers", "tasks", "sources", "p_min", "delta")]
    caption = "one given task: ln(delta)/ln(1 - p_min); every task: ln(delta/tasks)/ln(1 - p_min)"
    print_table("qinit.sample-size/1", columns, rows, tabular, display, caption=caption)
