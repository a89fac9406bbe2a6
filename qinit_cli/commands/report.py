"""`qinit report`: one self-contained page of a reproduction, or of artefacts."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import typer

from qinit_cli.artefacts.kinds import KINDS
from qinit_cli.commands.console import note, print_path
from qinit_cli.commands.option_groups import DISPLAY, IMPORTS, READING, Display, Group, Reading
from qinit_cli.commands.typer_commands import Reference, add_command
from qinit_cli.errors import UsageError
from qinit_cli.options import option
from qinit_cli.output_file import OutputFile
from qinit_cli.plots.plot import UNSLICED

if TYPE_CHECKING:
    from qinit_cli.report.document import Material


@dataclass(frozen=True)
class Reporting:
    """What the page is called, and where it goes."""

    output: str = option("report.html", "The page.", short="-o", metavar="FILE.html")
    title: str | None = option(
        None, "Its title.", metavar="TEXT", default_text="made of what the artefacts are"
    )
    question: str | None = option(
        None, "The question that it answers, beneath the title.", metavar="TEXT", default_text="likewise"
    )
    baseline: str | None = option(
        None,
        "The method that runs are set against; a reproduction has its own.",
        metavar="METHOD",
        default_text="zero",
    )
    slice_: list[str] | None = option(
        None,
        "In maps of tiles fix a dimension of the states; may be given several times.",
        metavar="NAME=VALUE",
        default_text=UNSLICED,
    )
    force: bool = option(False, "Replace a file of that name that is no page of qinit report.")

    @property
    def path(self) -> Path:
        """Where the page goes; UsageError where it cannot go there."""
        path = Path(self.output)
        if path.suffix.lower() not in (".html", ".htm"):
            raise UsageError(f"-o {self.output}: a page's name ends in .html")
        if not path.parent.is_dir() or path.is_dir():
            problem = "that is a folder" if path.is_dir() else f"there is no folder {path.parent}"
            raise UsageError(f"-o {self.output}: {problem}")
        return path


def add_to(app: typer.Typer) -> None:
    """Adds the command."""
    add_command(
        app,
        "report",
        report,
        {"reporting": Group(Reporting, "Page"), "reading": READING, "display": DISPLAY},
        imports=IMPORTS,
        references=(
            Reference(
                "artefacts",
                f"The folder of a reproduction; or artefacts ({', '.join(kind.several for kind in KINDS.values())}): paths, "
                "names in the store, or - for stdin.",
                several=True,
            ),
        ),
        help="Write one self-contained HTML page: verdicts, tables, figures, settings, provenance and hashes.",
    )


def report(artefacts: list[str], reporting: Reporting, reading: Reading, display: Display) -> None:
    """Writes the page and prints its path."""
    from qinit_cli import __version__
    from qinit_cli.report.document import page
    from qinit_cli.report.page import GENERATOR, MARK, html

    file = OutputFile(reporting.path, reporting.force, GENERATOR, MARK.encode())
    file.check()
    content = html(page(_material(artefacts, reporting, reading.store), f"qinit {__version__}")).encode()
    size = f"{len(content) / 1e6:.2f} MB"
    if file.settle(content):
        note(display, f"{file.path} is up to date, {size}")
    else:
        file.write(content)
        note(display, f"{size}, to be opened in any browser")
    print_path(file.path)


def _material(references: list[str], reporting: Reporting, store: str) -> Material:
    """What the references lead to: a reproduction's folder, alone, or artefacts."""
    from qinit_cli.commands import references as named
    from qinit_cli.report import drawn_here, reproduced

    given = named.listed(references)
    folders = [Path(one) for one in given if Path(one).is_dir()]
    if not folders:
        return drawn_here.material(
            named.many(given, store, output=reporting.path),
            reporting.title,
            reporting.question,
            reporting.baseline,
            tuple(reporting.slice_ or ()),
        )
    if len(given) > 1:
        raise UsageError(f"{folders[0]} is a folder: a page is made of one reproduction, or of artefacts")
    if reporting.baseline is not None:
        raise UsageError(f"--baseline {reporting.baseline}: the tables of {folders[0]} are made already")
    if reporting.slice_:
        raise UsageError(f"--slice {reporting.slice_[0]}: the pictures of {folders[0]} are drawn already")
    return reproduced.material(folders[0], store, reporting.title, reporting.question)
