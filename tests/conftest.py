"""Running qinit in this process or as a real one, and one small pipeline that many tests look at."""

from __future__ import annotations

import os
import subprocess
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path

import pytest
from ready import Ready, started
from running import QINIT, SMALL_SOURCES, Ended, Pipeline, run_here

from qinit_cli.pipeline import processes

SMALL_TARGETS = ("--tasks", "4", "--episodes", "60")


LONGEST = (
    "test_the_readme_works_as_it_stands",
    "test_every_command_of_the_page_on_gymnasium_works",
    "test_a_failing_call_is_7_and_costs_nothing_that_was_saved[1-40]",
    "test_a_signal_in_the_first_seconds_ends_a_command_as_promised",
    "test_every_module_can_be_the_first_one_imported",
)


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Puts the longest tests first: begun last, one worker would still be at them when the others are done."""
    items.sort(key=lambda item: LONGEST.index(item.name) if item.name in LONGEST else len(LONGEST))


@pytest.fixture(autouse=True)
def plain_surroundings(monkeypatch: pytest.MonkeyPatch, tmp_path_factory: pytest.TempPathFactory) -> None:
    """No option comes from the environment or the configuration of whoever runs the tests."""
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path_factory.getbasetemp() / "no-configuration"))
    for name in [name for name in os.environ if name.startswith("QINIT_")]:
        monkeypatch.delenv(name)
    for name in ("NO_COLOR", "FORCE_COLOR", "COLUMNS"):
        monkeypatch.delenv(name, raising=False)


@pytest.fixture(scope="session")
def ready(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Ready]:
    """A process that has imported everything; its `qinit` is a process of its own, without the wait for imports."""
    with started(tmp_path_factory.mktemp("ready")) as made:
        yield made


@pytest.fixture
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Callable[..., Ended]:
    """Runs one command line in this process, in a folder of its own: `here("list", "--store", store)`."""
    monkeypatch.chdir(tmp_path)
    # other processes know nothing of environments that a test registers in this one
    monkeypatch.setattr(processes, "PATIENCE", 3600.0)

    def call(*arguments: object, stdin: str = "") -> Ended:
        return run_here([str(argument) for argument in arguments], stdin)

    return call


@pytest.fixture
def qinit(tmp_path: Path) -> Callable[..., Ended]:
    """Runs the console script itself in a folder of its own: `qinit("fit", "-", stdin=...)`."""

    def call(*arguments: object, stdin: str = "", env: Mapping[str, str] | None = None) -> Ended:
        ended = subprocess.run(
            [QINIT, *map(str, arguments)],
            input=stdin,
            capture_output=True,
            text=True,
            cwd=tmp_path,
            env={**os.environ, **(env or {})},
            timeout=120,
        )
        return Ended(ended.returncode, ended.stdout, ended.stderr)

    return call


@pytest.fixture
def shell(tmp_path: Path, ready: Ready) -> Callable[..., Ended]:
    """Runs a line of bash with pipefail and with qinit on its path."""

    def call(line: str) -> Ended:
        path = f"{ready.folder}{os.pathsep}{os.environ['PATH']}"
        ended = subprocess.run(
            ["bash", "-c", f"set -o pipefail; {line}"],
            stdin=subprocess.DEVNULL,
            capture_output=True,
            text=True,
            cwd=tmp_path,
            env={**os.environ, "PATH": path},
            timeout=120,
        )
        return Ended(ended.returncode, ended.stdout, ended.stderr)

    return call


@pytest.fixture(scope="session")
def pipeline(tmp_path_factory: pytest.TempPathFactory) -> Pipeline:
    """Made once; look, do not touch."""
    from qinit_cli.methods import METHODS

    store = tmp_path_factory.mktemp("pipeline") / "store"

    def made(*arguments: object) -> Path:
        ended = run_here([*map(str, arguments), "--store", str(store), "--quiet"])
        assert ended.code == 0, ended.err
        return ended.path

    sources = made("train-sources", *SMALL_SOURCES)
    fit = made("fit", sources)
    runs = {
        name: made("transfer", name, fit, *SMALL_TARGETS)
        for name, method in METHODS.items()
        if not method.privileged
    }
    return Pipeline(store, sources, fit, runs)


@pytest.fixture(scope="session")
def tuning(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A choice of UCOI's kappa by twelve sources; made once, look, do not touch."""
    folder = tmp_path_factory.mktemp("tuning")
    small = ["gridworld", "--size", "6", "--variance", "2", "--tasks", "12", "--learner", "exact"]
    path = folder / "tuning.h5"
    commands = (
        ["train-sources", *small, "-o", str(folder / "sources.h5")],
        ["tune", "ucoi", str(folder / "sources.h5"), "--kappa", "1,3", "--episodes", "20", "-o", str(path)],
    )
    for command in commands:
        ended = run_here(command)
        assert ended.code == 0, ended.err
    return path


@pytest.fixture(scope="session")
def lake(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    """A fit of ice with four holes and a goal, where no source has a value, and a run from it."""
    folder = tmp_path_factory.mktemp("lake")
    made = []
    for words in (
        ["train-sources", "gym", "FrozenLake-v1", "--vary", "success_rate=uniform:0.4,0.9", "--tasks", "3",
         "--learner", "exact", "-o", folder / "sources.h5"],
        ["fit", folder / "sources.h5", "-o", folder / "fit.h5"],
        ["transfer", "mean", folder / "fit.h5", "--tasks", "2", "--episodes", "5", "-o", folder / "run.h5"],
    ):  # fmt: skip
        ended = run_here([*map(str, words), "-q"])
        assert ended.code == 0, ended.err
        made.append(ended.path)
    return made[1], made[2]


@pytest.fixture(scope="session")
def relabelled() -> Callable[[Path, Path, str], Path]:
    """Writes a run again: `relabelled(run, path, label)`."""
    return _relabelled


@pytest.fixture(scope="session")
def hostile_run(pipeline: Pipeline, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A run whose label, command and settings are markup, as whoever wrote the file by hand could have it."""
    label = "<script>alert(1)</script><img src=x onerror=alert(1)>"
    return _relabelled(pipeline.runs["mean"], tmp_path_factory.mktemp("hostile") / "hostile.h5", label)


HOSTILE = "=1+1\x1b[31m\x9b2J\x1b]0;title\x07\u202e\u200b[bold]old[/bold]:smile:\n|`$\\frac{$<b>\x7f"  # what a label may hold


@pytest.fixture(scope="session")
def controlling_run(pipeline: Pipeline, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A run whose name, label, command and settings are escape sequences, marks, formulas and line breaks."""
    folder = tmp_path_factory.mktemp("controlling")
    return _relabelled(pipeline.runs["mean"], folder / "run[old]\x1b[2J\u202e\n$_{x}$.h5", HOSTILE)


def _relabelled(run: Path, path: Path, label: str) -> Path:
    """The run again under another path, with that label for its method, and as its command and a note."""
    import numpy as np

    from qinit_store.reading import open_artefact
    from qinit_store.work import open_work

    with open_artefact(run, "run") as artefact:
        spec = {**artefact.spec, "method": {**artefact.spec["method"], "label": label}}
        rows = artefact.rows(0, artefact.task_count)
        own = {column.name: rows[column.name] for column in artefact.schema.task_columns}
        statics = {column.name: artefact.read(column.name) for column in artefact.schema.static_columns}
        with open_work(path, artefact.schema, spec) as work:
            work.save({name: values for name, values in own.items() if name != "task_digest"}, artefact.tasks)
            work.finish(np.arange(spec["tasks"]), statics, provenance={"command": label, label: label})
    return path
