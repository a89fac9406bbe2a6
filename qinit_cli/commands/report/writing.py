"""The page's file: whole or not at all, and never in place of what another program made."""

from __future__ import annotations

import os
from contextlib import suppress
from pathlib import Path

from qinit_cli.errors import NotAllowed
from qinit_cli.report.page import MARK

HEAD = 1024  # bytes, within which a page of ours says so


def check(path: Path, force: bool) -> None:
    """NotAllowed where a file of that name is not ours to replace."""
    if force or not os.path.lexists(path):
        return
    if not path.is_file() or MARK.encode() not in path.read_bytes()[:HEAD]:
        raise NotAllowed(
            f"{path} is no page of qinit report; --force replaces it, or choose another name with -o"
        )


def write(path: Path, text: str, force: bool) -> str:
    """Writes the page, and gives back what is to be said of it."""
    page = text.encode()
    size = f"{len(page) / 1e6:.1f} MB"
    if path.is_file() and path.read_bytes() == page:
        return f"{path} is up to date, {size}"
    beside = path.with_name(f".{path.name}.{os.getpid()}.part")
    try:
        with open(beside, "xb") as file:
            file.write(page)
            file.flush()
            os.fsync(file.fileno())
        check(path, force)  # it may have appeared meanwhile
        os.replace(beside, path)
    finally:
        with suppress(FileNotFoundError):
            beside.unlink()
    return f"{size}, to be opened in any browser"
