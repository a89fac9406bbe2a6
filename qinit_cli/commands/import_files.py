"""`qinit import`: tables that other programs learned become sources."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import typer

from qinit_cli.commands.option_groups import DISPLAY, OUTPUT, Display, Group, Output
from qinit_cli.commands.typer_commands import Reference, add_command
from qinit_cli.errors import UsageError
from qinit_cli.importing.asked import ImportedFiles
from qinit_store.wording import counted

if TYPE_CHECKING:
    from qinit_cli.pipeline.job import Tally

SCHEMA = "qinit.import/1"


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
                "npy, npz, HDF5 (FILE.h5:/PATH) with arrays (N, *states, A); csv, tsv or parquet with a row a value; several "
                "files follow one another.",
                several=True,
            ),
        ),
        help="Import what another program learned: action values as sources, curves as runs; prints the path.",
    )


def import_files(files: list[str], asked: ImportedFiles, output: Output, display: Display) -> None:
    """Imports the files, publishes sources or runs and prints their paths."""
    from qinit_cli.commands.console import Printed
    from qinit_cli.commands.results import say_expected, say_result
    from qinit_cli.importing.runs import import_runs
    from qinit_cli.importing.tables import import_of, make_import
    from qinit_cli.pipeline.estimate import Expected

    if asked.runs:
        if output.dry_run:
            raise UsageError("--dry-run estimates imports of tables only; leave it out with --runs")
        if output.output is not None and len(files) > 1:
            raise UsageError(
                f"-o names one file, and {len(files)} files make a run each at least; leave out -o and they go into the store"
            )
        for file in files:
            for method, made in import_runs(Path(file), asked, output.keeping):
                say_result(made, SCHEMA, _of_curves(method, made.tally), output, display)
        return
    if output.dry_run:
        wanted = import_of(files, asked)
        target, size = wanted.target(output.keeping), wanted.schema.task_bytes * wanted.settings.tasks
        say_expected(Expected(str(target), wanted.settings.tasks, 0, 0, 0.0, size), output, display)
        return
    made = make_import(files, asked, output.keeping, Printed(display))
    say_result(made, SCHEMA, _of_tables(made.tally, len(files)), output, display)


def _of_curves(method: str, tally: Tally) -> str:
    done = "already complete" if tally.skipped else "imported"
    return f"{method}: {counted(tally.tasks, 'learning curve')} {done}"


def _of_tables(tally: Tally, files: int) -> str:
    if tally.skipped:
        return f"{counted(tally.tasks, 'table')} already complete"
    told = f"{counted(tally.tasks, 'table')} imported from {counted(files, 'file')}"
    unknown = tally.extra["unknown"]
    return f"{told}; {counted(unknown, 'entry', 'entries')} without a value: unknown" if unknown else told
