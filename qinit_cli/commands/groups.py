"""The option groups that commands share."""

from __future__ import annotations

import os
import re
import sys
from dataclasses import dataclass
from typing import Any, Literal

from qinit_cli import cores
from qinit_cli.commands.build import Group
from qinit_cli.fields import check, option


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


@dataclass(frozen=True)
class Work:
    """How much of the machine is used; no number depends on it."""

    jobs: int | None = option(None, "Tasks learned at once.", low=1, default_text="all cores", metavar="N")
    shard: str | None = option(
        None,
        "Learn only the K-th of N shares, into an artefact of its own; qinit merge joins them.",
        metavar="K/N",
        default_text="all tasks",
        seldom=True,
    )
    dask: str | None = option(
        None,
        "Learn on the Dask cluster of this scheduler.",
        metavar="ADDRESS|SCHEDULER-FILE",
        default_text="threads here",
        seldom=True,
    )
    fail_fast: bool = option(False, "Stop at the first task that fails; else the others go on.", seldom=True)

    def __post_init__(self) -> None:
        check(self)
        if self.shard is not None:
            shape = re.fullmatch(r"(\d+)/(\d+)", self.shard)
            if shape is None or not 1 <= int(shape[1]) <= int(shape[2]):
                raise ValueError(f"--shard is {self.shard}; it must be K/N with K from 1 to N, such as 2/4")
        if self.dask is not None:
            self._check_dask(self.dask)

    def _check_dask(self, place: str) -> None:
        if self.jobs is not None:
            raise ValueError(
                "--jobs counts threads of this process and --dask uses none; leave one of them out"
            )
        if re.fullmatch(r"\w+://[^\s/]+:\d{1,5}", place) is None and not os.path.isfile(place):
            raise ValueError(
                f"--dask is {place!r}; it must be an address such as tcp://127.0.0.1:8786, or a file that "
                "dask scheduler --scheduler-file wrote"
            )

    @property
    def share(self) -> tuple[int, int]:
        """Which of how many shares is learned, counted from 1; (1, 1) is all of it."""
        if self.shard is None:
            return 1, 1
        share, _, shares = self.shard.partition("/")
        return int(share), int(shares)

    @property
    def threads(self) -> int:
        """Worker threads: as asked, else the cores that this process may use."""
        return self.jobs or cores.usable()


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
WORK = Group(Work, "Machine")
ONE_PASS = Group(OnePass, "Machine")
READING = Group(Reading, "Artefacts")
TABULAR = Group(Tabular, "Table")
IMPORTS = Group(Imports, "Environment")
DISPLAY = Group(Display, "Messages")
