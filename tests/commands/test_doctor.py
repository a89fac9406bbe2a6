"""`qinit doctor`: what it reports of the store's file system."""

from __future__ import annotations

import errno
import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from qinit_store import work
from qinit_store.disk import Disk


class Lacking(Disk):
    def __init__(self, **reasons: int) -> None:
        self.reasons = reasons

    def attempt(self, operation: str, path: Path, call: Callable[[], Any]) -> Any:
        if reason := self.reasons.get(operation.replace(" ", "_")):
            raise OSError(reason, os.strerror(reason))
        return call()


@pytest.mark.parametrize(
    ("disk", "code", "told"),
    [
        (Disk(), 0, "locks; hard links; directories are flushed"),
        (
            Lacking(link=errno.EPERM),
            0,
            "no hard links (Operation not permitted): a finished artefact is renamed",
        ),
        (Lacking(flush_the_directory=errno.EINVAL), 0, "directories cannot be flushed"),
        (Lacking(lock=errno.ENOLCK), 7, "has no locks"),
    ],
    ids=["all", "no links", "no flush", "no locks"],
)
def test_the_file_system_of_the_store_is_tried(
    here: Callable[..., Any],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    disk: Disk,
    code: int,
    told: str,
) -> None:
    monkeypatch.setattr(work, "DISK", disk)
    ended = here("doctor", "--store", tmp_path / "later" / "store", "--format", "json")
    [row] = [row for row in ended.json["rows"] if row["check"] == "file system"]
    assert told in row["detail"]
    assert ended.code == code
    assert list(tmp_path.iterdir()) == []
