"""Signals, kills and second writers, with real processes: what is saved stays saved, and the same command goes on."""

from __future__ import annotations

import fcntl
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from contextlib import AbstractContextManager
from functools import partial
from pathlib import Path
from typing import Any

import pytest
from ready import Ready, Running
from running import run_here

WORDS = ("train-sources", "gridworld", "--size", "10", "--variance", "2", "--tasks", "320", "--jobs", "1")
EPISODES = ("--episodes", "500")
EAGER = Path(__file__).parents[1] / "eager.py"
Started = Callable[..., AbstractContextManager[Running]]


@pytest.fixture
def eager(tmp_path: Path, ready: Ready) -> Started:
    """Starts a qinit that waits for the signal once something is saved."""
    return partial(ready.process, tmp_path, command=str(EAGER))


def _parts(folder: Path) -> int:
    return len(list((folder / ".a.h5.work").glob("part-*.h5")))


def _stopped(eager: Started, folder: Path, number: signal.Signals) -> Running:
    """A command that received the signal once it had saved something new."""
    before = _parts(folder)
    with eager(*WORDS, *EPISODES, "-o", "a.h5") as process:
        process.wait_until(lambda: _parts(folder) > before)
        process.send_signal(number)
        process.wait()
    return process


@pytest.fixture(scope="module")
def straight(tmp_path_factory: pytest.TempPathFactory) -> str:
    """The content hash of the same sources learned without interruption, by two workers."""
    path = tmp_path_factory.mktemp("straight") / "a.h5"
    return str(run_here([*WORDS[:-1], "2", *EPISODES, "--json", "-q", "-o", str(path)]).json["digest"])


def test_interrupted_terminated_and_killed_the_same_command_ends_with_the_same_content(
    straight: str, tmp_path: Path, eager: Started, here: Callable[..., Any]
) -> None:
    for number, code in ((signal.SIGINT, 130), (signal.SIGTERM, 143)):
        ended = _stopped(eager, tmp_path, number)
        assert (ended.code, ended.out) == (code, "")
        last = ended.err.splitlines()[-1]
        assert last.startswith("qinit: stopped: ")
        assert "of 320 tasks are saved; the same command goes on with the rest" in last
        assert "Traceback" not in ended.err
        assert not (tmp_path / "a.h5").exists()
        saved = int(last.split()[2])
        assert 0 < saved < 320
    ended = _stopped(eager, tmp_path, signal.SIGKILL)
    assert (ended.code, ended.out) == (-signal.SIGKILL, "")
    kept = _parts(tmp_path)

    finished = here(*WORDS, *EPISODES, "-o", "a.h5", "--json")
    assert finished.code == 0, finished.err
    told = finished.json
    assert told["digest"] == straight
    assert told["skipped"] >= saved
    assert kept > 0
    assert "tasks are saved already" in finished.err
    assert not (tmp_path / ".a.h5.work").exists()


def test_an_interrupted_run_of_a_method_completes_to_the_same_content(
    tmp_path: Path, eager: Started, here: Callable[..., Any], pipeline: Any
) -> None:
    # five batches, of which one worker has two in flight
    words = ["transfer", "zero", str(pipeline.fit), "--tasks", "160", "--episodes", "300", "--jobs", "1"]
    with eager(*words, "-o", "a.h5") as process:
        process.wait_until(lambda: _parts(tmp_path) > 0)
        process.send_signal(signal.SIGINT)
        assert process.wait() == 130
    last = process.err.splitlines()[-1]
    assert "of 160 tasks are saved" in last
    assert 0 < int(last.split()[2]) < 160
    resumed = here(*words, "-o", "a.h5", "--json", "-q")
    again = here(*words, "-o", "b.h5", "--json", "-q")
    assert resumed.json["digest"] == again.json["digest"]


def test_unfinished_work_is_listed_with_the_command_that_goes_on(
    tmp_path: Path, eager: Started, here: Callable[..., Any]
) -> None:
    store = tmp_path / "qinit-store"
    with eager(*WORDS, *EPISODES) as process:
        process.wait_until(lambda: bool(list(store.glob("sources/.*.h5.work/part-*"))))
        process.send_signal(signal.SIGTERM)
        process.wait()
    ended = here("list", "--format", "json")
    [row] = ended.json["rows"]
    assert row["state"].startswith("unfinished")
    assert 0 < row["tasks"] < 320
    assert "train-sources gridworld --size 10" in ended.err


def test_ctrl_c_while_waiting_for_a_reference_is_silent(tmp_path: Path) -> None:
    process = subprocess.Popen(
        [Path(sys.executable).with_name("qinit"), "fit", "-"],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        cwd=tmp_path,
    )
    _wait_until_it_reads_stdin(process)
    process.send_signal(signal.SIGINT)
    process.wait(30)
    assert process.stdin is not None
    process.stdin.close()
    assert process.stdout is not None
    assert process.stderr is not None
    assert (process.returncode, process.stdout.read(), process.stderr.read()) == (130, b"", b"")
    process.stdout.close()
    process.stderr.close()


def _wait_until_it_reads_stdin(process: subprocess.Popen[bytes]) -> None:
    """Waits for a process that sleeps in a pipe; by its state where the system tells, else for a while."""
    place = Path(f"/proc/{process.pid}/wchan")
    deadline = time.monotonic() + 20
    while time.monotonic() < deadline:
        try:
            if "pipe" in place.read_text():
                return
        except OSError:
            break
        if time.monotonic() > deadline - 18:
            return
        time.sleep(0.02)
    time.sleep(2)


@pytest.fixture
def locked(tmp_path: Path) -> Any:
    """The lock of a.h5 in tmp_path, held by this process as another writer would; its file."""
    work = tmp_path / ".a.h5.work"
    work.mkdir()
    lock = os.open(work / "lock", os.O_RDWR | os.O_CREAT, 0o600)
    fcntl.flock(lock, fcntl.LOCK_EX)
    yield lock
    os.close(lock)


EXACT = ("train-sources", "gridworld", "--size", 4, "--tasks", 2, "--learner", "exact", "-o", "a.h5")


def test_while_another_process_writes_it_a_second_one_exits_with_5(
    locked: int, here: Callable[..., Any], tmp_path: Path
) -> None:
    ended = here(*EXACT)
    assert ended.code == 5
    [sentence] = ended.err.splitlines()
    assert "--wait" in sentence
    assert not (tmp_path / "a.h5").exists()


def test_with_wait_a_second_process_waits_for_the_first(locked: int, tmp_path: Path, ready: Ready) -> None:
    process = subprocess.Popen(
        [ready.qinit, *map(str, EXACT), "--wait", "-q"],
        cwd=tmp_path,
        stdout=subprocess.PIPE,
        text=True,
    )
    with pytest.raises(subprocess.TimeoutExpired):
        process.wait(2)
    fcntl.flock(locked, fcntl.LOCK_UN)
    out, _ = process.communicate(timeout=60)
    assert (process.returncode, out) == (0, "a.h5\n")


def test_work_that_goes_on_is_listed_as_being_written(tmp_path: Path, here: Callable[..., Any]) -> None:
    work = tmp_path / "qinit-store" / "sources" / ".a.h5.work"
    work.mkdir(parents=True)
    with (work / "lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        [row] = here("list", "--format", "json", "-q").json["rows"]
    assert (row["kind"], row["name"]) == ("sources", "a")
    assert row["state"].startswith("being written")


def test_two_processes_at_once_one_works_and_the_other_exits_with_5(
    tmp_path: Path, eager: Started, here: Callable[..., Any]
) -> None:
    words = [*WORDS, *EPISODES, "-o", "a.h5", "-q"]
    with eager(*words) as first:
        first.wait_until(lambda: _parts(tmp_path) > 0)
        second = here(*words)
        assert (second.code, second.out) == (5, "")
        first.send_signal(signal.SIGTERM)
        assert first.wait() == 143
