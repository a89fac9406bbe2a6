"""Several artefacts made at once, by threads of one head over one connection to a cluster."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from functools import partial
from pathlib import Path

import pytest
from real_cluster import RealCluster, scheduler_in
from running import run_here

from qinit_cli.errors import Interrupted
from qinit_cli.pipeline.together import together

pytest.importorskip("distributed")

EPISODES = 10_000
# the head of six artefacts; it prints a line once it saved something of each that is at work
HEAD = """
import sys
from functools import partial
from pathlib import Path

from qinit_cli import signals
signals.install()
from qinit_cli.environments.gridworld import Gridworld
from qinit_cli.errors import Interrupted
from qinit_cli.pipeline import cluster, job
from qinit_cli.pipeline.asked import LearningSources
from qinit_cli.pipeline.keeping import Keeping
from qinit_cli.pipeline.machine import Machine
from qinit_cli.pipeline.sources import plan_of, tasks_of
from qinit_cli.pipeline.together import together
from qinit_store.work import Work

EPISODES, place = int(sys.argv[1]), sys.argv[2]
job.SAVE_SECONDS = 0.0
saved, save = set(), Work.save

def telling(work, rows, tasks):
    save(work, rows, tasks)
    if work.target not in saved:
        saved.add(work.target)
        print("saved", work.target, flush=True)

Work.save = telling

def made(seed):
    asked = LearningSources(tasks=40, seed=seed, episodes=EPISODES)
    plan = plan_of(tasks_of(Gridworld(size=6, variance=2.0), asked), 40)
    return partial(job.make, plan, Keeping(output=Path(f"{seed}.h5")), Machine(dask=place))

code = 0
with cluster.shared(place):
    try:
        for seed, future in together({seed: made(seed) for seed in range(6)}, {}, at_once=3):
            print("made", seed, future.result().digest, flush=True)
    except Interrupted as stopped:
        code = stopped.exit_code
sys.exit(code)
"""


@pytest.fixture
def two_workers(tmp_path: Path) -> Iterator[RealCluster]:
    with scheduler_in(tmp_path) as made:
        yield made.complete()


def _head(made: RealCluster, folder: Path) -> subprocess.Popen[str]:
    words = [sys.executable, "-c", HEAD, str(EPISODES), str(made.file)]
    return subprocess.Popen(words, stdout=subprocess.PIPE, text=True, cwd=folder)


def _made(lines: list[str]) -> dict[int, str]:
    return {int(line.split()[1]): line.split()[2] for line in lines if line.startswith("made")}


def _plain(seed: int, path: Path) -> str:
    words = ("--size", 6, "--variance", 2, "--tasks", 40, "--seed", seed, "--episodes", EPISODES)
    ended = run_here(["train-sources", "gridworld", *map(str, words), "--json", "-q", "-o", str(path)])
    return str(ended.json["digest"])


def test_six_artefacts_at_once_stopped_and_gone_on_with_while_a_worker_is_killed_hold_what_plain_commands_make(
    two_workers: RealCluster, tmp_path: Path
) -> None:
    process = _head(two_workers, tmp_path)
    assert process.stdout is not None
    began = {process.stdout.readline() for _ in range(3)}
    assert all(line.startswith("saved") for line in began)
    process.send_signal(signal.SIGINT)
    lines = process.communicate(timeout=60)[0].splitlines()
    assert process.returncode == 130
    assert len(_made(lines)) < 6
    assert any(folder.glob("part-*.h5") for folder in tmp_path.glob(".*.h5.work"))

    process = _head(two_workers, tmp_path)
    assert process.stdout is not None
    first = process.stdout.readline()
    two_workers.workers[0].kill()
    assert process.poll() is None, "the worker was to be killed in the middle"
    lines = [first, *process.communicate(timeout=120)[0].splitlines()]
    assert process.returncode == 0
    assert _made(lines) == {seed: _plain(seed, tmp_path / f"plain-{seed}.h5") for seed in range(6)}


def test_what_a_call_raises_is_its_own() -> None:
    def fails() -> int:
        raise ArithmeticError("bad luck")

    ended = dict(together({0: lambda: 1, 1: fails, 2: lambda: 3}, {}, at_once=2))
    assert (ended[0].result(), ended[2].result()) == (1, 3)
    with pytest.raises(ArithmeticError, match="bad luck"):
        ended[1].result()


def test_no_more_calls_are_at_work_than_were_asked_for() -> None:
    lock, working, most = threading.Lock(), 0, 0

    def works() -> None:
        nonlocal working, most
        with lock:
            working += 1
            most = max(most, working)
        time.sleep(0.005)
        with lock:
            working -= 1

    assert len(list(together(dict.fromkeys(range(20), works), {}, at_once=3))) == 20
    assert 1 <= most <= 3


def test_a_signal_stops_what_is_at_work_and_nothing_else_begins() -> None:
    from qinit_cli.signals import asking_first

    begun: list[int] = []

    def learn(number: int) -> None:
        stop = threading.Event()
        with asking_first(stop.set) as received:
            begun.append(number)
            if len(begun) == 2:
                os.kill(os.getpid(), signal.SIGTERM)
            assert stop.wait(10)
        raise Interrupted("stopped", 128 + received[0])

    calls = {number: partial(learn, number) for number in range(8)}
    with pytest.raises(Interrupted) as raised:
        assert not list(together(calls, {}, at_once=2))
    assert raised.value.exit_code == 143
    assert sorted(begun) == [0, 1]


def test_a_call_begins_once_what_it_needs_has_ended_and_was_taken_note_of() -> None:
    taken: list[str] = []
    seen: dict[str, list[str]] = {}
    needs = {"b": ["a"], "c": ["a"], "d": ["b", "c"]}
    calls = {name: partial(lambda name: seen.setdefault(name, list(taken)), name) for name in "dcbae"}
    for name, future in together(calls, needs, at_once=3):
        future.result()
        taken.append(name)
    assert sorted(taken) == list("abcde")
    assert all(set(needs.get(name, ())) <= set(before) for name, before in seen.items())


def test_calls_that_need_one_another_are_refused() -> None:
    with pytest.raises(ValueError, match="needs what is not made"):
        list(together({"a": int, "b": int}, {"a": ["b"], "b": ["a"]}, at_once=2))


def test_a_signal_before_anything_has_begun_ends_it() -> None:
    class Signalling(dict[str, list[str]]):
        def get(self, key: str, default: object = None) -> list[str]:  # type: ignore[override]
            os.kill(os.getpid(), signal.SIGTERM)
            return ["a"]

    with pytest.raises(Interrupted) as raised:
        list(together({"a": int, "b": int}, Signalling(), at_once=2))
    assert raised.value.exit_code == 143
