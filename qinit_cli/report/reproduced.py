"""A page of a study or a reproduction: its folder holds the pictures, tables and verdicts, the store what they were made of."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Any

from qinit_cli.errors import NotAllowed, UsageError
from qinit_store.wording import counted, shell_line

if TYPE_CHECKING:
    from qinit_cli.report.content import Figure
    from qinit_cli.report.document import Material

MANIFESTS = {"study.json": "qinit.study/1", "reproduction.json": "qinit.reproduction/1"}
UNFINISHED = "not complete: the same command goes on with what is missing"
PAPER = "Mehimeh & Tang, Entropy 2025, 27(4), 367"


def material(folder: Path, store: str, title: str | None, question: str | None) -> Material:
    """What the folder holds. UsageError where that is no reproduction, NotAllowed where it is not as it was made."""
    name = next((name for name in MANIFESTS if (folder / name).is_file()), None)
    if name is None:
        making = shell_line("qinit", "reproduce", "all", "-o", folder)
        raise UsageError(
            f"{folder} has neither {' nor '.join(MANIFESTS)}, so it is no study and no reproduction; {making} makes one"
        )
    manifest = _json(folder, name)
    if manifest.get("schema") != MANIFESTS[name]:
        raise NotAllowed(f"{folder / name} is of schema {manifest.get('schema')!r}; wanted {MANIFESTS[name]}")
    try:
        return _material(folder, Path(store), manifest, title, question)
    except (KeyError, TypeError, AttributeError, ValueError) as error:
        raise NotAllowed(f"{folder / name} is not as qinit writes it: {error!r}; make it again") from error


def _material(
    folder: Path, store: Path, manifest: dict[str, Any], title: str | None, question: str | None
) -> Material:
    from qinit_cli.report.document import Material

    artefacts, absent = _artefacts(folder, store, manifest["artefacts"])
    scale, sets = manifest["scale"], manifest["source_sets"]
    if "target" in manifest:
        named = f"{_named(manifest['target'])} of LogQInit, made again"
        asks = f"What of the paper ({PAPER}) comes out again, at {scale} scale?"
    else:
        named, asks = manifest["title"], manifest["question"] or ""
    return Material(
        title=title or named,
        question=question or asks,
        made=[
            ("command", str(manifest["command"])),
            *([] if scale is None else [("scale", str(scale))]),
            *([] if sets is None else [("source sets", str(sets))]),
            ("started", str(manifest["started"])),
            ("took", f"{float(manifest['seconds']):,.0f} s: {_stages(manifest['stages'])}"),
            *([] if manifest["complete"] else [("state", UNFINISHED)]),
            *(("failed", f"{one['name']}: {one['problem']}") for one in manifest.get("failed", [])),
        ],
        artefacts=artefacts,
        compared=[(str(one["title"]), _json(folder, one["file"])) for one in manifest["tables"]],
        tuned=[],
        verdicts=_json(folder, manifest["verdicts"])["rows"] if manifest["verdicts"] else [],
        figures=[_figure(folder, one) for one in manifest["figures"]],
        undrawn=[f"{one['name']}: {one['problem']}" for one in manifest.get("left_out", {}).values()],
        absent=absent,
        shares=_json(folder, manifest["shares"]["file"]) if "shares" in manifest else None,
        of_claims=manifest["verdicts"] is not None,
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
) -> tuple[list[dict[str, Any]], list[str]]:
    """The artefacts that are still there, described, and a sentence on those that are not."""
    from qinit_cli.report.described import described

    found, lacking = [], []
    for one in made:
        path = Path(one["path"])
        place = path if path.is_file() else store / path.parent.name / path.name
        if not place.is_file():
            lacking.append(one)
            continue
        [told] = described([place]).values()
        if told["content_sha256"] != one["content_sha256"]:
            raise NotAllowed(f"{place} is not what the pictures of {folder} were made of; make it again")
        found.append(told)
    said = [
        f"{counted(len(lacking), 'artefact')} of {len(made)} cannot be told of here, being neither in place nor in the store: "
        + ", ".join(f"{Path(one['path']).stem} ({one['content_sha256']})" for one in lacking)
    ]
    return found, said if lacking else []


def _figure(folder: Path, one: dict[str, Any]) -> Figure:
    from qinit_cli.report.content import Figure

    return Figure(one["title"], one["caption"], one["alt"], _text(folder, one["file"]))


def _json(folder: Path, name: str) -> dict[str, Any]:
    try:
        content = json.loads(_text(folder, name))
    except ValueError as error:
        raise NotAllowed(f"{folder / name} is no JSON: {error}; make it again") from error
    if not isinstance(content, dict):
        raise NotAllowed(f"{folder / name} holds no JSON object; make it again")
    return content


def _text(folder: Path, name: str) -> str:
    """A file of the folder itself: whoever wrote the manifest has no say in what else is read."""
    if Path(name).name != name or not (folder / name).is_file():
        raise NotAllowed(f"{folder} has no file {name!r}, which its manifest names; make it again")
    return (folder / name).read_text("utf-8")
