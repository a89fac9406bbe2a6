"""`qinit export`: artefacts as files for other programs."""

from __future__ import annotations

import io
import json
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import IO, TYPE_CHECKING, Literal, cast, get_args

import typer

from qinit_cli.artefacts.kinds import KINDS
from qinit_cli.commands.console import note, print_path
from qinit_cli.commands.option_groups import DISPLAY, READING, Display, Group, Reading
from qinit_cli.commands.typer_commands import Reference, add_command
from qinit_cli.errors import NotAllowed, UsageError
from qinit_cli.nearest import nearest
from qinit_cli.options import check, option
from qinit_cli.output_file import OutputFile

if TYPE_CHECKING:
    from qinit_cli.artefacts.kind import Field
    from qinit_store.reading import Artefact

Format = Literal["csv", "parquet", "nc", "npz", "json"]
TEXT = ("csv", "json")  # what may go to stdout
LONG = ("csv", "parquet")  # one long table; the others hold arrays by name
STDOUT = "-"


@dataclass(frozen=True)
class Exporting:
    """What is written, and where."""

    to: Format | None = option(
        None,
        "csv and parquet hold one long table; nc (NetCDF-4), npz and json arrays by name.",
        default_text="the ending of -o",
    )
    what: str | None = option(
        None,
        "The table. "
        + " ".join(f"{kind.several.capitalize()}: {', '.join(kind.tables)}." for kind in KINDS.values()),
        metavar="TABLE",
        default_text="the first of these; for nc, npz and json everything",
    )
    output: str | None = option(
        None,
        "Write here; - is stdout, for csv and json.",
        short="-o",
        metavar="FILE",
        default_text="stdout in a pipe",
    )
    force: bool = option(False, "Replace a file of that name with other content.")

    def __post_init__(self) -> None:
        check(self)

    @property
    def format(self) -> Format:
        """As asked for, else by the file's ending; UsageError without either."""
        ending = Path(self.output or "").suffix.lstrip(".").lower()
        if self.to is None and ending not in get_args(Format):
            raise UsageError(
                "the format is missing; give --to csv, parquet, nc, npz or json, or -o with such an ending"
            )
        return self.to or cast(Format, ending)

    @property
    def destination(self) -> Path | None:
        """The file, None for stdout; UsageError where stdout cannot take it or a folder is there."""
        if self.output in (None, STDOUT):
            if self.format not in TEXT:
                raise UsageError(f"{self.format} is no text for stdout; give a file: -o FILE.{self.format}")
            if self.output is None and sys.stdout.isatty():
                raise UsageError(
                    f"this would fill the terminal; give a file, -o FILE.{self.format}, or -o - to see it"
                )
            return None
        path = Path(str(self.output))
        if path.is_dir():
            raise UsageError(f"-o {self.output}: that is a folder")
        return path


def add_to(app: typer.Typer) -> None:
    """Adds the command."""
    add_command(
        app,
        "export",
        export,
        {"exporting": Group(Exporting, "Export"), "reading": READING, "display": DISPLAY},
        references=(Reference("artefacts", "Paths, names in the store, or - for stdin.", several=True),),
        help="Write artefacts as csv, parquet, NetCDF, npz or json for other programs.",
    )


def export(artefacts: list[str], exporting: Exporting, reading: Reading, display: Display) -> None:
    """Writes one file, and prints its path; or writes to stdout."""
    from qinit_cli.artefacts import formats
    from qinit_cli.commands import references

    format, destination = exporting.format, exporting.destination
    if format == "parquet":
        formats.pyarrow()  # before anything is read
    paths = list(dict.fromkeys(references.many(artefacts, reading.store, output=destination)))
    table, fields = _table(paths, format, exporting.what)
    if destination is None:
        _write_text(sys.stdout, paths, format, table, fields)
        return
    file = OutputFile(destination, exporting.force)
    file.check()
    destination.parent.mkdir(parents=True, exist_ok=True)
    if format == "csv":
        _write_with_about(file, paths, str(table), fields, display)
    else:
        _write(file, paths, format, table, fields)
    print_path(destination)


def _write(
    destination: OutputFile, paths: list[Path], format: Format, table: str | None, fields: list[Field]
) -> None:
    from qinit_cli.artefacts import formats
    from qinit_cli.artefacts.netcdf import write_netcdf

    if format == "nc":
        with destination.growing() as growing:
            write_netcdf(growing, _opened(paths), table)
        return
    with destination.writing() as file:
        match format:
            case "parquet":
                formats.write_parquet(file, _opened(paths), str(table), fields)
            case "npz":
                formats.write_npz(file, _opened(paths), table)
            case _:
                text = io.TextIOWrapper(file, encoding="utf-8", newline="")
                _write_text(text, paths, format, table, fields)
                text.detach()


def _write_with_about(
    destination: OutputFile, paths: list[Path], table: str, fields: list[Field], display: Display
) -> None:
    """The table, and beside it a JSON file with its origin and the meaning of its columns."""
    from qinit_cli.artefacts import formats

    beside = OutputFile(destination.path.with_name(f"{destination.path.name}.json"), destination.force)
    said = json.dumps(formats.about(_opened(paths), table, fields), allow_nan=False, indent=1)
    beside.check_content(content := said.encode() + b"\n")
    _write(destination, paths, "csv", table, fields)
    beside.write(content)
    note(display, f"{beside.path} says which artefacts it comes from, and what its columns mean")


def _write_text(
    file: IO[str], paths: list[Path], format: Format, table: str | None, fields: list[Field]
) -> None:
    from qinit_cli.artefacts import formats

    if format == "csv":
        formats.write_csv(file, _opened(paths), str(table), fields)
    else:
        formats.write_json(file, _opened(paths), table)
    file.flush()


def _opened(paths: list[Path]):  # type: ignore[no-untyped-def]  # formats.Opened, imported late
    """What gives the artefacts one by one, each open until the next is asked for."""
    from qinit_cli.artefacts.opening import open_artefact

    def opened() -> Iterator[Artefact]:
        for path in paths:
            with open_artefact(path) as artefact:
                yield artefact

    return opened


def _table(paths: list[Path], format: Format, what: str | None) -> tuple[str | None, list[Field]]:
    """The table and its columns; NotAllowed where the artefacts do not share them, UsageError where no kind has it."""
    from qinit_cli.artefacts import long_tables
    from qinit_cli.artefacts.kind import Field

    _check_known(what)
    if format not in LONG:
        names = [path.stem for path in paths]
        _check_named_apart(names)
        for artefact in _opened(paths)():
            if what is not None:
                long_tables.fields(artefact, what)
        return what, []
    table, fields, kind = "", list[Field](), ""
    for number, artefact in enumerate(_opened(paths)()):
        here = what or long_tables.tables(artefact)[0]
        columns = long_tables.fields(artefact, here)
        if number and artefact.kind != kind:
            raise NotAllowed(
                f"{paths[0].stem} and {artefact.path.stem} are of two kinds: export them one by one"
            )
        if number and (here, columns) != (table, fields):
            raise NotAllowed(
                f"{paths[0].stem} and {artefact.path.stem} do not have the same columns, so they make no table together; "
                "export them one by one"
            )
        table, fields, kind = here, columns, artefact.kind
    _check_named_apart([path.stem for path in paths])
    return table, fields


def _check_known(what: str | None) -> None:
    names = [name for kind in KINDS.values() for name in kind.tables]
    if what is not None and what not in names:
        raise UsageError(f"--what {what}: {nearest(what, names)}")


def _check_named_apart(names: list[str]) -> None:
    twice = sorted({name for name in names if names.count(name) > 1})
    if twice:
        raise NotAllowed(
            f"two artefacts are named {twice[0]}, and nothing else would tell them apart; export one by one"
        )
