"""`qinit log`: runs handed to an experiment tracker, after the fact."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import typer

from qinit_cli.commands.console import note, print_path
from qinit_cli.commands.option_groups import DISPLAY, READING, Display, Group, Reading
from qinit_cli.commands.typer_commands import Reference, add_command
from qinit_cli.errors import UsageError
from qinit_cli.options import check, option

Tracker = Literal["mlflow", "wandb", "tensorboard"]


@dataclass(frozen=True)
class Logging:
    """Which tracker, and where in it."""

    to: Tracker | None = option(
        None,
        "The tracker; its package must be installed. wandb's runs stay here until wandb sync sends them.",
        default_text="must be given",
    )
    project: str = option(
        "qinit", "MLflow's experiment, wandb's project; in TensorBoard the names of runs begin with it."
    )
    output: str | None = option(
        None,
        "The folder; for mlflow its tracking URI, http://HOST:5000 or sqlite:///mlflow.db.",
        short="-o",
        metavar="FOLDER|URI",
        default_text="mlflow: its own; wandb: .; tensorboard: tensorboard",
    )

    def __post_init__(self) -> None:
        check(self)


def add_to(app: typer.Typer) -> None:
    """Adds the command."""
    add_command(
        app,
        "log",
        log,
        {"logging": Group(Logging, "Tracker"), "reading": READING, "display": DISPLAY},
        references=(Reference("runs", "Runs: paths, names in the store, or - for stdin.", several=True),),
        help="Hand runs to MLflow, Weights & Biases or TensorBoard: learning curves, settings, numbers; prints where they are.",
    )


def log(runs: list[str], logging: Logging, reading: Reading, display: Display) -> None:
    """Logs each run once, and prints where it is: a path, or MLflow's id of it."""
    from importlib import import_module

    from qinit_cli.artefacts.opening import open_artefact
    from qinit_cli.commands import references
    from qinit_cli.trackers.run_record import RunRecord

    if logging.to is None:
        raise UsageError("--to is missing; give mlflow, wandb or tensorboard")
    tracker = import_module(f"qinit_cli.trackers.{logging.to}")
    for path in dict.fromkeys(references.many(runs, reading.store)):
        with open_artefact(path, "run") as artefact:
            record = RunRecord.of(artefact)
        logged = tracker.log(record, logging.project, logging.output)
        if not logged.new:
            note(display, f"{record.name} is logged already")
        print_path(Path(logged.place))
