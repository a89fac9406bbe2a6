"""Verdicts on the paper's claims, from the artefacts that a page is made of."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import Any


def judged(paths: Iterable[Path]) -> list[dict[str, Any]]:
    """A verdict on each claim, as `qinit verdicts --format json` has it; [] where the artefacts tell of none."""
    from qinit_cli.paper import verdicts

    found = verdicts.verdicts(verdicts.evidence(verdicts.opened(list(paths))))
    # one claim needs no artefacts: it alone is no reason to speak of the paper
    return [verdict.told() for verdict in found] if any(verdict.sets for verdict in found) else []
