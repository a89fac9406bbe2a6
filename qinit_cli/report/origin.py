"""Where the numbers come from: every artefact with its command, versions and hashes."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from qinit_cli.report.content import Block, Cell, Folded, PageColumn, Pairs, Table, Text
from qinit_store.wording import counted

Described = dict[str, Any]  # kind, name, spec_sha256, content_sha256, provenance, inputs

SHOWN = 12  # artefacts that are listed without being asked for
SHORT = 12  # digits that tell artefacts apart


def blocks(artefacts: Sequence[Described]) -> list[Block]:
    """Versions, then the artefacts with their hashes and with their commands."""
    listed = [_hashes(artefacts), _commands(artefacts)]
    found: list[Block] = [Pairs(_versions(artefacts))] if _versions(artefacts) else []
    found.append(
        Text(
            "A content hash is the SHA-256 of an artefact's settings and numbers: whoever runs the same command gets the same "
            "one. Each was checked when this page was made; qinit verify checks every task."
        )
    )
    if len(artefacts) <= SHOWN:
        return [*found, *listed]
    return [*found, Folded(f"{counted(len(artefacts), 'artefact')} with hashes and commands", listed)]


def _versions(artefacts: Sequence[Described]) -> list[tuple[str, str]]:
    """What made them: each value that occurs, once."""
    told: dict[str, dict[str, None]] = {}
    for artefact in artefacts:
        for key, value in artefact["provenance"].items():
            if key not in ("command", "time") and value:
                told.setdefault(key, {})[str(value)] = None
    return [(key.replace("_", " "), ", ".join(values)) for key, values in told.items()]


def _hashes(artefacts: Sequence[Described]) -> Table:
    columns = [
        PageColumn("artefact"),
        PageColumn("kind"),
        PageColumn("content SHA-256", code=True),
        PageColumn("made of"),
    ]
    rows = [
        [
            Cell(artefact["name"]),
            Cell(artefact["kind"]),
            Cell(artefact["content_sha256"]),
            Cell(
                ", ".join(
                    f"{one.get('role', 'input')} {one.get('content_sha256', '')[:SHORT]}"
                    for one in artefact["inputs"]
                )
            ),
        ]
        for artefact in artefacts
    ]
    return Table("Content hashes", columns, rows)


def _commands(artefacts: Sequence[Described]) -> Table:
    columns = [PageColumn("artefact"), PageColumn("made (UTC)"), PageColumn("command", code=True)]
    rows = [
        [
            Cell(artefact["name"]),
            Cell(str(artefact["provenance"].get("time", "")).replace("T", " ").removesuffix("Z")),
            Cell(str(artefact["provenance"].get("command", ""))),
        ]
        for artefact in artefacts
    ]
    return Table("The commands that made them", columns, rows)
