"""`qinit verify`: whether artefacts are what was written."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import typer

from qinit_cli.commands.option_groups import DISPLAY, READING, TABULAR, Display, Reading, Tabular
from qinit_cli.commands.typer_commands import Reference, add_command

if TYPE_CHECKING:
    from qinit_store.verify import Verification

OPENING = "qinit_cli.artefacts.opening:open_doubtful"


def add_to(app: typer.Typer) -> None:
    """Adds the command."""
    add_command(
        app,
        "verify",
        verify,
        {"tabular": TABULAR, "reading": READING, "display": DISPLAY},
        references=(
            Reference("artefacts", "Artefacts: paths, names in the store, or - for stdin.", several=True),
        ),
        help="Check every digest of artefacts, in a process with limited memory and time; exit code 6 for damage.",
    )


def verify(artefacts: list[str], tabular: Tabular, reading: Reading, display: Display) -> None:
    """Prints one row per artefact; Damaged for the first that does not hold, once all were read."""
    from qinit_cli.commands import references
    from qinit_cli.commands.console import reading as in_progress
    from qinit_cli.commands.tables import TableColumn, print_table
    from qinit_store.verify import verify as examine

    verdicts = []
    for path in references.many(artefacts, reading.store):
        with in_progress(display, f"verifying {path.name}") as told:
            verdicts.append(examine(path, opening=OPENING, told=told))
    columns = [
        TableColumn("artefact"),
        TableColumn("kind"),
        TableColumn("tasks"),
        TableColumn("state"),
        TableColumn("damaged_tasks", "damaged"),
        TableColumn("detail", dispensable=True),
    ]
    print_table("qinit.verify/1", columns, [_row(verdict) for verdict in verdicts], tabular, display)
    for verdict in verdicts:
        verdict.raise_if_damaged()


def _row(verdict: Verification) -> dict[str, Any]:
    return {
        "artefact": str(verdict.path),
        "kind": verdict.kind,
        "tasks": verdict.tasks,
        "state": verdict.state,
        "damaged_tasks": " ".join(map(str, verdict.damaged)),
        "detail": verdict.problem or verdict.content_sha256,
    }
