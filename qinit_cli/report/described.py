"""Artefacts as a page tells of them: settings, origin, hashes."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import Any


def described(paths: Iterable[Path]) -> dict[Path, dict[str, Any]]:
    """Each artefact once, the content hash of each checked."""
    from qinit_cli.artefacts.kinds import KINDS
    from qinit_cli.artefacts.opening import open_artefact

    found: dict[str, tuple[Path, dict[str, Any]]] = {}
    for path in paths:
        with open_artefact(path) as artefact:
            told = {
                "kind": artefact.kind,
                "name": artefact.path.stem,
                "settings": KINDS[artefact.kind].read(artefact.spec),
                "content_sha256": artefact.content_sha256,
                "provenance": artefact.provenance,
                "inputs": list(artefact.inputs),
            }
            found.setdefault(artefact.content_sha256, (path, told))
    return dict(found.values())
