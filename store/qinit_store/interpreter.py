"""Child interpreters that run no code but what they are meant to: nothing from the current folder or from PYTHONPATH."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from importlib.util import find_spec
from pathlib import Path


def isolated(statement: str, packages: Sequence[str], *arguments: str) -> list[str]:
    """The words that start an interpreter which runs `statement` with `arguments` in sys.argv[1:].

    It is isolated (-I). The folders in which this process finds the `packages` stand last on its path, behind the standard
    library and its own site-packages. ModuleNotFoundError for a package that is not found.
    """
    program = f"import sys; sys.path += {_folders(packages)!r}; {statement}"
    return [sys.executable, "-I", "-c", program, *arguments]


def _folders(packages: Sequence[str]) -> list[str]:
    folders: dict[str, None] = {}
    for package in packages:
        spec = find_spec(package)
        if spec is None or spec.origin is None:
            raise ModuleNotFoundError(f"No module named {package!r}", name=package)
        folders[str(Path(spec.origin).absolute().parents[1])] = None
    return list(folders)
