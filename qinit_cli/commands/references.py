"""Artefacts named on the command line: a path, a name in the store, or `-` for references on stdin, one a line."""

from __future__ import annotations

import sys
from pathlib import Path

from qinit_cli.errors import NotAllowed, UsageError


def many(references: list[str], store: str) -> list[Path]:
    """The paths that the references lead to, in order; stdin is read only for an explicit `-`."""
    from store.catalog import Store

    named: list[str] = []
    for reference in references:
        named += _from_stdin() if reference == "-" else [reference]
    return [Store(Path(store)).resolve(name) for name in named]


def one(reference: str, store: str) -> Path:
    """The path of a single artefact; UsageError where stdin brings several."""
    paths = many([reference], store)
    if len(paths) > 1:
        raise UsageError(
            f"one artefact was expected, stdin brought {len(paths)}; run the command once for each"
        )
    return paths[0]


def _from_stdin() -> list[str]:
    lines = [line.strip() for line in sys.stdin]
    named = [line for line in lines if line]
    if not named:
        raise NotAllowed("nothing came on stdin: the stage before produced nothing")
    return named
