"""What is shown while learned tasks are put together."""

from __future__ import annotations

from pathlib import Path

import pytest

from qinit_cli.environments.gridworld import Gridworld
from qinit_cli.pipeline.job import make
from qinit_cli.pipeline.keeping import Keeping
from qinit_cli.pipeline.machine import Machine
from qinit_cli.pipeline.reporter import Progress, Reporter
from qinit_cli.pipeline.sources import plan_of
from qinit_cli.tasks import SourceTasks
from qinit_store import schema

FAMILY = Gridworld(size=3)


class Told(Progress):
    def __init__(self) -> None:
        self.steps: list[int] = []
        self.ended = False

    def __exit__(self, *error: object) -> None:
        self.ended = True

    def advance(self, tasks: int) -> None:
        self.steps.append(tasks)


class Listening(Reporter):
    def __init__(self) -> None:
        self.heard: dict[str, tuple[int, Told]] = {}

    def storing(self, what: str, total: int) -> Progress:
        assert all(told.ended for _, told in self.heard.values())  # one bar at a time
        self.heard[what] = total, Told()
        return self.heard[what][1]


def test_writing_and_reading_back_are_shown_one_after_the_other(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    plan = plan_of(SourceTasks(FAMILY, "exact", FAMILY.source_learning, 0), 5)
    monkeypatch.setattr(schema, "BLOCK_BYTES", 2 * plan.schema.task_bytes)
    listening = Listening()
    make(plan, Keeping(output=tmp_path / "a.h5"), Machine(jobs=2), listening)
    heard = {what: (total, told.steps, told.ended) for what, (total, told) in listening.heard.items()}
    assert heard == {
        "writing sources": (5, [2, 2, 1], True),
        "reading sources back": (5, [2, 2, 1], True),
    }
