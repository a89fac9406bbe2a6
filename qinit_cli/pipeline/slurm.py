"""A Dask cluster whose workers are Slurm's jobs, submitted by dask-jobqueue, for the time of a block.

The scheduler has a process of its own, which submits the jobs and cancels them once its input ends: the head keeps its processor
for what comes back, and however it ends no job stays behind.
"""

from __future__ import annotations

import json
import re
import shutil
import subprocess
import sys
import tempfile
import threading
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import asdict, dataclass
from importlib.util import find_spec
from pathlib import Path
from typing import IO, Any, cast

from qinit_cli.errors import NotAllowed, QinitError, UsageError
from qinit_store.errors import SystemFailed

CLOSE_SECONDS = 30.0  # that cancelling the jobs may take
LIFETIME = (
    0.95  # of its time limit that a worker takes tasks: one that is killed costs the batch it was learning
)
LEAST_MARGIN = 30.0  # seconds before the limit
MOST_MARGIN = 600.0
LOOK_SECONDS = 0.2  # between two looks whether a worker has come
CHILD = "import sys; sys.path[:] = {path!r}; from qinit_cli.pipeline.slurm import serve; serve()"
TIME = re.compile(r"(?:(?:(\d+)-)?(\d+):)?(\d+):(\d+)")


@dataclass(frozen=True)
class SlurmJobs:
    """What Slurm is asked for: so many jobs alike, each one worker process."""

    jobs: int  # at once; one that ends is submitted again while the block lasts
    cores: int = 1  # threads of a job
    memory: str = "4GB"  # of a job
    walltime: str = "04:00:00"  # of a job, [DAYS-]HOURS:MINUTES:SECONDS
    partition: str | None = None  # None: Slurm's default
    account: str | None = None
    interface: str | None = (
        None  # of the network, by which workers reach the scheduler; None: the host's address
    )
    directives: tuple[str, ...] = ()  # more for #SBATCH lines, such as "--qos=long"
    logs: str | None = None  # folder of the jobs' output; None: it is not kept

    def __post_init__(self) -> None:
        if self.jobs < 1 or self.cores < 1:
            raise UsageError(
                f"{self.jobs} jobs of {self.cores} cores were asked of Slurm; both must be at least 1"
            )
        if not self.seconds:
            raise UsageError(
                f"the time limit of Slurm's jobs is {self.walltime!r}; it must be [DAYS-]HOURS:MINUTES:SECONDS"
            )

    @property
    def seconds(self) -> int:
        """The time limit; 0 where `walltime` is none."""
        shape = TIME.fullmatch(self.walltime)
        if shape is None:
            return 0
        days, hours, minutes, seconds = (int(part or 0) for part in shape.groups())
        return ((days * 24 + hours) * 60 + minutes) * 60 + seconds

    @property
    def lifetime(self) -> float:
        """Seconds after which a worker takes no more tasks and ends."""
        margin = min(MOST_MARGIN, max(LEAST_MARGIN, (1 - LIFETIME) * self.seconds))
        return max(self.seconds / 2, self.seconds - margin)


@contextmanager
def slurm_cluster(asked: SlurmJobs, tell: Callable[[str], None] = lambda note: None) -> Iterator[str]:
    """The address of a scheduler, of which one worker at least has come; the jobs are cancelled when the block is left.

    It is what `--dask` takes. `tell` is given a sentence before the wait for the first job, which has no limit but a signal.
    UsageError without dask-jobqueue or sbatch; NotAllowed where Slurm refuses what is asked, in its words; SystemFailed where
    the scheduler ends or the jobs cannot be submitted.
    """
    _check_there()
    code = CHILD.format(path=sys.path)
    # a group of its own: Ctrl-C is for the head, which ends the other in good order
    process = subprocess.Popen(
        [sys.executable, "-c", code, json.dumps(asdict(asked))],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        text=True,
        start_new_session=True,
    )
    lines, held = cast("IO[str]", process.stdout), cast("IO[str]", process.stdin)
    try:
        address = _said(lines, "address")
        tell(f"waiting for the first of {asked.jobs} jobs of Slurm; they connect to {address}")
        _said(lines, "ready")
        yield address
    finally:
        with suppress(OSError):
            held.close()
        try:
            process.wait(CLOSE_SECONDS)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()
        lines.close()


def _check_there() -> None:
    if find_spec("dask_jobqueue") is None:
        raise UsageError(
            "learning by Slurm's jobs needs the package dask-jobqueue: in your clone of qinit, pip install -e '.[slurm]'"
        )
    if shutil.which("sbatch") is None:
        raise UsageError(
            "learning by Slurm's jobs was asked for, and there is no sbatch here; run it on a login node"
        )


def _said(lines: IO[str], name: str) -> str:
    """What the scheduler's process says under this name; the error that it says instead."""
    try:
        said: Mapping[str, str] = json.loads(lines.readline())
    except ValueError as error:
        raise SystemFailed(
            "the process that submits Slurm's jobs ended before one of them came; see squeue"
        ) from error
    if "refused" in said:
        raise NotAllowed(f"Slurm refuses the jobs that were asked of it: {said['refused']}")
    if "failed" in said:
        raise SystemFailed(f"no cluster of Slurm's jobs could be made: {said['failed']}")
    return said[name]


def serve() -> None:
    """The scheduler's process: says its address, then that a worker has come, and ends with its input."""
    told = json.loads(sys.argv[1])
    asked = SlurmJobs(**{**told, "directives": tuple(told["directives"])})
    ended = threading.Event()
    threading.Thread(target=_await_end, args=(ended,), daemon=True).start()
    try:
        with (
            tempfile.TemporaryDirectory(prefix="qinit-slurm-") as folder,
            _submitting(asked, folder) as cluster,
        ):
            _say(address=cluster.scheduler_address)
            while not cluster.scheduler.workers and not ended.wait(LOOK_SECONDS):
                pass
            if cluster.scheduler.workers:
                _say(ready="yes")
            ended.wait()
    except QinitError as error:
        _say(refused=str(error))
    except Exception as error:
        _say(failed=" ".join(f"{type(error).__name__}: {error}".split()))


def _await_end(ended: threading.Event) -> None:
    sys.stdin.read()
    ended.set()


def _say(**words: str) -> None:
    with suppress(BrokenPipeError):  # nobody listens any more; the input has ended, too
        print(json.dumps(words), flush=True)


@contextmanager
def _submitting(asked: SlurmJobs, folder: str) -> Iterator[Any]:
    """dask-jobqueue's cluster, its jobs submitted, and again when they end."""
    from dask_jobqueue import SLURMCluster

    with SLURMCluster(
        cores=asked.cores,
        processes=1,  # kernels run without Python's lock
        memory=asked.memory,
        walltime=asked.walltime,
        queue=asked.partition,
        account=asked.account,
        interface=asked.interface,
        python=sys.executable,
        job_name="qinit",
        log_directory=asked.logs,
        job_extra_directives=[*asked.directives, *([] if asked.logs else ["--output=/dev/null"])],
        worker_extra_args=["--lifetime", f"{asked.lifetime:.0f}s", "--no-dashboard"],
        scheduler_options={"dashboard": False},
    ) as cluster:
        _check_accepted(cluster.job_script(), Path(folder))
        cluster.adapt(minimum_jobs=asked.jobs, maximum_jobs=asked.jobs)  # unlike scale, it submits anew
        yield cluster


def _check_accepted(script: str, folder: Path) -> None:
    """NotAllowed in Slurm's words where it would not take such a job: dask-jobqueue would try for ever."""
    path = folder / "job.sh"
    path.write_text(script)
    tried = subprocess.run(["sbatch", "--test-only", str(path)], capture_output=True, text=True)
    if tried.returncode:
        raise NotAllowed(" ".join(tried.stderr.split()).removeprefix("sbatch: error: "))
