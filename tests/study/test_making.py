"""Planned artefacts made by several threads with one maker."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from qinit_cli.pipeline.keeping import Keeping
from qinit_cli.pipeline.knowledge import Knowledge
from qinit_cli.pipeline.machine import Machine
from qinit_cli.study.making import Maker


def test_a_fit_that_another_thread_reads_meanwhile_is_not_taken_for_ones_own(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(Knowledge, "read", lambda path: SimpleNamespace(path=path))

    class Interleaved(Maker):
        """At each reading another thread reads the fit of its own run, too."""

        def __setattr__(self, name: str, value: Any) -> None:
            object.__setattr__(self, name, value)
            if name == "_read" and value is not None:
                object.__setattr__(self, name, SimpleNamespace(path=Path("other.h5")))

    maker = Interleaved(Keeping(), Machine())
    assert maker._knowledge(Path("own.h5")).path == Path("own.h5")
    assert maker._knowledge(Path("other.h5")).path == Path("other.h5")
