"""--dask with a real scheduler and two real workers on this machine, one of which is killed; and its refusals."""

from __future__ import annotations

import contextlib
import json
import os
import re
import signal
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from concurrent.futures import Future
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from real_cluster import PATIENCE, RealCluster, scheduler_in, wait_for

from qinit_cli.errors import NotAllowed
from qinit_cli.pipeline import cluster
from qinit_cli.pipeline.answers import WorkerFailed, opened, packed
from qinit_cli.watch import Watch
from qinit_store.errors import SystemFailed
from qinit_store.schema import TASK, Axis, Column, Schema

distributed = pytest.importorskip("distributed")

LONG = (
    "train-sources",
    "gridworld",
    "--size",
    "10",
    "--variance",
    "2",
    "--tasks",
    "160",
    "--episodes",
    "30000",
)
EAGER = Path(__file__).parents[1] / "eager.py"
GO = "go"  # a file: the command goes on after its first batch


@pytest.fixture(scope="module")
def scheduler(tmp_path_factory: pytest.TempPathFactory) -> Iterator[RealCluster]:
    """A scheduler, whatever workers it has."""
    with scheduler_in(tmp_path_factory.mktemp("dask")) as made:
        yield made


@pytest.fixture
def two_workers(scheduler: RealCluster) -> RealCluster:
    return scheduler.complete()


@pytest.fixture(scope="module")
def straight(tmp_path_factory: pytest.TempPathFactory) -> str:
    """The content hash of LONG learned by threads of one process."""
    folder = tmp_path_factory.mktemp("straight")
    process = subprocess.run(
        [sys.executable, "-m", "qinit_cli", *LONG, "--json", "-q", "-o", "a.h5"],
        cwd=folder,
        capture_output=True,
        check=True,
    )
    return str(json.loads(process.stdout)["digest"])


def _started(folder: Path, made: RealCluster) -> subprocess.Popen[str]:
    return subprocess.Popen(
        [sys.executable, EAGER, *LONG, "--dask", str(made.file), "--json", "-o", "a.h5"],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        cwd=folder,
        env={**os.environ, "EAGER_UNTIL": GO},
    )


def _wait_until_something_is_saved(process: subprocess.Popen[str], folder: Path) -> None:
    wait_for(lambda: list((folder / ".a.h5.work").glob("part-*.h5")), process)


def test_a_scheduler_without_workers_is_said_in_one_sentence(
    scheduler: RealCluster, here: Callable[..., Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    if scheduler.workers:
        pytest.skip("another test has started workers")
    monkeypatch.setattr(cluster, "WORKER_SECONDS", 0.2)
    ended = here("train-sources", "gridworld", "--dask", scheduler.file)
    [sentence] = ended.err.splitlines()
    assert (ended.code, ended.out) == (7, "")
    assert "has no workers" in sentence
    assert "dask worker tcp://127.0.0.1:" in sentence


def test_sources_and_a_run_have_the_content_that_threads_give_them(
    two_workers: RealCluster, here: Callable[..., Any], pipeline: Any
) -> None:
    sources = ("train-sources", "gridworld", "--size", 6, "--tasks", 40, "--episodes", 200)
    run = ("transfer", "ops-tl", pipeline.fit, "--tasks", 40, "--episodes", 60)
    for words in (sources, run):
        told = [
            here(*words, "--json", "-q", "-o", f"{name}.h5", *where).json
            for name, where in (("threads", ()), ("cluster", ("--dask", two_workers.file)))
        ]
        assert told[0]["digest"] == told[1]["digest"]
        assert told[0]["steps"] == told[1]["steps"] > 0
        Path("threads.h5").unlink()
        Path("cluster.h5").unlink()


def test_a_killed_worker_costs_its_batch_and_no_number(
    two_workers: RealCluster, straight: str, tmp_path: Path
) -> None:
    process = _started(tmp_path, two_workers)
    _wait_until_something_is_saved(process, tmp_path)
    two_workers.workers[0].kill()
    (tmp_path / GO).touch()
    out, err = process.communicate(timeout=PATIENCE)
    told = json.loads(out)
    assert (process.returncode, told["failed"], told["digest"]) == (0, 0, straight), err


def test_ctrl_c_keeps_what_came_back_and_threads_go_on_from_there(
    two_workers: RealCluster, straight: str, tmp_path: Path, qinit: Callable[..., Any]
) -> None:
    process = _started(tmp_path, two_workers)
    _wait_until_something_is_saved(process, tmp_path)
    process.send_signal(signal.SIGINT)
    began = time.monotonic()
    out, err = process.communicate(timeout=PATIENCE)
    assert (process.returncode, out) == (130, "")
    assert time.monotonic() - began < 10
    last = err.splitlines()[-1]
    assert "of 160 tasks are saved; the same command goes on with the rest" in last
    assert 0 < int(last.split()[2]) < 160
    told = qinit(*LONG, "--json", "-o", "a.h5").json
    assert told["digest"] == straight
    assert told["skipped"] == int(last.split()[2])


def test_a_worker_with_other_versions_is_refused(
    two_workers: RealCluster, here: Callable[..., Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    real = distributed.Client.get_versions

    def older(client: Any, **options: Any) -> Any:
        told = real(client, **options)
        next(iter(told["workers"].values()))["packages"]["numpy"] = "1.0"
        return told

    monkeypatch.setattr(distributed.Client, "get_versions", older)
    ended = here("train-sources", "gridworld", "--dask", two_workers.file)
    [sentence] = ended.err.splitlines()
    assert ended.code == 4
    assert f"numpy 1.0 where this process has {np.__version__}" in sentence


def test_a_dry_run_divides_by_the_threads_of_the_cluster(
    two_workers: RealCluster, here: Callable[..., Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    assert cluster.threads(str(two_workers.file)) == 2
    ended = here("train-sources", "gridworld", "--size", 6, "--dry-run", "--json", "--dask", two_workers.file)
    assert ended.json["seconds"] > 0


def test_where_no_scheduler_answers_one_sentence_says_so(
    here: Callable[..., Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(cluster, "SCHEDULER_SECONDS", 0.3)
    monkeypatch.setattr(cluster, "VERSION_SECONDS", 0.3)
    ended = here("train-sources", "gridworld", "--dask", "tcp://127.0.0.1:9")
    [sentence] = ended.err.splitlines()
    assert (ended.code, ended.out) == (7, "")
    assert "no Dask scheduler answers at tcp://127.0.0.1:9" in sentence


@pytest.mark.parametrize("place", ["nonsense", "tcp://127.0.0.1", "no-such-file.json", ""])
def test_what_is_neither_an_address_nor_a_file_is_a_usage_error(place: str, here: Callable[..., Any]) -> None:
    ended = here("train-sources", "gridworld", "--dask", place)
    [sentence] = ended.err.splitlines()
    assert ended.code == 2
    assert "--dask" in sentence


def test_a_file_that_no_scheduler_wrote_is_a_usage_error(here: Callable[..., Any]) -> None:
    Path("other.json").write_text("[]")
    ended = here("train-sources", "gridworld", "--dask", "other.json")
    assert ended.code == 2
    assert "no scheduler file" in ended.err


def test_jobs_of_this_process_and_a_cluster_exclude_each_other(here: Callable[..., Any]) -> None:
    ended = here("train-sources", "gridworld", "--dask", "tcp://127.0.0.1:9", "--jobs", 2)
    assert ended.code == 2
    assert "--jobs" in ended.err


def test_without_the_package_the_extra_is_named(
    here: Callable[..., Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "distributed", None)
    ended = here("train-sources", "gridworld", "--dask", "tcp://127.0.0.1:9")
    assert ended.code == 2
    assert "pip install -e '.[dask]'" in ended.err


SCHEMA = Schema(
    "sources",
    (Axis("row", np.arange(2)),),
    (
        Column("q", (TASK, "row"), "f8"),
        Column("steps", (TASK,), "i8", low=0),
        Column("seconds", (TASK,), "f8"),
        Column("task_digest", (TASK,), "u1"),
    ),
)


def _learned(ids: Any, watch: Watch) -> Any:
    count = len(ids)
    rows = {
        "q": np.ones((count, 2)) * ids[:, None],
        "steps": np.full(count, 3),
        "seconds": np.full(count, 1e-6),
    }
    return ids, rows


@dataclass
class Pretended:
    """A client whose batches all end in the same way."""

    end: Callable[[Future[Any]], object]
    status: str = "running"

    def get_executor(self, pure: bool) -> Pretended:
        assert not pure
        return self

    def submit(self, function: Any, *arguments: Any, **options: Any) -> Future[Any]:
        future: Future[Any] = Future()
        self.end(future)
        return future

    def scheduler_info(self, n_workers: int) -> dict[str, int]:
        return {"total_threads": 2}

    def run(self, *arguments: Any, **options: Any) -> None:
        pass

    @property
    def scheduler(self) -> Any:
        return self

    def who_has(self) -> None:
        pass

    def sync(self, function: Any, keys: list[str]) -> dict[str, list[str]]:
        return {key: ["tcp://10.0.0.7:4711"] for key in keys}

    def shutdown(self, wait: bool) -> None:
        pass


class KilledWorker(Exception):
    """As Dask calls it."""


def _cluster(client: Any) -> cluster.Cluster:
    return cluster.Cluster(client, "tcp://there:1", _learned, Watch(), SCHEMA, lambda: 2)


def _outcomes(client: Pretended) -> tuple[list[Any], cluster.Cluster]:
    made = _cluster(client)
    with made:
        return list(made.outcomes(np.arange(40), lambda: None)), made


def test_tasks_whose_workers_die_again_and_again_fail_and_the_rest_go_on() -> None:
    outcomes, made = _outcomes(Pretended(lambda future: future.set_exception(KilledWorker())))
    assert sorted(task for outcome in outcomes for task, _ in outcome.failures) == list(range(40))
    made.complain()


def test_a_scheduler_that_is_lost_ends_the_work_with_one_sentence() -> None:
    _, made = _outcomes(Pretended(Future.cancel))
    with pytest.raises(SystemFailed, match="tcp://there:1 was lost"):
        made.complain()


def test_a_worker_that_came_later_with_other_versions_ends_the_work() -> None:
    errand = cluster.Errand("run", _learned, SCHEMA, {**cluster.versions(), "numba": "0.1"})
    with pytest.raises(cluster.Unequal, match=r"where this process has 0\.1") as raised:
        errand(np.arange(3))
    _, made = _outcomes(Pretended(lambda future: future.set_exception(raised.value)))
    with pytest.raises(NotAllowed, match="a worker has numba"):
        made.complain()


def test_a_worker_learns_nothing_more_for_a_run_that_was_stopped() -> None:
    errand = cluster.Errand("a run of its own", _learned, SCHEMA, cluster.versions())
    assert len(opened(errand(np.arange(3)), np.arange(3), SCHEMA, whole=True).ids) == 3
    cluster.stop_there("a run of its own")
    assert len(opened(errand(np.arange(3)), np.arange(3), SCHEMA, whole=False).ids) == 0


@dataclass
class Answering:
    """A client whose workers answer each batch as this function does."""

    answer: Callable[[Any], Any]
    client: Pretended = field(default_factory=lambda: Pretended(lambda future: None))

    def __getattr__(self, name: str) -> Any:
        return getattr(self.client, name)

    def get_executor(self, pure: bool) -> Answering:
        return self

    def submit(self, function: Any, *arguments: Any, **options: Any) -> Future[Any]:
        future: Future[Any] = Future()
        if len(arguments) == 2:
            future.set_result(self.answer(arguments[1]))
        return future


def _packed(ids: Any, *failures: tuple[int, str]) -> bytes:
    return packed(cluster.Outcome(*_learned(np.asarray(ids, np.int64), Watch()), failures), SCHEMA)


def _changed(ids: Any, **values: float) -> bytes:
    """An answer that no worker of ours would pack."""
    _, rows = _learned(ids, Watch())
    content = [np.full_like(array, values.get(name, 0)).tobytes() for name, array in rows.items()]
    return _said({"ids": ids.tolist(), "failures": []}, b"".join(content))


def _said(said: object, content: bytes = b"") -> bytes:
    raw = said if isinstance(said, bytes) else json.dumps(said).encode()
    return b"qinit/1\n" + len(raw).to_bytes(8, "little") + raw + content


def test_what_workers_answer_is_what_they_learned() -> None:
    outcomes, made = _outcomes(
        Answering(lambda batch: _packed(batch[1:], (int(batch[0]), "ValueError: bad\nluck")))
    )
    made.complain()
    ids = np.concatenate([outcome.ids for outcome in outcomes])
    failed = [failure for outcome in outcomes for failure in outcome.failures]
    assert sorted([*ids.tolist(), *(task for task, _ in failed)]) == list(range(40))
    assert {words for _, words in failed} == {"ValueError: bad luck"}
    tables = np.concatenate([outcome.rows["q"] for outcome in outcomes])
    np.testing.assert_array_equal(tables, np.repeat(ids[:, None], 2, axis=1))


def test_an_error_of_a_worker_comes_in_words_with_no_other_behind_it() -> None:
    def fails(ids: Any, watch: Watch) -> Any:
        return ids, {"steps": np.ones(len(ids))}

    errand = cluster.Errand("another run", fails, SCHEMA, cluster.versions())
    with pytest.raises(WorkerFailed, match="ValueError: sources: given") as raised:
        errand(np.arange(3))
    assert raised.value.__context__ is None
    _, made = _outcomes(Pretended(lambda future: future.set_exception(raised.value)))
    with pytest.raises(SystemFailed, match="cannot run what it is sent, ValueError"):
        made.complain()


WRONG: dict[str, tuple[Callable[[Any], Any], str]] = {
    "other tasks": (lambda batch: _packed(batch + 1000), "which it was not asked for"),
    "another batch's": (lambda batch: _packed(batch + 1), "which it was not asked for"),
    "nothing": (lambda batch: _packed(batch[:0]), "it answered for 0 of the"),
    "all but one": (lambda batch: _packed(batch[1:]), "it answered for"),
    "one twice": (lambda batch: _packed([*batch, batch[0]]), "twice for a task"),
    "learned and failed": (lambda batch: _packed(batch, (int(batch[0]), "ValueError: ")), "twice for a task"),
    "no answer": (lambda batch: 7, "it answered int"),
    "an object": (lambda batch: cluster.Outcome(batch, {}), "it answered Outcome"),
    "no bytes": (lambda batch: b"", "it answered bytes"),
    "half an answer": (lambda batch: _packed(batch)[:-1], "bytes for"),
    "more than an answer": (lambda batch: _packed(batch) + b"0", "bytes for"),
    "no JSON": (lambda batch: _said(b"{"), "JSON that cannot be read"),
    "deep JSON": (lambda batch: _said(b"[" * 100_000), "JSON that cannot be read"),
    "a list": (lambda batch: _said([]), "without saying for which tasks"),
    "no ids": (lambda batch: _said({"failures": []}), "ids that are no numbers"),
    "true as an id": (lambda batch: _said({"ids": [True], "failures": []}), "ids that are no numbers"),
    "odd failures": (lambda batch: _said({"ids": [], "failures": [[0]]}), "a failure without a task"),
    "NaN": (lambda batch: _changed(batch, q=np.nan), "it answered that q is nan; it must be a finite number"),
    "steps below none": (
        lambda batch: _changed(batch, steps=-1),
        "it answered that steps is -1; it must be at least 0",
    ),
    "rows of nothing": (
        lambda batch: _said({"ids": [], "failures": [[int(task), ""] for task in batch]}, b"0"),
        "1 bytes for no task",
    ),
}


@pytest.mark.parametrize("wrong", WRONG)
def test_an_answer_that_does_not_fit_is_not_saved_and_ends_the_work_naming_the_worker(wrong: str) -> None:
    answer, words = WRONG[wrong]
    outcomes, made = _outcomes(Answering(answer))
    assert not any(len(outcome.ids) or outcome.failures for outcome in outcomes)
    with pytest.raises(SystemFailed, match=re.escape(words)) as raised:
        made.complain()
    assert "the worker tcp://10.0.0.7:4711 gave no usable answer" in str(raised.value)


@dataclass
class Lying(Pretended):
    """A client of a scheduler that says what no scheduler says."""

    end: Callable[[Future[Any]], object] = Future.cancel
    told: Any = None

    def wait_for_workers(self, *arguments: Any, **options: Any) -> None:
        pass

    def close(self, timeout: float) -> None:
        pass

    def get_versions(self, **options: Any) -> Any:
        return self.told

    def scheduler_info(self, n_workers: int) -> Any:
        return self.told

    def sync(self, function: Any, keys: list[str]) -> Any:
        return self.told


LIES = (
    None,
    7,
    [],
    {},
    {"scheduler": 1, "workers": [], "total_threads": "many"},
    {"total_threads": float("nan")},
)


@pytest.mark.parametrize("told", LIES)
def test_a_scheduler_that_answers_anything_is_said_to_be_none(
    told: Any, here: Callable[..., Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    class Liar(Lying):
        def __init__(self, *_: Any, **__: Any) -> None:
            super().__init__(told=told)

    # the class as a whole: a patched __new__, once restored, is object's, which takes no arguments
    monkeypatch.setattr(distributed, "Client", Liar)
    ended = here("train-sources", "gridworld", "--dask", "tcp://there:1", "--dry-run")
    assert ended.code == 7
    assert "what answers at tcp://there:1 answers as no Dask scheduler does" in ended.err


@pytest.mark.parametrize("told", [None, {}, {"key": 3}, {"key": ["a", "b"]}])
def test_a_scheduler_that_names_no_worker_does_not_hide_that_an_answer_was_wrong(told: Any) -> None:
    made = _cluster(Pretended(Future.cancel))
    made._client = Lying(told=told)
    assert made._worker("key") == "a worker of the Dask cluster at tcp://there:1"


@pytest.mark.parametrize("silent", [TimeoutError(), ConnectionResetError()])
def test_a_scheduler_that_falls_silent_before_work_begins_ends_in_a_sentence(silent: OSError) -> None:
    def raises() -> int:
        raise silent

    client = Pretended(Future.cancel)
    client.scheduler_info = lambda n_workers: raises()  # type: ignore[method-assign,assignment]  # a stand-in
    with pytest.raises(SystemFailed, match="tcp://there:1 no longer answers"):
        cluster.Connection(client, "tcp://there:1")


def _talking(words: bytes) -> Iterator[str]:
    """The address of a server that accepts, says this and nothing more."""
    with socket.create_server(("127.0.0.1", 0)) as server:
        taken = []

        def serve() -> None:
            with contextlib.suppress(OSError):
                while True:
                    taken.append(server.accept()[0])
                    taken[-1].sendall(words)

        threading.Thread(target=serve, daemon=True).start()
        yield f"tcp://127.0.0.1:{server.getsockname()[1]}"
        server.shutdown(socket.SHUT_RDWR)
        for one in taken:
            one.close()


@pytest.mark.parametrize("words", [b"", b"HTTP/1.1 400 Bad Request\r\n\r\n", bytes(range(256)) * 9])
def test_what_accepts_and_is_no_scheduler_ends_after_the_promised_time(
    words: bytes, here: Callable[..., Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(cluster, "SCHEDULER_SECONDS", 0.3)
    monkeypatch.setattr(cluster, "VERSION_SECONDS", 0.3)
    with contextlib.contextmanager(_talking)(words) as address:
        began = time.monotonic()
        ended = here("train-sources", "gridworld", "--dask", address)
        assert time.monotonic() - began < 5
    [sentence] = ended.err.splitlines()
    assert (ended.code, ended.out) == (7, "")
    assert f"no Dask scheduler answers at {address}" in sentence


@pytest.mark.parametrize(
    "content", ['{"address": 5}', '{"address": "file:///etc"}', "[[", '{"address": ["tcp://a:1"]}']
)
def test_a_scheduler_file_without_an_address_is_a_usage_error(content: str, here: Callable[..., Any]) -> None:
    Path("s.json").write_text(content)
    ended = here("train-sources", "gridworld", "--dask", "s.json")
    assert ended.code == 2
    assert "scheduler file" in ended.err


def test_a_scheduler_file_that_another_user_wrote_or_may_write_is_refused(here: Callable[..., Any]) -> None:
    Path("s.json").write_text('{"address": "tcp://127.0.0.1:9"}')
    Path("s.json").chmod(0o666)
    refused = here("train-sources", "gridworld", "--dask", "s.json")
    assert refused.code == 2
    assert "chmod o-w" in refused.err
    if os.geteuid() == 0:
        Path("s.json").chmod(0o644)
        os.chown("s.json", 4711, 4711)
        refused = here("train-sources", "gridworld", "--dask", "s.json")
        assert refused.code == 2
        assert "belongs to another user (uid 4711)" in refused.err


@given(st.integers(0, 2_000), st.integers(1, 9), st.floats(1e-9, 10.0))
def test_batches_of_a_cluster_hold_every_task_once_in_order(tasks: int, jobs: int, seconds: float) -> None:
    sizes = cluster.BatchSizes(task_bytes=8)
    found = [np.empty(0, np.int64)]
    for batch in sizes.batches(np.arange(tasks), lambda: jobs):
        found.append(batch)
        sizes.heed(cluster.Outcome(batch, {"seconds": np.full(len(batch), seconds)}))
    np.testing.assert_array_equal(np.concatenate(found), np.arange(tasks))


def test_batches_of_small_tasks_grow_until_scheduling_is_two_per_cent_of_them() -> None:
    sizes = cluster.BatchSizes(task_bytes=8)
    waiting = sizes.batches(np.arange(100_000), lambda: 2)
    first = next(waiting)
    sizes.heed(cluster.Outcome(first, {"seconds": np.full(len(first), 1e-3)}))
    assert len(next(waiting)) * 1e-3 >= cluster.OVERHEAD / 0.02 > len(first) * 1e-3


def test_batches_of_large_tables_do_not_grow() -> None:
    sizes = cluster.BatchSizes(task_bytes=cluster.MOST_BYTES)
    waiting = sizes.batches(np.arange(1_000), lambda: 2)
    first = next(waiting)
    sizes.heed(cluster.Outcome(first, {"seconds": np.full(len(first), 1e-6)}))
    assert len(next(waiting)) <= len(first)


def test_with_many_threads_a_batch_lasts_longer_so_that_the_head_keeps_up() -> None:
    assert cluster.worthwhile(1_000) == pytest.approx(2 * 1_000 * cluster.OVERHEAD)


def test_without_dask_nothing_of_it_is_imported(tmp_path: Path) -> None:
    words = ["train-sources", "gridworld", "--size", "4", "--tasks", "2", "--learner", "exact", "-q"]
    code = (
        "import sys\nfrom qinit_cli.app import run\n"
        f"assert run({words!r}) == 0\nassert not {{'dask', 'distributed', 'qinit_cli.pipeline.cluster'}} & set(sys.modules)\n"
    )
    subprocess.run([sys.executable, "-c", code], cwd=tmp_path, check=True, env=os.environ)
