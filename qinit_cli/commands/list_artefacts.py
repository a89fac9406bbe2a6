"""`qinit list`: what is in the store."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import typer

from qinit_cli.artefacts.kinds import KINDS, KindName
from qinit_cli.commands.console import note
from qinit_cli.commands.option_groups import DISPLAY, READING, TABULAR, Display, Group, Reading, Tabular
from qinit_cli.commands.typer_commands import add_command
from qinit_cli.options import check, option
from qinit_store.wording import recorded_command

if TYPE_CHECKING:
    from pathlib import Path

    from qinit_cli.commands.listed import ListedLine

    Listed = tuple[Path, ListedLine]

UNFINISHED = "unfinished"


@dataclass(frozen=True)
class Listing:
    """Which artefacts are listed."""

    kind: KindName | None = option(None, "Artefacts of this kind alone.", default_text="all")
    name: str = option(
        "",
        "Names that contain this text, or match it where it has *, ? or [.",
        metavar="PATTERN",
        default_text="all",
    )

    def __post_init__(self) -> None:
        check(self)

    def wanted(self, line: ListedLine) -> bool:
        """Whether the artefact is listed."""
        from fnmatch import fnmatchcase

        glob = self.name if set(self.name) & set("*?[") else f"*{self.name}*"
        return self.kind in (None, line.kind) and fnmatchcase(line.stem, glob)


def add_to(app: typer.Typer) -> None:
    """Adds the command."""
    add_command(
        app,
        "list",
        list_artefacts,
        {"listing": Group(Listing, "Which"), "tabular": TABULAR, "reading": READING, "display": DISPLAY},
        help="List the artefacts in the store, and unfinished work with the command that goes on with it.",
    )


def list_artefacts(listing: Listing, tabular: Tabular, reading: Reading, display: Display) -> None:
    """Prints one row per artefact; for programs also where it lies, its hash, and the command that makes it."""
    from pathlib import Path

    from qinit_cli.commands.listed import lines
    from qinit_cli.commands.tables import TableColumn, print_table
    from qinit_store.catalog import Store

    there = lines(Store(Path(reading.store)))
    entries = [one for one in there if listing.wanted(one[1])]
    for_people = tabular.chosen == "table"
    columns = [
        TableColumn("kind"),
        TableColumn("name"),
        TableColumn("differs", "differs in"),
        *([] if for_people else [TableColumn("family")]),  # names begin with it
        TableColumn("tasks"),
        TableColumn("made", dispensable=True),
        TableColumn("megabytes", "MB", 2, dispensable=True),
        TableColumn("state"),
    ]
    if not for_people:
        columns += [
            TableColumn(key) for key in ("tasks_wanted", "problem", "path", "content_sha256", "command")
        ]
    rows = [
        (_for_people(_row(*one)) if for_people else _row(*one)) | {"differs": words}
        for one, words in zip(entries, _differences(entries, _seeds(there)), strict=True)
    ]
    print_table("qinit.list/1", columns, rows, tabular, display)
    if not entries:
        filtered = listing != Listing()
        note(
            display,
            f"{reading.store} holds no such artefacts; qinit list shows all"
            if filtered
            else f"{reading.store} holds no artefacts; qinit train-sources makes the first",
        )
    for _, line in entries:
        if line.problem and for_people:
            note(display, line.problem)
        if line.state == UNFINISHED and (command := recorded_command(line.command or None)):
            note(display, f"to go on with {line.stem}: {command}")


def _seeds(there: Sequence[Listed]) -> dict[str, int]:
    """The seed of each of the store's sources by their content hash, which is all that a run names them by."""
    return {line.content: line.seed for _, line in there if line.seed is not None}


def _differences(entries: Sequence[Listed], seeds: Mapping[str, int]) -> list[str]:
    """The settings in which each differs from the others of its kind, family and method, which stands before them unless the
    artefact's name has it."""
    from qinit_cli.comparison.distinctions import distinguished, with_words

    alike: dict[tuple[str, str, str], list[int]] = {}
    for at, (_, line) in enumerate(entries):
        if line.words is not None:
            alike.setdefault((line.kind, line.family, line.method), []).append(at)
    words = [""] * len(entries)
    for (_, _, method), places in alike.items():
        apart = distinguished([_with_seed(entries[at][1], seeds) for at in places])
        for at, own in zip(places, apart, strict=True):
            words[at] = own if _dashed(method) in _dashed(entries[at][1].stem) else with_words(method, own)
    return words


def _with_seed(line: ListedLine, seeds: Mapping[str, int]) -> dict[str, str]:
    """The line's settings, with the seed of its sources where these are in the store."""
    from qinit_cli.comparison.distinctions import seed_word

    words = dict(line.words or {})
    if line.seed_key in words:
        if line.made_of in seeds:
            words[line.seed_key] = seed_word(seeds[line.made_of])
        else:
            del words[line.seed_key]
    return words


def _dashed(label: str) -> str:
    """A label as names of artefacts have it."""
    return re.sub(r"[^A-Za-z0-9.]+", "-", label)


def _row(path: Path, line: ListedLine) -> dict[str, Any]:
    return {
        "kind": line.kind,
        "name": line.stem,
        "family": line.family,
        "tasks": line.wanted if line.kind in KINDS and not KINDS[line.kind].by_task else line.tasks,
        "made": line.time[:16].replace("T", " "),
        "megabytes": line.size / 1e6 if line.size else None,
        "state": line.state,
        "tasks_wanted": line.wanted,
        "problem": line.problem,
        "path": str(path),
        "content_sha256": line.content,
        "command": line.command,
    }


def _for_people(row: dict[str, Any]) -> dict[str, Any]:
    """The row with the day it was made on, and of unfinished work how many tasks there are of how many."""
    partial = row["tasks_wanted"] not in (None, row["tasks"])
    tasks = f"{row['tasks']}/{row['tasks_wanted']}" if partial else row["tasks"]
    return row | {"tasks": tasks, "made": row["made"][:10]}
