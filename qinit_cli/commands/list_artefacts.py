"""`qinit list`: what is in the store."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import typer

from qinit_cli.commands.build import add_command
from qinit_cli.commands.groups import DISPLAY, READING, TABULAR, Display, Reading, Tabular
from qinit_cli.commands.messages import note

if TYPE_CHECKING:
    from store.reading import Description


def add_to(app: typer.Typer) -> None:
    """Adds the command."""
    add_command(
        app,
        "list",
        list_artefacts,
        {"tabular": TABULAR, "reading": READING, "display": DISPLAY},
        help="List the artefacts in the store, and unfinished work with the command that goes on with it.",
    )


def list_artefacts(tabular: Tabular, reading: Reading, display: Display) -> None:
    """Prints one row per artefact."""
    from pathlib import Path

    from qinit_cli.commands.tables import TableColumn, print_table
    from store.catalog import Store

    entries = list(Store(Path(reading.store)).entries())
    columns = [
        TableColumn("kind"),
        TableColumn("name"),
        TableColumn("family", dispensable=True),
        TableColumn("tasks"),
        TableColumn("made"),
        TableColumn("megabytes", "MB", 2, dispensable=True),
        TableColumn("state"),
    ]
    print_table("qinit.list/1", columns, [_row(entry) for entry in entries], tabular, display)
    if not entries:
        note(display, f"{reading.store} holds no artefacts; qinit train-sources makes the first")
    for entry in entries:
        if entry.state == "unfinished" and (command := entry.provenance.get("command")):
            note(display, f"to go on with {entry.path.stem}: {command}")


def _row(entry: Description) -> dict[str, Any]:
    settings = entry.spec.get("sources", entry.spec)  # a fit keeps its sources' settings
    return {
        "kind": entry.kind,
        "name": entry.path.stem,
        "family": settings.get("family", {}).get("name", ""),
        "tasks": entry.tasks or settings.get("tasks"),
        "made": entry.provenance.get("time", "")[:16].replace("T", " "),
        "megabytes": entry.size / 1e6,
        "state": entry.state if not entry.problem else f"{entry.state}: {entry.problem}",
    }
