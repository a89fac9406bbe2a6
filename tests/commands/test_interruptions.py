"""Signals, kills and second writers, with real processes: what is saved stays saved, and the same command goes on."""

from __future__ import annotations

import fcntl
import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

WORDS = ("train-sources", "gridworld", "--size", "10", "--variance", "2", "--tasks", "320", "--jobs", "1")
EPISODES = ("--episodes", "8000")
# qinit as it is, but for saving every finished batch at once: a signal then finds saved and missing tasks on any machine
EAGER = (
    "from qinit_cli.pipeline import job\n"
    "from qinit_cli.__main__ import main\n"
    "job.SAVE_SECONDS = 0.0\n"
    "main()\n"
)


def _started(folder: Path) -> subprocess.Popen[str]:
    return subprocess.Popen(
        [sys.executable, "-c", EAGER, *WORDS, *EPISODES, "-o", "a.h5"],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        cwd=folder,
    )


def _parts(folder: Path) -> int:
    return len(list((folder / ".a.h5.work").glob("part-*.h5")))


def _wait_for_another_part(process: subprocess.Popen[str], folder: Path, before: int) -> None:
    deadline = time.monotonic() + 100
    while _parts(folder) <= before:
        assert process.poll() is None, process.communicate()
        assert time.monotonic() < deadline
        time.sleep(0.005)


def _stopped(folder: Path, number: signal.Signals) -> tuple[int, str, str]:
    """Code, stdout and stderr of a command that received the signal once it had saved something new."""
    before = _parts(folder)
    process = _started(folder)
    _wait_for_another_part(process, folder, before)
    process.send_signal(number)
    out, err = process.communicate(timeout=60)
    return process.returncode, out, err


@pytest.fixture(scope="module")
def straight(tmp_path_factory: pytest.TempPathFactory) -> str:
    """The content hash of the same sources learned without interruption, by two workers."""
    folder = tmp_path_factory.mktemp("straight")
    words = [*WORDS[:-1], "2", *EPISODES, "--json", "-q", "-o", "a.h5"]
    ended = subprocess.run(
        [Path(sys.executable).with_name("qinit"), *words], cwd=folder, capture_output=True, check=True
    )
    return str(json.loads(ended.stdout)["digest"])


def test_interrupted_terminated_and_killed_the_same_command_ends_with_the_same_content(
    straight: str, tmp_path: Path, qinit: Callable[..., Any]
) -> None:
    for number, code in ((signal.SIGINT, 130), (signal.SIGTERM, 143)):
        ended, out, err = _stopped(tmp_path, number)
        assert (ended, out) == (code, "")
        last = err.splitlines()[-1]
        assert last.startswith("qinit: stopped: ")
        assert "of 320 tasks are saved; the same command goes on with the rest" in last
        assert "Traceback" not in err
        assert not (tmp_path / "a.h5").exists()
        saved = int(last.split()[2])
        assert 0 < saved < 320
    ended, out, _ = _stopped(tmp_path, signal.SIGKILL)
    assert (ended, out) == (-signal.SIGKILL, "")
    kept = _parts(tmp_path)

    finished = qinit(*WORDS, *EPISODES, "-o", "a.h5", "--json")
    assert finished.code == 0, finished.err
    told = finished.json
    assert told["digest"] == straight
    assert told["skipped"] >= saved
    assert kept > 0
    assert "tasks are saved already" in finished.err
    assert not (tmp_path / ".a.h5.work").exists()


def test_an_interrupted_run_of_a_method_completes_to_the_same_content(
    tmp_path: Path, qinit: Callable[..., Any], pipeline: Any
) -> None:
    words = ["transfer", "zero", str(pipeline.fit), "--tasks", "64", "--episodes", "60000", "--jobs", "1"]
    process = subprocess.Popen(
        [sys.executable, "-c", EAGER, *words, "-o", "a.h5"], cwd=tmp_path, stderr=subprocess.PIPE, text=True
    )
    _wait_for_another_part(process, tmp_path, 0)
    process.send_signal(signal.SIGINT)
    assert "of 64 tasks are saved" in process.communicate(timeout=60)[1]
    assert process.returncode == 130
    resumed = qinit(*words, "-o", "a.h5", "--json", "-q")
    again = qinit(*words, "-o", "b.h5", "--json", "-q")
    assert resumed.json["digest"] == again.json["digest"]


def test_unfinished_work_is_listed_with_the_command_that_goes_on(
    tmp_path: Path, qinit: Callable[..., Any]
) -> None:
    store = tmp_path / "qinit-store"
    process = subprocess.Popen(
        [sys.executable, "-c", EAGER, *WORDS, *EPISODES], cwd=tmp_path, stderr=subprocess.DEVNULL
    )
    deadline = time.monotonic() + 100
    while not list(store.glob("sources/.*.h5.work/part-*")):
        assert process.poll() is None
        assert time.monotonic() < deadline
        time.sleep(0.005)
    process.send_signal(signal.SIGTERM)
    process.wait(60)
    ended = qinit("list", "--format", "json")
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
    locked: int, qinit: Callable[..., Any], tmp_path: Path
) -> None:
    ended = qinit(*EXACT)
    assert ended.code == 5
    [sentence] = ended.err.splitlines()
    assert "--wait" in sentence
    assert not (tmp_path / "a.h5").exists()


def test_with_wait_a_second_process_waits_for_the_first(locked: int, tmp_path: Path) -> None:
    process = subprocess.Popen(
        [Path(sys.executable).with_name("qinit"), *map(str, EXACT), "--wait", "-q"],
        cwd=tmp_path,
        stdout=subprocess.PIPE,
        text=True,
    )
    with pytest.raises(subprocess.TimeoutExpired):
        process.wait(2)
    fcntl.flock(locked, fcntl.LOCK_UN)
    out, _ = process.communicate(timeout=60)
    assert (process.returncode, out) == (0, "a.h5\n")


def test_work_that_goes_on_is_listed_as_being_written(tmp_path: Path, qinit: Callable[..., Any]) -> None:
    work = tmp_path / "qinit-store" / "sources" / ".a.h5.work"
    work.mkdir(parents=True)
    with (work / "lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        [row] = qinit("list", "--format", "json", "-q").json["rows"]
    assert (row["kind"], row["name"]) == ("sources", "a")
    assert row["state"].startswith("being written")


def test_two_processes_at_once_one_works_and_the_other_exits_with_5(
    tmp_path: Path, qinit: Callable[..., Any]
) -> None:
    words = [
        *WORDS,
        "--episodes",
        "1000000",
        "-o",
        "a.h5",
        "-q",
    ]  # more than a second process needs to notice
    first = subprocess.Popen([sys.executable, "-c", EAGER, *words], cwd=tmp_path)
    deadline = time.monotonic() + 60
    while not (tmp_path / ".a.h5.work" / "spec.json").exists():
        assert first.poll() is None
        assert time.monotonic() < deadline
        time.sleep(0.01)
    second = qinit(*words)
    assert (second.code, second.out) == (5, "")
    first.send_signal(signal.SIGTERM)
    assert first.wait(60) == 143
