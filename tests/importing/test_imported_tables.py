"""Tables of other programs become sources to the last bit, and nothing that is unknown becomes a number."""

from __future__ import annotations

import json
import pickle
import zipfile
from collections import defaultdict
from collections.abc import Callable
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pandas as pd
import pytest
from running import Ended

import qinit_cli as qinit
from qinit_cli import library
from qinit_cli.errors import NotAllowed, UsageError

SHAPE = (6, 3, 4, 2)
WORDS = ("--gamma", 0.9, "--actions", "stay,go")


@pytest.fixture
def q() -> Any:
    return np.random.default_rng(7).random(SHAPE)


def long(q: Any, names: list[str], actions: list[str]) -> pd.DataFrame:
    """The table as pandas lays it out, a row for each task, state and action."""
    levels = [range(length) for length in q.shape[:-1]]
    index = pd.MultiIndex.from_product([*levels, actions], names=["task", *names, "action"])
    return pd.Series(q.ravel(), index, name="q").reset_index()


def write_fortran(path: Path, q: Any) -> None:
    np.save(path, np.asfortranarray(q))


def write_halves(path: Path, q: Any) -> None:
    np.savez_compressed(path, **{"any name": q.astype(np.float32)})


WRITERS: dict[str, Callable[[Path, Any], Any]] = {
    "plain.npy": lambda path, q: np.save(path, q),
    "fortran.npy": write_fortran,
    "alone.npz": lambda path, q: np.savez(path, whatever=q),
    "squeezed.npz": lambda path, q: np.savez_compressed(path, q=q, visits=np.ones(q.shape, int)),
    "pandas.csv": lambda path, q: long(q, ["row", "col"], ["stay", "go"]).to_csv(path, index=False),
    "pandas.tsv": lambda path, q: long(q, ["row", "col"], ["0", "1"]).to_csv(path, index=False, sep="\t"),
    "pandas.parquet": lambda path, q: long(q, ["row", "col"], ["stay", "go"]).to_parquet(path),
}


@pytest.mark.parametrize("name", WRITERS)
def test_a_file_of_numpy_or_pandas_comes_in_to_the_last_bit(
    here: Callable[..., Ended], q: Any, name: str
) -> None:
    WRITERS[name](Path(name), q)
    ended = here("import", name, *WORDS, "-o", "s.h5")
    assert ended.code == 0, ended.err
    with h5py.File("s.h5") as file:
        assert file["q"][()].tobytes() == q.tobytes()
        assert [action.decode() for action in file["action"]] == ["stay", "go"]
        assert {"eopl", "td_var", "solved", "steps"}.isdisjoint(file)
        assert ("visits" in file) == (name == "squeezed.npz")


def test_several_files_of_a_task_each_and_single_precision(here: Callable[..., Ended], q: Any) -> None:
    for task, table in enumerate(q):
        write_halves(Path(f"{task}.npz"), table)
    files = [f"{task}.npz" for task in range(len(q))]
    assert here("import", *files, *WORDS, "--axes", "row=3,col=4", "-o", "s.h5").code == 0
    sources = qinit.open("s.h5")
    assert (sources["q"] == q.astype(np.float32)).all()
    assert len(sources.settings["files"]) == len(files)


def test_a_dataset_in_hdf5_and_what_qinit_itself_wrote(here: Callable[..., Ended], q: Any) -> None:
    with h5py.File("theirs.h5", "w") as file:
        file["agent/Q"], file["agent/visits"] = q, np.full(SHAPE, 2)
    assert here("import", "theirs.h5:/agent/Q", *WORDS, "-o", "s.h5").code == 0
    again = here("import", "s.h5", *WORDS, "-o", "again.h5")
    assert again.code == 0, again.err
    with h5py.File("again.h5") as file:
        assert (file["q"][()] == q).all()
        assert (file["visits"][()] == 2).all()


def test_rows_of_an_export_come_in_again(here: Callable[..., Ended]) -> None:
    assert (
        here("train-sources", "gridworld", "--size", 4, "--tasks", 3, "--learner", "exact", "-o", "a.h5").code
        == 0
    )
    assert here("export", "a.h5", "-o", "a.csv").code == 0
    # exact tables were never visited
    words = ("--axes", "row=4,col=4", "--actions", "up,down,left,right", "--gamma", 0.95, "--min-visits", 0)
    assert here("import", "a.csv", *words, "-o", "b.h5").code == 0
    first, second = qinit.open("a.h5"), qinit.open("b.h5")
    assert (first["q"] == second["q"]).all()
    one, other = (qinit.fit(saved) for saved in (first, second))
    assert (one["mu"][one["n"] > 0] == other["mu"][other["n"] > 0]).all()
    assert one["eopl_n"].any()
    assert not other["eopl_n"].any()


def test_a_fit_has_the_moments_of_what_was_known(q: Any) -> None:
    """Entries of NaN, and of pairs updated less often than --min-visits, are in no moment."""
    visits = np.random.default_rng(1).integers(0, 5, SHAPE)
    q[0, 0, 0, 0] = np.nan
    fit = qinit.fit(
        qinit.import_tables({"q": q, "visits": visits}, gamma=0.9, min_visits=2), normality="none"
    )
    known = (visits >= 2) & ~np.isnan(q)
    logs = np.where(known, np.log(np.where(known, q, 1)), np.nan)
    assert (fit["n"] == known.sum(axis=0)).all()
    assert fit["mu"] == pytest.approx(np.nanmean(logs, axis=0), rel=1e-13, nan_ok=True)
    assert fit["sigma"] == pytest.approx(np.nanstd(logs, axis=0), rel=1e-12, nan_ok=True)
    assert np.isnan(fit["library_td_var"]).all()


def test_returns_of_costs_are_fitted_as_shares(q: Any) -> None:
    costs = 20 * q - 20
    fit = qinit.fit(qinit.import_tables(costs, gamma=0.9, returns="-20:0"), normality="none")
    assert fit["mu"] == pytest.approx(np.log(q).mean(axis=0), rel=1e-9)
    assert fit.start("maxqinit") == pytest.approx(costs.max(axis=0))
    assert fit.start("logqinit-median") == pytest.approx(20 * np.exp(np.log(q).mean(axis=0)) - 20)


def test_the_agent_of_gymnasiums_tutorial(here: Callable[..., Ended]) -> None:
    """A defaultdict of states to rows, written as a user would: pairs that were never met are unknown."""
    agent: defaultdict[tuple[int, int, int], Any] = defaultdict(lambda: np.zeros(2))
    agent[(13, 2, 0)] += [0.25, -0.5]
    agent[(20, 10, 1)] += [-0.75, 0.5]
    rows = [
        (task, *state, action, value + task / 8)
        for task in range(2)
        for state, values in agent.items()
        for action, value in enumerate(values.tolist())
    ]
    names = ["task", "sum", "dealer", "ace", "action", "q"]
    pd.DataFrame(rows, columns=names).to_csv("blackjack.csv", index=False)
    assert here("import", "blackjack.csv", "--gamma", 1, "--returns=-1:1", "-o", "s.h5").code == 0
    sources = qinit.open("s.h5")
    assert [sources[name].tolist() for name in ("sum", "dealer", "ace")] == [[13, 20], [2, 10], [0, 1]]
    fit = qinit.fit(sources, normality="none")
    met = np.zeros((2, 2, 2, 2), bool)
    met[0, 0, 0] = met[1, 1, 1] = True
    assert ((fit["n"] > 0) == met).all()
    assert fit["mean"][0, 0, 0].tolist() == pytest.approx([0.3125, -0.4375])


def test_what_the_posterior_lacks_and_takes(q: Any) -> None:
    with pytest.raises(NotAllowed, match="variances of their TD errors, which are unknown"):
        qinit.fit(qinit.import_tables(q, gamma=0.9)).start("posterior")
    given = qinit.import_tables({"q": q, "td_var": np.full(SHAPE, 0.01)}, gamma=0.9)
    assert qinit.fit(given).start("posterior") == pytest.approx(q.mean(axis=0))


def test_no_environment_means_no_target_and_no_path(here: Callable[..., Ended], q: Any) -> None:
    np.save("q.npy", q)
    assert here("import", "q.npy", "--gamma", 0.9, "--name", "mine", "-o", "s.h5").code == 0
    assert here("fit", "s.h5", "-o", "f.h5").code == 0
    for words in (("transfer", "zero", "f.h5"), ("tune", "ucoi", "s.h5"), ("lifelong", "zero", "f.h5")):
        ended = here(*words)
        assert ended.code == 2
        assert "imported-mine was learned elsewhere, and has no environment here" in ended.err
    for words in (("fit", "s.h5", "--check-theory"), ("plot", "eopl", "s.h5", "-o", "p.png")):
        ended = here(*words)
        assert ended.code == 4
        assert "path lengths" in ended.err
        assert "unknown" in ended.err


def test_all_that_reads_sources_takes_imported_ones(here: Callable[..., Ended], q: Any) -> None:
    np.save("q.npy", q)
    path = here("import", "q.npy", *WORDS).path
    fit = here("fit", path, "--holdout", 2).path
    for words in (
        ("show", path),
        ("verify", path),
        ("list",),
        ("plot", "histograms", path, "-o", "h.png"),
        ("plot", "heatmaps", fit, "-o", "m.png"),
        ("report", path, fit, "-o", "r.html"),
        ("start", "logqinit-median", fit, "-o", "start.npz"),
    ):
        assert here(*words).code == 0, words
    shown = here("show", path, "--json").json
    assert shown["spec"]["learner"] == "imported"
    assert shown["inputs"][0]["name"] == "q.npy"
    with np.load("start.npz") as start:
        assert start["start"] == pytest.approx(np.exp(np.log(q[:4]).mean(axis=0)))


def test_the_same_file_is_the_same_artefact_and_another_is_another(
    here: Callable[..., Ended], q: Any
) -> None:
    np.save("q.npy", q)
    expected = here("import", "q.npy", "--gamma", 0.9, "--dry-run", "--json").json
    assert not Path("qinit-store").exists()
    first = here("import", "q.npy", "--gamma", 0.9, "--json").json
    assert (expected["path"], expected["tasks"]) == (first["path"], len(q))
    assert first["digest"] == qinit.import_tables("q.npy", gamma=0.9).digest
    assert here("import", "q.npy", "--gamma", 0.9, "--json").json["skipped"] == len(q)
    np.save("q.npy", q / 2)
    assert here("import", "q.npy", "--gamma", 0.9, "--json").json["path"] != first["path"]


def test_nothing_is_unpickled(here: Callable[..., Ended], tmp_path: Path) -> None:
    class Trap:
        def __reduce__(self) -> Any:
            return (Path(tmp_path / "sprung").touch, ())

    Path("agent.pkl").write_bytes(pickle.dumps(Trap()))
    np.save("agent.npy", np.array([Trap()], object), allow_pickle=True)
    with zipfile.ZipFile("agent.npz", "w") as archive:
        archive.write("agent.npy", "q.npy")
    for name in ("agent.pkl", "agent.npy", "agent.npz"):
        ended = here("import", name, "--gamma", 0.9)
        assert ended.code == 4
        assert "convert it: python -c 'import numpy, pickle; numpy.save(" in ended.err
    assert not (tmp_path / "sprung").exists()


def test_the_line_that_converts_a_pickle_runs_nothing_but_python(here: Callable[..., Ended]) -> None:
    import shlex

    told = here("import", "a$(touch x).pkl", "--gamma", 0.9).err
    words = shlex.split(told.partition("convert it: ")[2])
    assert words[:2] == ["python", "-c"]
    assert "'a$(touch x).pkl'" in words[2]
    assert len(words) == 3


def test_a_damaged_archive_is_refused(here: Callable[..., Ended], q: Any) -> None:
    np.savez_compressed("q.npz", q=q)
    content = bytearray(Path("q.npz").read_bytes())
    content[len(content) // 2] ^= 255
    Path("q.npz").write_bytes(content)
    ended = here("import", "q.npz", "--gamma", 0.9)
    assert ended.code == 4
    assert "q.npz:q cannot be read" in ended.err


REFUSED = {
    "range": (
        {"q": np.full((2, 3, 2), 1.5)},
        {},
        "task 0 of memory has the value 1.5, and returns are from 0 to 1",
    ),
    "infinite": ({"q": np.full((2, 3, 2), np.inf)}, {}, "has the value inf"),
    "axes": (
        {"q": np.ones((2, 3, 2))},
        {"axes": "row=2,col=2"},
        r"has the shape \(2, 3, 2\); \(N, 2, 2, A\)",
    ),
    "names": (
        {"q": np.ones((2, 3, 2))},
        {"actions": "up"},
        "--actions names 1 action, and the tables have 2",
    ),
    "alike": ({"q": np.ones((2, 3, 2))}, {"actions": "up,up"}, "are not distinct"),
    "visits": ({"q": np.ones((2, 3, 2)), "visits": np.ones((2, 3))}, {}, r"visits \(visits\) has the shape"),
    "parts": (
        {"q": np.ones((2, 3, 2)), "visits": np.full((2, 3, 2), 0.5)},
        {},
        "visits of memory has the value 0.5",
    ),
    "spread": (
        {"q": np.ones((2, 3, 2)), "td_var": np.full((2, 3, 2), -1)},
        {},
        "td_var of memory has the value -1",
    ),
    "text": ({"q": np.full((2, 3, 2), "a")}, {}, "action values are real numbers"),
    "empty": ({"q": np.ones((0, 3, 2))}, {}, r"has the shape \(0, 3, 2\)"),
    "strange": ({"q": np.ones((2, 3, 2)), "eopl": np.ones((2, 3, 2))}, {}, "there is no eopl in sources"),
    "scalar": ({"q": np.float64(0.5)}, {}, r"has the shape \(\); tables have states and actions at least"),
    "taken": (
        {"q": np.ones((2, 3, 2))},
        {"axes": "mean=3"},
        "--axes has the name mean, which artefacts use",
    ),
    "letters": ({"q": np.ones((2, 3, 2))}, {"axes": "State=3"}, "names distinct and of lower-case letters"),
    "signs": ({"q": np.ones((2, 3, 2))}, {"actions": "é,b"}, "the action 'é' is no ASCII text"),
    "bounds": ({"q": np.ones((2, 3, 2))}, {"returns": "1:2"}, "with 0 within them"),
}


@pytest.mark.parametrize("fault", REFUSED)
def test_arrays_that_cannot_be_tables_are_refused(fault: str) -> None:
    arrays, options, words = REFUSED[fault]
    with pytest.raises((NotAllowed, UsageError), match=words):
        library.import_tables(arrays, gamma=0.9, **options)


ROWS = {
    "twice": (["0,0,0,.1", "0,0,0,.2"], "two rows for one task, state and action"),
    "apart": (["0,0,0,.1", "1,0,0,.2", "0,1,0,.3"], "the rows of task 0 do not stand together"),
    "short": (["0,0,0"], "a row of 3 values where its header has 4"),
    "word": (["0,here,0,.1"], "column state of rows.csv has a value that is no number"),
    "none": ([], "rows.csv has no rows"),
    "nowhere": (["0,,0,.1"], "column state of rows.csv has a row without a state"),
    "bytes": (["0,0,0,\udc80"], "rows.csv is no table in UTF-8"),
}


@pytest.mark.parametrize("fault", ROWS)
def test_rows_that_cannot_be_tables_are_refused(here: Callable[..., Ended], fault: str) -> None:
    rows, words = ROWS[fault]
    Path("rows.csv").write_text("\n".join(["task,state,action,q", *rows]), errors="surrogateescape")
    ended = here("import", "rows.csv", "--gamma", 0.9)
    assert ended.code == 4
    assert words in ended.err


def test_a_value_that_is_missing_is_unknown(here: Callable[..., Ended]) -> None:
    Path("rows.csv").write_text(
        "task,state,action,q,visits,td_var\n0,0,a,.5,3,.1\n0,1,b,,,\n1,0,a,.25,1,.2\n1,1,b,1,0,.3\n"
    )
    assert here("import", "rows.csv", "--gamma", 0.9, "-o", "s.h5").code == 0
    sources = qinit.open("s.h5")
    assert sources["visits"].tolist() == [[[3, 0], [0, 0]], [[1, 0], [0, 0]]]
    assert sources["td_var"].tolist() == [[[0.1, 0], [0, 0]], [[0.2, 0], [0, 0.3]]]
    assert qinit.fit(sources, normality="none")["n"].tolist() == [[2, 0], [0, 0]]


def test_rows_are_read_in_blocks_across_tasks(
    monkeypatch: pytest.MonkeyPatch, q: Any, tmp_path: Path
) -> None:
    """Chunks of rows that end within tasks, and blocks that end within chunks, leave no trace."""
    from qinit_cli.importing import rows, tables

    monkeypatch.setattr(rows, "AT_ONCE", 11)
    monkeypatch.setattr(tables, "HELD_BYTES", 2 * 8 * q[0].size)
    path = tmp_path / "q.csv"
    long(q, ["row", "col"], ["0", "1"]).sample(frac=1, random_state=0).sort_values("task").to_csv(
        path, index=False
    )
    assert (qinit.import_tables(path, gamma=0.9)["q"] == q).all()


def test_an_imported_artefact_without_its_files_is_refused(here: Callable[..., Ended], q: Any) -> None:
    """Settings that no import makes are those of a damaged file."""
    sources = qinit.import_tables(q, gamma=0.9)
    from qinit_cli.artefacts.settings import SourcesSettings

    told = json.loads(json.dumps(sources.settings))
    assert SourcesSettings.read(told).spec() == sources.settings
    for broken in ({"files": []}, {"files": ["x"]}, {"learner": "exact"}):
        with pytest.raises(ValueError, match=r"files|learning"):
            SourcesSettings.read(told | broken)
