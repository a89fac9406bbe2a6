"""Shares by job arrays, and clusters of Slurm's jobs, under a real Slurm: `make slurm` sets up one of this machine."""

from __future__ import annotations

import json
import os
import shlex
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from running import QINIT

from qinit_cli.errors import NotAllowed
from qinit_cli.pipeline.slurm import SlurmJobs, slurm_cluster
from qinit_store.folder import part_paths
from qinit_store.reading import describe


def _answers() -> bool:
    return (
        shutil.which("sbatch") is not None
        and subprocess.run(["sinfo", "--noheader"], capture_output=True, timeout=30).returncode == 0
    )


pytestmark = [
    pytest.mark.soak,
    pytest.mark.skipif(not _answers(), reason="no Slurm answers here; `make slurm`, as root, sets one up"),
]

ASKED = (
    "train-sources",
    "gridworld",
    "--size",
    "10",
    "--variance",
    "2",
    "--tasks",
    "900",
    "--episodes",
    "30000",
)
# one processor learns longer than what is left of the time limit, which Slurm looks at every half minute
LONG = ("train-sources", "gridworld", "--tasks", "1200", "--episodes", "100000")
MEMORY = "--mem=700M"
_SUBMITTED: list[str] = []
PATIENCE = 900  # seconds, on a busy machine


def _told(*words: object) -> str:
    return subprocess.run(list(map(str, words)), capture_output=True, text=True, check=True).stdout.strip()


def _submitted(folder: Path, *command: object, options: tuple[str, ...] = (), after: int = 0) -> str:
    """The number of the job, or array, that runs this command line of bash after so many seconds."""
    script = folder / f"job-{len(list(folder.glob('job-*.sh')))}.sh"
    script.write_text(f"#!/bin/bash\nsleep {after}\nexec {' '.join(map(str, command))}\n")
    log = f"--output={folder}/job-%j.log"
    job = _told("sbatch", "--parsable", f"--chdir={folder}", log, MEMORY, *options, script)
    _SUBMITTED.append(job)
    return job


def _wait(ready: Callable[[], Any]) -> None:
    deadline = time.monotonic() + PATIENCE
    while not ready():
        assert time.monotonic() < deadline
        time.sleep(0.2)


def _states(job: str) -> set[str]:
    """How the job, or the jobs of the array, ended; empty while one has not."""
    lines = _told("scontrol", "--oneliner", "show", "job", job).splitlines()
    states = {line.split("JobState=")[1].split()[0] for line in lines}
    return set() if states & {"PENDING", "RUNNING", "COMPLETING", "CONFIGURING"} else states


def _ended(job: str) -> set[str]:
    _wait(lambda: _states(job))
    return _states(job)


def _learned(words: tuple[str, ...], folder: Path) -> str:
    """The content hash of what one process makes."""
    return str(json.loads(_told(QINIT, *words, "--json", "-q", "-o", folder / "straight.h5"))["digest"])


def _digest(path: Path) -> str:
    _told(QINIT, "verify", path)
    return describe(path).content_sha256


@pytest.fixture(scope="module")
def straight(tmp_path_factory: pytest.TempPathFactory) -> str:
    return _learned(ASKED, tmp_path_factory.mktemp("straight"))


@pytest.fixture(autouse=True)
def nothing_stays() -> Iterator[None]:
    """No job that a test submitted outlives it; Slurm may have others."""
    yield
    while _SUBMITTED:
        subprocess.run(["scancel", _SUBMITTED.pop()], check=False)


def _share(folder: Path, words: tuple[str, ...] = ASKED) -> tuple[object, ...]:
    return QINIT, *words, "--shard", "$SLURM_ARRAY_TASK_ID/3", "--jobs", 1, "--store", folder


def _merged(folder: Path) -> str:
    shares = sorted((folder / "sources").glob("*-share-*-of-3-*.h5"))
    assert len(shares) == 3
    _told(QINIT, "merge", *shares, "-o", folder / "merged.h5")
    return _digest(folder / "merged.h5")


def test_the_shares_of_an_array_make_what_one_process_makes(tmp_path: Path, straight: str) -> None:
    array = _submitted(tmp_path, *_share(tmp_path), options=("--array=1-3",))
    assert _ended(array) == {"COMPLETED"}
    assert _merged(tmp_path) == straight


def test_a_share_that_scancel_ended_goes_on_where_it_was(tmp_path: Path, straight: str) -> None:
    array = _submitted(tmp_path, *_share(tmp_path), options=("--array=1-3",))
    work = (tmp_path / "sources").glob
    _wait(lambda: [part for folder in work(".*share-2-of-3*.work") for part in part_paths(folder)])
    _told("scancel", f"{array}_2")
    assert _ended(array) == {"COMPLETED", "CANCELLED"}
    [log] = [
        log for log in tmp_path.glob("*.log") if "the same command goes on with the rest" in log.read_text()
    ]
    saved = int(log.read_text().split("stopped: ")[1].split()[0])
    assert 0 < saved < 300
    again = _submitted(tmp_path, *_share(tmp_path), options=("--array=2",))
    assert _ended(again) == {"COMPLETED"}
    assert any(f"{saved} of 300 tasks are saved already" in log.read_text() for log in tmp_path.glob("*.log"))
    assert _merged(tmp_path) == straight


def test_a_job_whose_time_limit_is_hit_saves_what_is_finished(tmp_path: Path) -> None:
    command = (QINIT, *LONG, "--jobs", 1, "-o", "a.h5")
    job = _submitted(tmp_path, *command, options=("--time=1",), after=40)  # the least limit is a minute
    assert _ended(job) == {"TIMEOUT"}
    [log] = tmp_path.glob("*.log")
    assert "the same command goes on with the rest" in log.read_text()
    saved = int(log.read_text().split("stopped: ")[1].split()[0])
    assert 0 < saved < 1200
    again = _submitted(tmp_path, *command)
    assert _ended(again) == {"COMPLETED"}
    assert any(
        f"{saved} of 1,200 tasks are saved already" in log.read_text() for log in tmp_path.glob("*.log")
    )
    assert _digest(tmp_path / "a.h5") == _learned(LONG, tmp_path)


def test_workers_that_srun_started_learn_for_a_head(tmp_path: Path, straight: str) -> None:
    pytest.importorskip("distributed")
    file = tmp_path / "scheduler.json"
    dask = (shlex.quote(sys.executable), "-m", "dask")
    scheduler = subprocess.Popen(
        [
            sys.executable,
            "-m",
            "dask",
            "scheduler",
            "--port",
            "0",
            "--scheduler-file",
            str(file),
            "--no-dashboard",
        ],
        stderr=subprocess.DEVNULL,
    )
    try:
        _wait(lambda: file.exists() and file.read_text().endswith("}"))
        worker = (*dask, "worker", "--scheduler-file", file, "--nthreads", 1, "--no-dashboard")
        _submitted(tmp_path, "srun", *worker, options=("--ntasks=2", "--time=10"))
        _wait(lambda: "Starting established" in "".join(log.read_text() for log in tmp_path.glob("*.log")))
        told = json.loads(_told(QINIT, *ASKED, "--dask", file, "--json", "-q", "-o", tmp_path / "a.h5"))
        assert (told["digest"], told["failed"]) == (straight, 0)
    finally:
        scheduler.kill()
        scheduler.wait()


def _jobs(folder: Path) -> list[str]:
    """The jobs that a head in this folder asked for."""
    lines = _told("squeue", "--noheader", "--name=qinit", "--format=%A %Z").splitlines()
    return [line.split()[0] for line in lines if line.split(maxsplit=1)[1] == str(folder)]


ONE_EACH = SlurmJobs(jobs=2, cores=1, memory="1GB", walltime="00:10:00")


def test_dask_jobqueue_s_workers_learn_for_a_head_and_one_that_is_cancelled_is_replaced(
    tmp_path: Path, straight: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    pytest.importorskip("dask_jobqueue")
    monkeypatch.chdir(tmp_path)  # by which the jobs are told from others
    told: list[str] = []
    with slurm_cluster(ONE_EACH, told.append) as address:
        assert told[0].endswith(address)
        head = subprocess.Popen(
            [QINIT, *ASKED, "--dask", address, "--json", "-q", "-o", "a.h5"],
            stdout=subprocess.PIPE,
            text=True,
            cwd=tmp_path,
        )
        _wait(lambda: list((tmp_path / ".a.h5.work").glob("part-*.h5")))
        first, *_ = _jobs(tmp_path)
        _told("scancel", first)
        out, _ = head.communicate(timeout=PATIENCE)
        answer = json.loads(out)
        assert (head.returncode, answer["digest"], answer["failed"]) == (0, straight, 0)
        _wait(lambda: first not in _jobs(tmp_path) and len(_jobs(tmp_path)) == 2)
    _wait(lambda: not _jobs(tmp_path))


def test_no_job_stays_behind_a_head_that_is_killed(tmp_path: Path) -> None:
    pytest.importorskip("dask_jobqueue")
    code = (
        "import time\nfrom qinit_cli.pipeline.slurm import SlurmJobs, slurm_cluster\n"
        f"with slurm_cluster({ONE_EACH!r}):\n    print('ready', flush=True)\n    time.sleep(600)\n"
    )
    head = subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.PIPE, text=True, cwd=tmp_path)
    assert head.stdout is not None
    assert head.stdout.readline() == "ready\n"
    assert _jobs(tmp_path)
    os.kill(head.pid, signal.SIGKILL)
    head.wait()
    head.stdout.close()
    _wait(lambda: not _jobs(tmp_path))


def test_what_slurm_refuses_is_told_in_its_words() -> None:
    pytest.importorskip("dask_jobqueue")
    with (
        pytest.raises(NotAllowed, match="invalid partition specified: nowhere"),
        slurm_cluster(SlurmJobs(jobs=1, partition="nowhere")),
    ):
        raise AssertionError("it was accepted")
