"""Tasks that are stepped in Python, learned by processes: the same rows, and nothing that outlives the command."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from qinit_cli.pipeline import processes
from qinit_cli.watch import Watch

pytest.importorskip("gymnasium")

POLE = (
    *("train-sources", "gym", "CartPole-v1", "--goal", "survived", "--vary", "length=uniform:0.3,0.7"),
    *("--bins", "1,3,4,3", "--range", "1=-2:2", "--range", "3=-2:2"),
)
# qinit as it is, but that it starts a process at once
EAGER = "from qinit_cli.pipeline import processes\nfrom qinit_cli.__main__ import main\nprocesses.PATIENCE = 0.0\nmain()\n"


@dataclass
class Stepped:
    """All that a crew asks of a family."""

    beyond_bounds: Counter[int] = field(default_factory=Counter)


@dataclass
class Squares:
    """A learner of squares; in another process than the head it fails, or ends the process, at some tasks."""

    family: Stepped
    head: int
    fails: int = -1
    ends: int = -1

    def __call__(self, ids: Any, watch: Watch) -> tuple[Any, dict[str, Any]]:
        """As stages learn."""
        if os.getpid() != self.head:
            if self.ends in ids:
                os._exit(3)
            if self.fails in ids:
                raise LookupError(f"no task {self.fails}")
            self.family.beyond_bounds[1] += len(ids)
        time.sleep(0.3 if os.getpid() == self.head else 0.0)  # so that the other process gets its share
        watch.add(len(ids), len(ids), len(ids))
        return ids, {"square": ids**2, "process": np.full(len(ids), os.getpid())}


class Others(processes.Seats):
    """As Seats, but that this process learns nothing."""

    def __init__(self, *of: Any) -> None:
        super().__init__(*of)
        self._free.clear()


def _crew(learn: Squares, tasks: int, watch: Watch, monkeypatch: pytest.MonkeyPatch) -> list[Any]:
    monkeypatch.setattr(processes, "PATIENCE", 0.0)
    monkeypatch.syspath_prepend(Path(__file__).parents[2])  # another process finds this module by its name
    with processes.processes_here(2, learn, learn, learn.family, watch) as crew:
        return list(crew(np.arange(tasks), lambda: None))


def test_two_processes_learn_every_task_once_and_what_they_count_is_counted(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    watch, family = Watch(), Stepped()
    outcomes = _crew(Squares(family, os.getpid()), 640, watch, monkeypatch)
    ids = np.concatenate([one.ids for one in outcomes])
    np.testing.assert_array_equal(np.sort(ids), np.arange(640))
    np.testing.assert_array_equal(np.concatenate([one.rows["square"] for one in outcomes]), ids**2)
    others = np.concatenate([one.rows["process"] for one in outcomes]) != os.getpid()
    assert 0 < others.sum() == family.beyond_bounds[1]
    assert (watch.steps, watch.tasks, watch.finished) == (640, 640.0, 640)


def test_a_task_that_fails_in_another_process_takes_no_other_with_it(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(processes, "Seats", Others)
    outcomes = _crew(Squares(Stepped(), os.getpid(), fails=40), 64, Watch(), monkeypatch)
    assert [failure for one in outcomes for failure in one.failures] == [(40, "LookupError: no task 40")]
    assert sorted(task for one in outcomes for task in one.ids) == [task for task in range(64) if task != 40]


def test_tasks_whose_process_ends_fail_and_the_rest_goes_on(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(processes, "Seats", Others)
    outcomes = _crew(Squares(Stepped(), os.getpid(), ends=40), 128, Watch(), monkeypatch)
    failures = dict(failure for one in outcomes for failure in one.failures)
    assert failures == dict.fromkeys(range(32, 64), "ProcessDied: the process that learned it ended, code 3")
    assert sum(len(one.ids) for one in outcomes) == 96


def test_a_small_job_starts_no_process(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(processes, "Process", None)  # else it would be called
    family = Stepped()
    squares = Squares(family, os.getpid())
    with processes.processes_here(2, squares, squares, family, Watch()) as crew:
        assert sum(len(one.ids) for one in crew(np.arange(4), lambda: None)) == 4


def test_sources_by_processes_have_the_content_of_one(
    here: Callable[..., Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(processes, "PATIENCE", 0.0)
    monkeypatch.setattr(processes, "Seats", Others)
    started: list[processes.Process] = []

    class Noted(processes.Process):
        def __init__(self, learner: Any) -> None:
            super().__init__(learner)
            started.append(self)

    monkeypatch.setattr(processes, "Process", Noted)
    told = [
        here(*POLE, "--tasks", 4, "--episodes", 150, "--jobs", jobs, "--json", "-q", "-o", f"{jobs}.h5").json
        for jobs in (1, 2)
    ]
    assert told[0]["digest"] == told[1]["digest"]
    assert told[0]["steps"] == told[1]["steps"] > 0
    assert [one.alive for one in started] in (
        [False],
        [False, False],
    )  # the first may be free before the second batch


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGKILL])
def test_a_signal_leaves_no_process_behind(number: signal.Signals, tmp_path: Path) -> None:
    words = [*POLE, "--tasks", "2", "--episodes", "1000000", "--jobs", "2", "-o", "a.h5"]
    command = subprocess.Popen(
        [sys.executable, "-c", EAGER, *words],
        cwd=tmp_path,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    )
    _wait(lambda: len(_group(command.pid)) == 2)
    time.sleep(0.5)
    if number == signal.SIGINT:
        os.killpg(command.pid, number)  # as a terminal's Ctrl-C, which all processes get
    else:
        command.send_signal(number)
    _, told = command.communicate(timeout=60)
    _wait(lambda: not _group(command.pid))
    assert command.returncode == (-number if number == signal.SIGKILL else 128 + number)
    assert "Traceback" not in told


def _group(leader: int) -> list[int]:
    """The processes of a group that have not ended."""
    listed = subprocess.run(
        ["ps", "-A", "-o", "pid=,pgid=,stat="], capture_output=True, text=True, check=True
    )
    rows = [line.split() for line in listed.stdout.splitlines()]
    return [int(pid) for pid, group, state, *_ in rows if int(group) == leader and not state.startswith("Z")]


def _wait(ready: Callable[[], bool]) -> None:
    until = time.monotonic() + 60
    while not ready():
        assert time.monotonic() < until
        time.sleep(0.05)
