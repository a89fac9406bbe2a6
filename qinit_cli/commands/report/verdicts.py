"""Verdicts on the paper's claims, from the artefacts that a page is made of."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from store.reading import Artefact


def judged(paths: Iterable[Path]) -> list[dict[str, Any]]:
    """A verdict on each claim, as `qinit verdicts --format json` has it; [] where the artefacts tell of none."""
    from qinit_cli.stages import verdicts

    found = verdicts.verdicts(verdicts.evidence(_opened(paths)))
    # one claim needs no artefacts: it alone is no reason to speak of the paper
    return [verdict.told() for verdict in found] if any(verdict.sets for verdict in found) else []


def _opened(paths: Iterable[Path]) -> Iterator[Artefact]:
    """The artefacts, one open at a time."""
    from store.reading import open_artefact

    for path in paths:
        with open_artefact(path) as artefact:
            yield artefact
