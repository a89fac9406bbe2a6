"""`qinit import`: tables that other programs learned become sources."""

from __future__ import annotations

import typer

from qinit_cli.commands.option_groups import DISPLAY, OUTPUT, Display, Group, Output
from qinit_cli.commands.typer_commands import Reference, add_command
from qinit_cli.importing.asked import ImportedFiles
from qinit_store.wording import counted


def add_to(app: typer.Typer) -> None:
    """Adds the command."""
    add_command(
        app,
        "import",
        import_files,
        {"asked": Group(ImportedFiles, "Tables"), "output": OUTPUT, "display": DISPLAY},
        references=(
            Reference(
                "files",
                "Files: npy, npz, HDF5 (FILE.h5:/PATH), csv, tsv or parquet; (N, *states, A), or a file for each task.",
                several=True,
            ),
        ),
        help="Import tables of action values that another program learned, as sources; prints the path.",
    )


def import_files(files: list[str], asked: ImportedFiles, output: Output, display: Display) -> None:
    """Imports the files, publishes the sources and prints their path."""
    from qinit_cli.commands.console import Printed
    from qinit_cli.commands.results import say_result
    from qinit_cli.importing.tables import make_import

    made = make_import(files, asked, output.keeping, Printed(display))
    say_result(
        made, "qinit.import/1", _sentence(made.tally.tasks, made.tally.extra, len(files)), output, display
    )


def _sentence(tasks: int, extra: dict[str, int], files: int) -> str:
    if "unknown" not in extra:
        return f"{counted(tasks, 'table')}: already complete"
    told = f"{counted(tasks, 'table')} imported from {counted(files, 'file')}"
    return (
        f"{told}; {counted(extra['unknown'], 'entry', 'entries')} without a value are unknown"
        if extra["unknown"]
        else told
    )
