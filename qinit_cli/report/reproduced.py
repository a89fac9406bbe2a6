"""A page of a reproduction: its folder holds the pictures, tables and verdicts, the store what they were made of."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Any

from qinit_cli.errors import NotAllowed, UsageError
from qinit_store.wording import counted, shell_line

if TYPE_CHECKING:
    from qinit_cli.report.content import Figure
    from qinit_cli.report.document import Material

MANIFEST = "reproduction.json"
SCHEMA = "qinit.reproduction/"
UNFINISHED = "not complete: the same command goes on with what is missing"
PAPER = "Mehimeh & Tang, Entropy 2025, 27(4), 367"


def material(folder: Path, store: str, title: str | None, question: str | None) -> Material:
    """What the folder holds. UsageError where that is no reproduction, NotAllowed where it is not as it was made."""
    manifest = _json(folder, MANIFEST) if (folder / MANIFEST).is_file() else None
    if manifest is None:
        making = shell_line("qinit", "reproduce", "all", "-o", folder)
        raise UsageError(f"{folder} has no {MANIFEST}, so it is no reproduction; {making} makes one")
    if not str(manifest.get("schema")).startswith(SCHEMA):
        raise NotAllowed(f"{folder / MANIFEST} is of schema {manifest.get('schema')!r}; wanted {SCHEMA}1")
    try:
        return _material(folder, Path(store), manifest, title, question)
    except (KeyError, TypeError, AttributeError, ValueError) as error:
        raise NotAllowed(
            f"{folder / MANIFEST} is not as qinit reproduce writes it: {error!r}; reproduce again"
        ) from error


def _material(
    folder: Path, store: Path, manifest: dict[str, Any], title: str | None, question: str | None
) -> Material:
    from qinit_cli.report.document import Material
    from qinit_cli.report.verdicts import judged

    paths, artefacts, absent = _artefacts(folder, store, manifest["artefacts"])
    target, scale = manifest["target"], manifest["scale"]
    return Material(
        title=title or f"{_named(target)} of LogQInit, made again",
        question=question or f"What of the paper ({PAPER}) comes out again, at {scale} scale?",
        made=[
            ("command", str(manifest["command"])),
            ("scale", str(scale)),
            ("source sets", str(manifest["source_sets"])),
            ("started", str(manifest["started"])),
            ("took", f"{float(manifest['seconds']):,.0f} s: {_stages(manifest['stages'])}"),
            *([] if manifest["complete"] else [("state", UNFINISHED)]),
        ],
        artefacts=artefacts,
        compared=[(str(one["title"]), _json(folder, one["file"])) for one in manifest["tables"]],
        tuned=[],
        verdicts=_json(folder, manifest["verdicts"])["rows"] if manifest["verdicts"] else judged(paths),
        figures=[_figure(folder, one) for one in manifest["figures"]],
        undrawn=[],
        absent=absent,
        shares=None,
        of_claims=True,
    )


def _named(target: str) -> str:
    """The target as a title begins with it: "Figure 6" for fig6."""
    if target == "all":
        return "The paper's figures"
    return f"Figure {target.removeprefix('fig')}" if target.startswith("fig") else f"The {target} figures"


def _stages(stages: list[dict[str, Any]]) -> str:
    return ", ".join(f"{one['stage']} {float(one['seconds']):,.0f} s" for one in stages if one["made"])


def _artefacts(
    folder: Path, store: Path, made: list[dict[str, Any]]
) -> tuple[list[Path], list[dict[str, Any]], list[str]]:
    """The artefacts that are still there, by path and described, and a sentence on those that are not."""
    from qinit_cli.report.described import described

    paths, found, lacking = [], [], []
    for one in made:
        path = Path(one["path"])
        place = path if path.is_file() else store / path.parent.name / path.name
        if not place.is_file():
            lacking.append(one)
            continue
        [told] = described([place]).values()
        if told["content_sha256"] != one["content_sha256"]:
            raise NotAllowed(
                f"{place} is not what the pictures of {folder} were made of; run qinit reproduce again"
            )
        paths.append(place)
        found.append(told)
    said = [
        f"{counted(len(lacking), 'artefact')} of {len(made)} cannot be told of here, being neither in place nor in the store: "
        + ", ".join(f"{Path(one['path']).stem} ({one['content_sha256']})" for one in lacking)
    ]
    return paths, found, said if lacking else []


def _figure(folder: Path, one: dict[str, Any]) -> Figure:
    from qinit_cli.report.content import Figure

    return Figure(one["title"], one["caption"], one["alt"], _text(folder, one["file"]))


def _json(folder: Path, name: str) -> dict[str, Any]:
    try:
        content = json.loads(_text(folder, name))
    except ValueError as error:
        raise NotAllowed(f"{folder / name} is no JSON: {error}; reproduce again") from error
    if not isinstance(content, dict):
        raise NotAllowed(f"{folder / name} holds no JSON object; reproduce again")
    return content


def _text(folder: Path, name: str) -> str:
    """A file of the folder itself: whoever wrote the manifest has no say in what else is read."""
    if Path(name).name != name or not (folder / name).is_file():
        raise NotAllowed(f"{folder} has no file {name!r}, which its {MANIFEST} names; reproduce again")
    return (folder / name).read_text("utf-8")
