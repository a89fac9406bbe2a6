"""`qinit start METHOD FIT -o FILE`: the start table of a method as a target would get it, for anybody's own agent."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import typer

from qinit_cli.commands.console import note, print_path
from qinit_cli.commands.option_groups import DISPLAY, IMPORTS, READING, Display, Group, Reading
from qinit_cli.commands.typer_commands import Reference, add_command, add_each
from qinit_cli.errors import UsageError
from qinit_cli.methods import METHODS, Method
from qinit_cli.options import option

if TYPE_CHECKING:
    from qinit_cli.pipeline.starts import StartTable

FORMATS = (".npz", ".npy", ".csv", ".h5")


@dataclass(frozen=True)
class StartFile:
    """Where the table goes."""

    output: str | None = option(
        None,
        "Write the table here; the ending is the format.",
        short="-o",
        metavar="FILE.npz|npy|csv|h5",
        default_text="must be given",
    )
    force: bool = option(False, "Replace a file of other content.", seldom=True)


def add_to(methods: typer.Typer, only: str | None = None) -> None:
    """Adds one subcommand per method, or that of the `only` name asked for."""
    add_each(methods, METHODS, _add, only)


def _add(methods: typer.Typer, name: str, method: type[Method]) -> None:
    add_command(
        methods,
        name,
        start,
        {
            "method": Group(method, "Method"),
            "into": Group(StartFile, "File"),
            "reading": READING,
            "display": DISPLAY,
        },
        imports=IMPORTS,
        references=(Reference("fit", "A fit: a path, a name in the store, or - for stdin."),),
        help=method.__doc__ or "",
    )


def start(fit: str, method: Method, into: StartFile, reading: Reading, display: Display) -> None:
    """Writes the table and prints the file's path."""
    from qinit_cli.commands import references
    from qinit_cli.output_file import OutputFile
    from qinit_cli.pipeline.knowledge import Knowledge
    from qinit_cli.pipeline.starts import encoded, start_table

    if into.output is None:
        raise UsageError(f"-o FILE is missing; its ending is the format, one of {', '.join(FORMATS)}")
    path = Path(into.output)
    if path.suffix not in FORMATS:
        raise UsageError(f"-o {path}: the file's ending is the format, one of {', '.join(FORMATS)}")
    given = references.one(fit, reading.store, output=into.output)
    table = start_table(Knowledge.read(given), method)
    content = encoded(table, path.suffix)
    file = OutputFile(path, into.force)
    file.check_content(content)
    if not file.settle(content):
        file.write(content)
    note(display, _sentence(method, table))
    print_path(path)


def _sentence(method: Method, table: StartTable) -> str:
    from qinit_store.wording import counted

    shape = " x ".join(str(length) for length in table.start.shape)
    told = f"{method.label}: start table of {shape}"
    if table.filled:
        told += f"; {counted(table.filled, 'state-action')} that no source knows filled"
    if table.clipped:
        told += f"; {counted(table.clipped, 'value')} clipped to [0, 1]"
    return told
