"""Files that are imported."""

from __future__ import annotations

import hashlib
from pathlib import Path

from qinit_cli.errors import UsageError


def file_digest(path: Path) -> str:
    """SHA-256 of the file in hexadecimal digits; UsageError where there is none."""
    try:
        with path.open("rb") as file:
            return hashlib.file_digest(file, "sha256").hexdigest()
    except FileNotFoundError as error:
        raise UsageError(f"there is no file {path}") from error
    except IsADirectoryError as error:
        raise UsageError(f"{path} is a folder; name the files in it") from error
