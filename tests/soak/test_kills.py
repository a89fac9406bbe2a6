"""A hundred real kills, and signals, of every stage through the command line, at random times."""

from __future__ import annotations

import json
import os
import random
import signal
import subprocess
import sys
import time
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest

from qinit_store.folder import part_paths, work_folder
from qinit_store.reading import describe, open_artefact, open_part

pytestmark = pytest.mark.soak

KILLS = 25  # of each stage, and as many signals that can be caught

# qinit as it is, but that it saves more often, and writes the ids of what it saved into a log once they count as saved.
LOGGED = """
from qinit_cli import signals
signals.install()
from qinit_cli.errors import Interrupted
try:
    import os
    from qinit_cli.__main__ import main
    from qinit_cli.pipeline import job as making
    from qinit_store.work import Work
    log = os.open(os.environ["SAVED_LOG"], os.O_WRONLY | os.O_APPEND | os.O_CREAT)
    save = Work.save
    def logged(work, rows, tasks):
        save(work, rows, tasks)
        os.write(log, "".join(f"{task}\\n" for task in tasks).encode())
    Work.save = logged
    making.SAVE_SECONDS = 0.05
except Interrupted as interrupted:
    raise SystemExit(interrupted.exit_code)
main()
"""

STAGES = {
    "exact": ("train-sources", "gridworld", "--learner", "exact", "--size", "20", "--tasks", "300"),
    "q-learning": ("train-sources", "gridworld", "--size", "8", "--tasks", "96", "--episodes", "4000"),
    "fit": ("fit", "sources.h5"),
    "transfer": ("transfer", "zero", "fit.h5", "--tasks", "96", "--episodes", "1500"),
}


@dataclass
class Job:
    """A command in a folder, and what it ends with when nobody interrupts it."""

    words: tuple[str, ...]
    digest: str
    tasks: int
    seconds: float  # within which signals come; follows how busy the machine is

    def started(self, folder: Path) -> subprocess.Popen[str]:
        return subprocess.Popen(
            [sys.executable, "-c", LOGGED, *self.words, "-o", str(folder / "a.h5"), "--json"],
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            env={**os.environ, "SAVED_LOG": str(folder.with_suffix(".log"))},
        )


@pytest.fixture(scope="module")
def inputs(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """Sources of 500 tasks and their fit."""
    folder = tmp_path_factory.mktemp("inputs")
    paths = {"sources.h5": folder / "sources.h5", "fit.h5": folder / "fit.h5"}
    qinit = Path(sys.executable).with_name("qinit")
    sources = ["train-sources", "gridworld", "--learner", "exact", "--size", "12", "--tasks", "2000"]
    subprocess.run([qinit, *sources, "-o", paths["sources.h5"], "-q"], check=True)
    subprocess.run([qinit, "fit", paths["sources.h5"], "-o", paths["fit.h5"], "-q"], check=True)
    return paths


@pytest.fixture
def job(request: pytest.FixtureRequest, inputs: dict[str, Path], tmp_path: Path) -> Job:
    """The stage's command, run straight through twice: the first run may have to compile."""
    words = tuple(str(inputs.get(word, word)) for word in STAGES[request.param])
    straight = Job(words, "", 0, 0.0)
    for name in ("first", "second"):
        folder = tmp_path / name
        folder.mkdir()
        began = time.monotonic()
        out, err = straight.started(folder).communicate()
        assert out, err
    told = json.loads(out)
    return Job(words, told["digest"], told["tasks"], time.monotonic() - began)


def saved_in(folder: Path) -> set[int]:
    """The ids of the tasks that are safe in the folder: in the artefact, or else in its parts."""
    target = folder / "a.h5"
    if target.exists():
        with open_artefact(target) as artefact:
            artefact.check_tasks()
            return set(artefact.tasks.tolist())
    found: set[int] = set()
    for path in part_paths(work_folder(target)):
        with open_part(path, describe(path).kind) as part:
            part.check_tasks()
            found |= set(part.tasks.tolist())
    return found


def logged(folder: Path) -> list[int]:
    log = folder.with_suffix(".log")
    return [int(line) for line in log.read_text().split()] if log.exists() else []


def interrupted_until_done(
    job: Job, folder: Path, rng: random.Random, signals: tuple[signal.Signals, ...]
) -> Counter[str]:
    """Starts the command up to four times with a signal at a random time, and then without, until it comes to its end."""
    folder.mkdir()
    counts: Counter[str] = Counter()
    for left in reversed(range(rng.randrange(2, 6))):
        before, number = logged(folder), rng.choice(signals)
        process = job.started(folder)
        if left:
            time.sleep(rng.uniform(0, job.seconds))
            process.send_signal(number)
        out, err = process.communicate(timeout=120)
        assert len(set(logged(folder))) == len(logged(folder)), "a task was learned twice"
        assert set(logged(folder)) <= saved_in(folder), "a saved task is lost"
        if process.returncode == 0:
            job.seconds *= 0.8 if left else 1.1
            break
        assert left, err
        # before Python has come to our first line the signal ends it by itself
        assert process.returncode in (-number, 128 + number), err
        assert process.returncode < 0 or "Traceback" not in err
        counts["interrupted"] += 1
        counts["met saved tasks"] += bool(saved_in(folder))
        counts["met the artefact"] += (folder / "a.h5").exists()
    told = json.loads(out)
    assert told["digest"] == job.digest
    learned = len(logged(folder)) - len(before)
    assert told["schema"].startswith("qinit.fit") or told["skipped"] + learned == job.tasks, (told, learned)
    assert [path.name for path in folder.iterdir()] == ["a.h5"], "something is left behind"
    return counts


def interrupt(
    job: Job, folder: Path, most: int, signals: tuple[signal.Signals, ...], seed: int
) -> Counter[str]:
    rng = random.Random(seed)
    counts: Counter[str] = Counter()
    while counts["interrupted"] < most:
        counts += interrupted_until_done(job, folder / str(counts["runs"]), rng, signals)
        counts["runs"] += 1
    return counts


@pytest.mark.parametrize("job", STAGES, indirect=True)
def test_killed_at_random_times_nothing_is_lost_or_learned_twice(
    job: Job, tmp_path: Path, record_property: Callable[[str, Any], None]
) -> None:
    counts = interrupt(job, tmp_path, KILLS, (signal.SIGKILL,), seed=1)
    record_property("counts", dict(counts))
    print(*job.words[:4], dict(counts))


@pytest.mark.parametrize("job", STAGES, indirect=True)
def test_interrupted_and_terminated_at_random_times_nothing_is_lost_or_learned_twice(
    job: Job, tmp_path: Path, record_property: Callable[[str, Any], None]
) -> None:
    counts = interrupt(job, tmp_path, KILLS, (signal.SIGINT, signal.SIGTERM), seed=2)
    record_property("counts", dict(counts))
    print(*job.words[:4], dict(counts))
