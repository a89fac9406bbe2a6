"""`qinit list`: what is in the store."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import typer

from qinit_cli.artefacts.kinds import KINDS, KindName
from qinit_cli.commands.console import note
from qinit_cli.commands.option_groups import DISPLAY, READING, TABULAR, Display, Group, Reading, Tabular
from qinit_cli.commands.typer_commands import add_command
from qinit_cli.options import check, option
from qinit_store.wording import recorded_command

if TYPE_CHECKING:
    from qinit_cli.artefacts.settings import Settings
    from qinit_store.reading import Description

    Listed = tuple[Description, Settings | None]  # with its settings, where these are known

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

    def wanted(self, entry: Description) -> bool:
        """Whether the artefact is listed."""
        from fnmatch import fnmatchcase

        glob = self.name if set(self.name) & set("*?[") else f"*{self.name}*"
        return self.kind in (None, entry.kind) and fnmatchcase(entry.path.stem, glob)


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

    from qinit_cli.artefacts.opening import described
    from qinit_cli.commands.tables import TableColumn, print_table
    from qinit_store.catalog import Store

    there = [described(entry) for entry in Store(Path(reading.store)).entries()]
    entries = [one for one in there if listing.wanted(one[0])]
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
    for entry, _ in entries:
        if entry.problem and for_people:
            note(display, entry.problem)
        if entry.state == UNFINISHED and (command := recorded_command(entry.provenance.get("command"))):
            note(display, f"to go on with {entry.path.stem}: {command}")


def _seeds(there: Sequence[Listed]) -> dict[str, int]:
    """The seed of each of the store's sources by their content hash, which is all that a run names them by."""
    from qinit_cli.artefacts.settings import SourcesSettings

    return {entry.content_sha256: told.seed for entry, told in there if isinstance(told, SourcesSettings)}


def _differences(entries: Sequence[Listed], seeds: Mapping[str, int]) -> list[str]:
    """The settings in which each differs from the others of its kind, family and method, which stands before them unless the
    artefact's name has it."""
    from qinit_cli.artefacts.settings import RunSettings, TuningSettings
    from qinit_cli.comparison.distinctions import distinctions, with_words

    def with_seed(told: Settings) -> Settings:
        if not isinstance(told, RunSettings):
            return told
        return replace(told, source_set=replace(told.source_set, seed=seeds.get(told.source_set.content)))

    alike: dict[tuple[str, str, str], list[int]] = {}
    for at, (_, told) in enumerate(entries):
        if told is not None:
            method = told.method.label if isinstance(told, RunSettings | TuningSettings) else ""
            alike.setdefault((told.kind, told.sources.family.name, method), []).append(at)
    words = [""] * len(entries)
    for (_, _, method), places in alike.items():
        for at, own in zip(
            places,
            distinctions([with_seed(told) for at in places if (told := entries[at][1])], labelled=False),
            strict=True,
        ):
            words[at] = (
                own if _dashed(method) in _dashed(entries[at][0].path.stem) else with_words(method, own)
            )
    return words


def _dashed(label: str) -> str:
    """A label as names of artefacts have it."""
    return re.sub(r"[^A-Za-z0-9.]+", "-", label)


def _row(entry: Description, settings: Settings | None) -> dict[str, Any]:
    wanted = None if settings is None else settings.sources.tasks
    return {
        "kind": entry.kind,
        "name": entry.path.stem,
        "family": "" if settings is None else settings.sources.family.name,
        "tasks": wanted if entry.kind in KINDS and not KINDS[entry.kind].by_task else entry.tasks,
        "made": entry.provenance.get("time", "")[:16].replace("T", " "),
        "megabytes": entry.size / 1e6 if entry.size else None,
        "state": entry.state,
        "tasks_wanted": wanted,
        "problem": entry.problem,
        "path": str(entry.path),
        "content_sha256": entry.content_sha256,
        "command": entry.provenance.get("command", ""),
    }


def _for_people(row: dict[str, Any]) -> dict[str, Any]:
    """The row with the day it was made on, and of unfinished work how many tasks there are of how many."""
    partial = row["tasks_wanted"] not in (None, row["tasks"])
    tasks = f"{row['tasks']}/{row['tasks_wanted']}" if partial else row["tasks"]
    return row | {"tasks": tasks, "made": row["made"][:10]}
