"""What a study's folder says of itself: what was asked, what it holds, where that came from, where the time went."""

from __future__ import annotations

import shlex
import sys
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from qinit_store.reading import Description

COUNTED = ("sources", "fits", "tunings", "runs", "pictures", "tables", "verdicts")  # whose time is told
VERDICTS, SHARES = "verdicts", "shares"  # names of the entries that are no comparison


@dataclass(frozen=True)
class FolderKind:
    """What a folder holds, and how its manifest is called."""

    noun: str
    command: str  # that makes it
    manifest: str
    schema: str
    told: tuple[str, ...]  # keys that tell one from another in an error; the first is its name
    ahead: str  # schema of what is foreseen
    done: str  # schema of what was done


STUDY = FolderKind(
    "study",
    "qinit study run",
    "study.json",
    "qinit.study/1",
    ("study", "scale", "source_sets"),
    "qinit.study-check/1",
    "qinit.study-run/1",
)
REPRODUCTION = FolderKind(
    "reproduction",
    "qinit reproduce",
    "reproduction.json",
    "qinit.reproduction/1",
    ("target", "scale", "source_sets"),
    "qinit.reproduce-dry-run/1",
    "qinit.reproduce/1",
)


@dataclass
class Spent:
    """What a stage took."""

    made: int = 0
    seconds: float = 0.0  # on the clock, of each thing that was made: at once they count each
    steps: int = 0  # of learning

    def __add__(self, other: Spent) -> Spent:
        return Spent(self.made + other.made, self.seconds + other.seconds, self.steps + other.steps)


def manifest(
    kind: FolderKind,
    asked: Mapping[str, Any],
    entries: Iterable[dict[str, Any]],
    artefacts: Iterable[Path],
    spent: Mapping[str, Spent],
    before: Mapping[str, Any],
    started: str,
    seconds: float,
) -> dict[str, Any]:
    """The manifest; `before` is that of an earlier attempt, whose time is counted too."""
    entries = list(entries)
    judged = _named(entries, VERDICTS)
    earlier = {stage["stage"]: stage for stage in before.get("stages", [])}
    return {
        "schema": kind.schema,
        "command": shlex.join(["qinit", *sys.argv[1:]]),
        **asked,
        "started": before.get("started", started),
        "seconds": round(before.get("seconds", 0.0) + seconds, 3),
        "stages": [_added(stage, own, earlier.get(stage, {})) for stage, own in spent.items()],
        "artefacts": _artefacts(artefacts),
        "figures": [entry for entry in entries if "png" in entry],
        "tables": [
            entry
            for entry in entries
            if "png" not in entry and entry is not judged and entry["name"] != SHARES
        ],
        **({SHARES: shares} if (shares := _named(entries, SHARES)) else {}),
        "verdicts": judged.get("file"),
        "verdicts_made_of": judged.get("made_of"),
    }


def _named(entries: Iterable[dict[str, Any]], name: str) -> dict[str, Any]:
    """The entry of that name; an empty one where there is none."""
    return next((entry for entry in entries if entry["name"] == name), {})


def entries_of(manifest: Mapping[str, Any]) -> list[dict[str, Any]]:
    """The entries that a manifest was made of."""
    entries = [*manifest.get("figures", []), *manifest.get("tables", [])]
    if SHARES in manifest:
        entries.append(manifest[SHARES])
    if manifest.get("verdicts") is not None:
        judged = {"file": manifest["verdicts"], "made_of": manifest.get("verdicts_made_of")}
        entries.append({"name": VERDICTS, **judged})
    return entries


def _added(stage: str, spent: Spent, earlier: Mapping[str, Any]) -> dict[str, Any]:
    return {
        "stage": stage,
        "made": earlier.get("made", 0) + spent.made,
        "seconds": round(earlier.get("seconds", 0.0) + spent.seconds, 3),
        "steps": earlier.get("steps", 0) + spent.steps,
    }


def _artefacts(paths: Iterable[Path]) -> list[dict[str, Any]]:
    """Each artefact once, behind the tables of the targets themselves that it was learned from."""
    from qinit_store.reading import describe

    told: dict[str, dict[str, Any]] = {}
    for path in paths:
        there = describe(path)
        for tables in _own_tables(there):
            told.setdefault(str(tables), _told(describe(tables), "optimal tables"))
        told.setdefault(str(path), _told(there, there.kind))
    return list(told.values())


def _own_tables(run: Description) -> Iterator[Path]:
    """Where `optimal` keeps what it learned: in the store that the run is in."""
    for given in run.inputs:
        path = run.path.parents[1] / "sources" / f"{given['name']}.h5"
        if given["role"] == "optimal" and path.is_file():
            yield path


def _told(there: Description, role: str) -> dict[str, Any]:
    return {
        "role": role,
        "path": str(there.path),
        "content_sha256": there.content_sha256,
        "command": there.provenance.get("command"),
        "seconds": _kernel_seconds(there),
    }


def _kernel_seconds(there: Description) -> float | None:
    """What its tasks took to learn, as the artefact itself tells; None for a fit, which learns nothing."""
    return None if there.kind == "fit" else _seconds(there.path, there.kind, there.content_sha256)


@cache
def _seconds(path: Path, kind: str, content: str) -> float:
    """The seconds of all tasks, read once of each content; nothing else of the tasks is read, so they are not verified."""
    from qinit_cli.artefacts.opening import open_artefact

    with open_artefact(path, kind) as artefact:
        return round(float(artefact.read_ahead(["seconds"])["seconds"].sum()), 3)
