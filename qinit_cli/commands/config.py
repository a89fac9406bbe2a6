"""`qinit config`: which settings hold, and where they come from."""

from __future__ import annotations

import os
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import typer

from qinit_cli import configuration
from qinit_cli.commands.console import note
from qinit_cli.commands.option_groups import DISPLAY, TABULAR, Display, Group, Tabular
from qinit_cli.commands.typer_commands import add_command, option_names, walk
from qinit_cli.options import option


@dataclass(frozen=True)
class ConfigListing:
    """What is listed."""

    origin: bool = option(False, "Say where each value comes from.")
    all: bool = option(False, "Every option of every command, those at their default too.")


def add_to(app: typer.Typer) -> None:
    """Adds the command."""
    add_command(
        app,
        "config",
        config,
        {"listing": Group(ConfigListing, "Settings"), "tabular": TABULAR, "display": DISPLAY},
        help="Show what QINIT_* variables and qinit.toml files set, and where each value comes from.",
        in_context=True,
    )


def config(context: typer.Context, listing: ConfigListing, tabular: Tabular, display: Display) -> None:
    """Prints one row per option that is set somewhere."""
    from qinit_cli.commands.tables import TableColumn, print_table

    root = context.find_root().command
    found = configuration.settings(option_names(root))
    rows = [row for row in _rows(root, found) if listing.all or row["origin"] != "default"]
    columns = [TableColumn("command"), TableColumn("option"), TableColumn("value")]
    if listing.origin:
        columns.append(TableColumn("origin"))
    print_table("qinit.config/1", columns, rows, tabular, display)
    if not rows:
        read = ", ".join(map(str, configuration.files())) or "no qinit.toml, here or of the user"
        note(display, f"every option is at its default ({read}; no QINIT_* variable)")


def _rows(root: Any, found: list[configuration.Configured]) -> Iterator[dict[str, Any]]:
    for command, parameters in walk(root):
        for parameter in parameters:
            variable = configuration.PREFIX + parameter.name.upper()
            setting = configuration.chosen(command, parameter.name, found)
            if variable in os.environ:
                value, origin = os.environ[variable], variable
            elif setting is not None:
                value, origin = setting.value, _spelled(setting.origin)
            else:
                value, origin = parameter.default, "default"
            yield {
                "command": " ".join(command),
                "option": parameter.name.replace("_", "-"),
                "value": value,
                "origin": origin,
            }


def _spelled(path: Path) -> str:
    return f"./{path}" if path == configuration.LOCAL else str(path)
