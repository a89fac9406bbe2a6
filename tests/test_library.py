"""The library beside the command: the same settings give the same content hash, in memory and in a store."""

from __future__ import annotations

import csv
import doctest
import json
import subprocess
import sys
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
from running import Ended

import qinit_cli as qinit
from qinit_cli import library
from qinit_cli.environments import FAMILIES
from qinit_cli.errors import NotAllowed, TasksFailed, UsageError
from qinit_cli.learners.exploration import Ucb
from qinit_cli.methods import METHODS
from qinit_cli.options import tunable
from qinit_cli.schedules import Linear
from qinit_store.errors import NotFound

MAPS = Path(__file__).parent / "environments" / "maps"
FAMILY = {
    "gridworld": {"size": 5, "variance": 2},
    "mountain-car": {"noise": 0.005},
    "windy-gridworld": {"size": 5},
    "mixture-gridworld": {"size": 5},
    "gym": {"env_id": "FrozenLake-v1"},
    "continuous-gridworld": {"bins": "6"},
    "puddle-world": {"bins": "6"},
    "cart-pole": {"bins": "1,3,4,3"},
    "acrobot": {"bins": "3"},
    "tasks": {"file": str(MAPS), "use": "0:3"},
}
WORDS = {
    "gridworld": ("--size", 5, "--variance", 2),
    "mountain-car": ("--noise", 0.005),
    "windy-gridworld": ("--size", 5),
    "mixture-gridworld": ("--size", 5),
    "gym": ("FrozenLake-v1",),
    "continuous-gridworld": ("--bins", "6"),
    "puddle-world": ("--bins", "6"),
    "cart-pole": ("--bins", "1,3,4,3"),
    "acrobot": ("--bins", "3"),
    "tasks": (MAPS, "--use", "0:3"),
}


def digest(ended: Ended) -> str:
    assert ended.code == 0, ended.err
    return str(ended.json["digest"])


@pytest.fixture(scope="module")
def sources() -> library.Sources:
    family = qinit.families.gridworld(size=5, variance=2)
    return qinit.train_sources(family, tasks=12, learner="exact")


@pytest.fixture(scope="module")
def fit(sources: library.Sources) -> library.Fit:
    return qinit.fit(sources)


@pytest.mark.parametrize("name", FAMILIES)
def test_sources_of_each_family_are_those_of_the_command(here: Callable[..., Ended], name: str) -> None:
    family = FAMILIES[name](**FAMILY[name])
    made = qinit.train_sources(family, tasks=3, episodes=5, seed=2)
    command = ("train-sources", name, *WORDS[name], "--tasks", 3, "--episodes", 5, "--seed", 2, "--json")
    assert made.digest == digest(here(*command))


@pytest.mark.parametrize("name", METHODS)
def test_a_run_of_each_method_is_that_of_the_command(
    here: Callable[..., Ended], sources: library.Sources, fit: library.Fit, name: str
) -> None:
    words = ("train-sources", "gridworld", *WORDS["gridworld"], "--tasks", 12, "--learner", "exact")
    assert digest(here(*words, "-o", "s.h5", "--json")) == sources.digest
    assert digest(here("fit", "s.h5", "-o", "f.h5", "--json")) == fit.digest
    run = qinit.transfer(name, fit, tasks=3, episodes=6)
    command = ("transfer", name, "f.h5", "--tasks", 3, "--episodes", 6, "--json")
    assert run.digest == digest(here(*command))
    ended = here("start", name, "f.h5", "-o", f"{name}.npy")
    if METHODS[name].privileged:
        assert (ended.code, ended.out) == (4, "")
        assert "the target itself" in ended.err
        return
    assert ended.code == 0, ended.err
    np.testing.assert_array_equal(np.load(f"{name}.npy"), fit.start(name))
    np.testing.assert_array_equal(run["start"], fit.start(name))


def test_a_lifetime_and_a_tuning_are_those_of_the_command(
    here: Callable[..., Ended], fit: library.Fit, sources: library.Sources
) -> None:
    words = ("train-sources", "gridworld", *WORDS["gridworld"], "--tasks", 12, "--learner", "exact")
    here(*words, "-o", "s.h5")
    here("fit", "s.h5", "-o", "f.h5")
    lived = qinit.lifelong("logqinit-median", fit, update=True, tasks=3, episodes=6)
    command = ("lifelong", "logqinit-median", "f.h5", "--update", "--tasks", 3, "--episodes", 6, "--json")
    assert lived.digest == digest(here(*command))
    name = next(name for name, method in METHODS.items() if tunable(method))
    tuned = qinit.tune(name, sources, episodes=4)
    assert tuned.digest == digest(here("tune", name, "s.h5", "--episodes", 4, "--json"))
    assert set(tuned.choice) == set(tunable(METHODS[name]))


def test_learners_explorations_and_schedules_are_those_of_the_command(here: Callable[..., Ended]) -> None:
    family = qinit.families.gridworld(size=5, variance=2)
    sources = qinit.train_sources(family, tasks=12, episodes=9, learner=qinit.learners.r_max(known=3))
    words = ("train-sources", "gridworld", *WORDS["gridworld"], "--tasks", 12, "--episodes", 9)
    assert digest(here(*words, "--learner", "r-max:known=3", "-o", "s.h5", "--json")) == sources.digest
    assert sources.settings["learning"]["learner"]["known"] == 3
    assert "-r-max-" in sources.name
    unknown = sources["visits"] < 3  # which hold what they began as
    assert unknown.any()
    assert (sources["q"][unknown] == 1).all()
    assert (sources["q"][~unknown] < 1).any()
    fit = qinit.fit(sources)
    here("fit", "s.h5", "-o", "f.h5")
    how: dict[str, Any] = {
        "learner": "sarsa-lambda:lambda=0.8",
        "explore": Ucb(0.2),
        "alpha": Linear(1, 0.1, 3),
    }
    run = qinit.transfer("mean", fit, tasks=3, episodes=6, **how)
    typed = ("--learner", "sarsa-lambda:lambda=0.8", "--explore", "ucb:c=0.2", "--alpha", "linear:1:0.1:3")
    command = ("transfer", "mean", "f.h5", "--tasks", 3, "--episodes", 6, *typed)
    assert digest(here(*command, "-o", "r.h5", "--json")) == run.digest
    assert qinit.lifelong("mean", fit, tasks=3, episodes=6, **how).digest == run.digest
    tuned = qinit.tune("ucoi", sources, grid={"kappa": [1.0]}, episodes=4, **how)
    ended = here("tune", "ucoi", "s.h5", "--kappa", 1, "--episodes", 4, *typed, "--json")
    assert tuned.digest == digest(ended)
    asked = "--learner sarsa-lambda:lambda=0.8 --explore ucb:c=0.2 takes it"  # as it was tuned
    assert asked in " ".join(ended.err.split())
    assert np.isnan(run["v_eps"]).all()  # what UCB comes to is unknown
    assert here("show", "r.h5", "--json").json["numbers"]["v_eps"] is None
    assert here("verify", "r.h5").code == 0
    [row] = qinit.compare([run], baseline=run.name).rows
    assert row["regret"] is None


def test_a_store_holds_the_artefact_that_memory_holds_and_the_command_goes_on_with(
    here: Callable[..., Ended], sources: library.Sources, tmp_path: Path
) -> None:
    family = qinit.families.gridworld(size=5, variance=2)
    kept = qinit.train_sources(family, tasks=12, learner="exact", store="kept")
    assert kept.path is not None
    assert kept.digest == sources.digest
    words = ("train-sources", "gridworld", *WORDS["gridworld"], "--tasks", 12, "--learner", "exact")
    ended = here(*words, "--store", "kept")
    assert ended.out == f"{kept.path}\n"
    assert "already complete" in ended.err
    assert sorted(tmp_path.iterdir()) == [tmp_path / "kept"]
    named = qinit.open(kept.name, store="kept")
    assert (type(named), named.digest) == (library.Sources, kept.digest)


def test_a_file_says_the_command_that_makes_it_again(here: Callable[..., Ended]) -> None:
    family = qinit.families.gridworld(size=5, variance=2)
    made = qinit.train_sources(family, tasks=2, learner="exact", output="a.h5")
    with h5py.File("a.h5") as file:
        command = json.loads(bytes(file.attrs["provenance_json"]))["command"].split()
    assert command[:3] == ["qinit", "train-sources", "gridworld"]
    assert digest(here(*command[1:-1], "b.h5", "--json")) == made.digest


def test_memory_writes_no_file(fit: library.Fit, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    assert qinit.transfer("mean", fit, tasks=2, episodes=3).path is None
    assert list(tmp_path.iterdir()) == []


def test_arrays_have_names_and_a_dataset_has_their_axes(fit: library.Fit, sources: library.Sources) -> None:
    # the first moments by numpy alone: a pair is known where a source has a positive value
    q = np.where(sources["q"] > 0, sources["q"], np.nan)
    known = ~np.isnan(q).all(axis=0)
    dataset = fit.to_xarray()
    assert dataset["mu"].dims == ("row", "col", "action")
    np.testing.assert_allclose(
        dataset["mu"].values[known], np.nanmean(np.log(q[:, known]), axis=0), rtol=1e-12
    )
    assert dataset["action"].values.tolist() == ["up", "down", "left", "right"]
    with pytest.raises(KeyError, match="mu"):
        fit["nothing"]


def test_a_start_table_in_every_format_is_the_same(here: Callable[..., Ended], fit: library.Fit) -> None:
    here("train-sources", "gridworld", *WORDS["gridworld"], "--tasks", 12, "--learner", "exact", "-o", "s.h5")
    here("fit", "s.h5", "-o", "f.h5")
    wanted = fit.start("logqinit-mean")
    for ending in ("npz", "npy", "csv", "h5"):
        ended = here("start", "logqinit-mean", "f.h5", "-o", f"start.{ending}")
        assert (ended.code, ended.out) == (0, f"start.{ending}\n"), ended.err
        again = here(
            "start", "logqinit-mean", "f.h5", "-o", f"start.{ending}"
        )  # the same bytes take no --force
        assert again.code == 0, again.err
    with np.load("start.npz") as archive:
        np.testing.assert_array_equal(archive["start"], wanted)
        assert archive["action"].tolist() == ["up", "down", "left", "right"]
        assert str(archive["fit"]) == fit.digest
    with Path("start.csv").open() as file:
        rows = list(csv.DictReader(file))
    row = next(one for one in rows if (one["row"], one["col"], one["action"]) == ("1", "2", "left"))
    assert float(row["start"]) == wanted[1, 2, 2]
    with h5py.File("start.h5") as file:
        np.testing.assert_array_equal(file["start"][...], wanted)
        assert file["start"].dims[2][0][...].tolist() == [b"up", b"down", b"left", b"right"]


@pytest.mark.parametrize(("words", "code"), [(("-o", "start.txt"), 2), ((), 2), (("-o", "f.h5"), 2)])
def test_a_start_table_goes_nowhere_else(
    here: Callable[..., Ended], words: tuple[str, ...], code: int
) -> None:
    here("train-sources", "gridworld", *WORDS["gridworld"], "--tasks", 3, "--learner", "exact", "-o", "s.h5")
    here("fit", "s.h5", "-o", "f.h5")
    assert here("start", "mean", "f.h5", *words).code == code


def test_a_comparison_has_the_rows_of_the_command(here: Callable[..., Ended], fit: library.Fit) -> None:
    runs = [qinit.transfer(name, fit, tasks=4, episodes=8) for name in ("zero", "mean")]
    rows = qinit.compare(runs).rows
    for number, run in enumerate(runs):
        store = f"store{number}"
        method = run.settings["method"]["name"]
        qinit.transfer(method, fit, tasks=4, episodes=8, store=store)
    paths = [str(path) for path in sorted(Path().glob("store*/runs/*.h5"))]
    told = here("compare", *paths, "--json")
    assert told.json["rows"] == json.loads(json.dumps(rows))
    matrices = qinit.compare(runs).to_rliable()
    assert here("compare", *paths, "--scores", "scores.npz").code == 0
    with np.load("scores.npz") as packed:
        assert packed.files == list(matrices) == ["zero", "mean"]
        for run, label in zip(runs, matrices, strict=True):
            np.testing.assert_array_equal(matrices[label], run.returns().mean(axis=1)[None])
            np.testing.assert_array_equal(packed[label], matrices[label])
    frame = qinit.compare(runs).to_pandas()
    assert frame["method"].tolist() == ["zero", "mean"]
    averages = [float(run.returns().mean()) for run in runs]
    np.testing.assert_allclose(frame["return"], averages, rtol=1e-12)


def test_a_reporter_hears_and_nothing_is_printed(capfd: pytest.CaptureFixture[str]) -> None:
    class Heard(qinit.Reporter):
        def __init__(self) -> None:
            self.begun: list[tuple[str, int, int]] = []

        def progress(self, what: str, done: int, total: int, watch: Any) -> Any:
            self.begun.append((what, done, total))
            return super().progress(what, done, total, watch)

    heard = Heard()
    family = qinit.families.gridworld(size=4, variance=1)
    qinit.train_sources(family, tasks=2, learner="exact", reporter=heard)
    assert heard.begun == [("sources", 0, 2)]
    assert capfd.readouterr() == ("", "")


def test_errors_are_those_that_the_command_turns_into_exit_codes(
    fit: library.Fit, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    family = qinit.families.gridworld(size=4, variance=1)
    with pytest.raises(UsageError, match="--tasks is 0"):
        qinit.train_sources(family, tasks=0)
    with pytest.raises(UsageError, match="no method"):
        qinit.transfer("none", fit)
    with pytest.raises(NotAllowed, match="target itself"):
        fit.start("optimal")
    with pytest.raises(NotFound):
        qinit.open("nothing")
    with pytest.raises(NotAllowed, match="at least 2"):
        qinit.fit(qinit.train_sources(family, tasks=1, learner="exact"))
    with pytest.raises(UsageError, match="no parameter kapa"):
        qinit.tune("ucoi", qinit.train_sources(family, tasks=3, learner="exact"), grid={"kapa": [1.0]})
    with pytest.raises(AttributeError, match="gridworld"):
        _ = qinit.families.gridwold


def test_another_thread_than_the_main_one_may_learn(sources: library.Sources) -> None:
    family = qinit.families.gridworld(size=5, variance=2)
    with ThreadPoolExecutor(1) as threads:
        made = threads.submit(qinit.train_sources, family, tasks=12, learner="exact").result()
    assert made.digest == sources.digest


def test_a_failed_task_raises(monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(*_: Any) -> Any:
        raise RuntimeError("no")

    monkeypatch.setattr("qinit_cli.pipeline.sources.draw_tasks", fail)
    with pytest.raises(TasksFailed):
        qinit.train_sources(qinit.families.gridworld(size=4), tasks=2, learner="exact")


def test_names_are_loaded_late_and_none_needs_typer() -> None:
    script = (
        "import sys, qinit_cli as q\n"
        "assert 'numpy' not in sys.modules and 'qinit_cli.library' not in sys.modules\n"
        "assert sorted(q.__all__) == [name for name in dir(q) if not name.startswith('__')]\n"
        "assert all(getattr(q, name) is not None for name in q.__all__)\n"
        "assert 'logqinit-median' in q.methods and q.methods.zero().name == 'zero'\n"
        "for name in ('typer', 'click', 'rich', 'matplotlib', 'qinit_cli.app'):\n"
        "    assert name not in sys.modules, name\n"
        "assert not [name for name in sys.modules if name.startswith('qinit_cli.commands')]\n"
    )
    subprocess.run([sys.executable, "-W", "error", "-c", script], check=True, timeout=60)


def test_the_examples_of_the_docstrings_hold() -> None:
    found = doctest.testmod(library)
    assert found.attempted >= 6
    assert not found.failed
