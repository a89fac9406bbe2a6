"""The option groups that commands share."""

from __future__ import annotations

import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

from qinit_cli.commands.build import Group
from qinit_cli.fields import check, option
from qinit_cli.pipeline.keeping import Keeping
from qinit_cli.pipeline.machine import Machine


def store_option() -> Any:
    """The option that says where artefacts are kept and looked up."""
    return option(
        "qinit-store",
        "The folder of artefacts, also QINIT_STORE.",
        default_text="./qinit-store",
        metavar="DIR",
    )


@dataclass(frozen=True)
class Output:
    """Where the artefact goes."""

    output: str | None = option(
        None,
        "Write the artefact here.",
        short="-o",
        metavar="PATH",
        default_text="a name made of what it is, in the store",
    )
    store: str = store_option()
    force: bool = option(False, "Replace an artefact of that name that has other settings.", seldom=True)
    wait: bool = option(False, "Wait while another process writes the same artefact.", seldom=True)
    dry_run: bool = option(False, "Report what it would take, from a short trial; make nothing.")
    json: bool = option(False, "Print one JSON object instead of the path.")

    @property
    def keeping(self) -> Keeping:
        """The place, for the artefact that the words on the command line make."""
        output = None if self.output is None else Path(self.output)
        return Keeping(Path(self.store), output, self.force, self.wait, tuple(sys.argv[1:]))


@dataclass(frozen=True)
class OnePass:
    """What every stage takes on its command line, for scripts that give all of them the same options."""

    jobs: int | None = option(
        None,
        "Without effect: a fit is one pass over its sources.",
        low=1,
        metavar="N",
        seldom=True,
    )
    fail_fast: bool = option(
        False,
        "Without effect: no task of a fit fails alone.",
        seldom=True,
    )

    def __post_init__(self) -> None:
        check(self)


@dataclass(frozen=True)
class Reading:
    """Where names of artefacts are looked up."""

    store: str = store_option()


@dataclass(frozen=True)
class Tabular:
    """How a table is printed."""

    format: Literal["table", "tsv", "csv", "json", "jsonl", "markdown"] | None = option(
        None, "How the table is printed.", default_text="table on a terminal, else tsv"
    )
    json: bool = option(False, "The same as --format json.")

    @property
    def chosen(self) -> str:
        """The format asked for, or what suits where it goes."""
        return "json" if self.json else self.format or ("table" if sys.stdout.isatty() else "tsv")


@dataclass(frozen=True)
class Imports:
    """Modules that register environments: imported because they are named on the command line, and no others."""

    import_: list[str] | None = option(
        None,
        "Import a module that registers environments; may be given several times.",
        metavar="MODULE",
        default_text="none",
        seldom=True,
    )


@dataclass(frozen=True)
class Display:
    """What is said on the way."""

    quiet: bool = option(False, "Print nothing but errors.", short="-q")
    verbose: bool = option(False, "Print more about the work.", short="-v")
    color: Literal["auto", "always", "never"] = option(
        "auto", "Colour: on a terminal unless NO_COLOR or TERM=dumb, always or never.", seldom=True
    )
    debug: bool = option(False, "Show the traceback of an error.", seldom=True)


OUTPUT = Group(Output, "Artefact")
MACHINE = Group(Machine, "Machine")
ONE_PASS = Group(OnePass, "Machine")
READING = Group(Reading, "Artefacts")
TABULAR = Group(Tabular, "Table")
IMPORTS = Group(Imports, "Environment")
DISPLAY = Group(Display, "Messages")
