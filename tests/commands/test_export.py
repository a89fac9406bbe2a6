"""`qinit export`: what is written is what the artefact holds, by readers that know nothing of qinit."""

from __future__ import annotations

import csv
import io
import json
import os
import re
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from itertools import product
from pathlib import Path
from typing import TYPE_CHECKING

import h5py
import numpy as np
import pytest
import xarray

import qinit_cli as qinit
from qinit_cli.artefacts import long_tables, named_arrays
from qinit_cli.artefacts.kinds import KINDS
from qinit_store.reading import open_artefact

if TYPE_CHECKING:
    from running import Ended, Pipeline

QINIT = Path(sys.executable).with_name("qinit")


@pytest.fixture
def of(pipeline: Pipeline, tuning: Path) -> dict[str, Path]:
    """An artefact of each kind."""
    run = pipeline.runs["logqinit-median"]
    return {"sources": pipeline.sources, "fit": pipeline.fit, "run": run, "tuning": tuning}


def _rows(text: str) -> list[dict[str, str]]:
    return list(csv.DictReader(io.StringIO(text)))


@pytest.fixture
def unknown(here: Callable[..., Ended], tmp_path: Path) -> Path:
    """A fit with NaN in it: by shen, which has no median."""
    sources = here(
        "train-sources",
        "gridworld",
        "--size",
        "4",
        "--tasks",
        "3",
        "--learner",
        "exact",
        "-o",
        tmp_path / "s.h5",
    )
    return here("fit", sources.path, "--estimator", "shen", "-o", tmp_path / "unknown.h5").path


def test_a_run_has_a_row_for_each_episode_of_each_target(
    here: Callable[..., Ended], of: dict[str, Path]
) -> None:
    path = of["run"]
    rows = _rows(here("export", path, "--to", "csv").out)
    with h5py.File(path) as file:
        steps, reached, p = (file[name][...] for name in ("steps", "reached", "p"))
        gamma = json.loads(file.attrs["spec_json"])["learning"]["gamma"]
    assert len(rows) == steps.size
    for row, (target, episode) in zip(rows, product(*map(range, steps.shape)), strict=True):
        assert (row["artefact"], row["method"]) == (path.stem, "logqinit-median")
        assert (int(row["task"]), int(row["episode"])) == (target, episode)
        assert float(row["p"]) == p[target]
        assert (int(row["steps"]), int(row["reached"])) == (steps[target, episode], reached[target, episode])
        earned = gamma ** (int(row["steps"]) - 1) if row["reached"] == "1" else 0.0
        assert float(row["return"]) == pytest.approx(earned, rel=1e-12)


def test_targets_have_a_row_each_with_their_means(here: Callable[..., Ended], of: dict[str, Path]) -> None:
    path = of["run"]
    targets = _rows(here("export", path, "--to", "csv", "--what", "targets").out)
    episodes = _rows(here("export", path, "--to", "csv").out)
    for row in targets:
        earned = [float(one["return"]) for one in episodes if one["task"] == row["task"]]
        assert float(row["average_return"]) == pytest.approx(np.mean(earned))
        assert float(row["first_10"]) == pytest.approx(np.mean(earned[:10]))
        assert float(row["last_tenth"]) == pytest.approx(np.mean(earned[-6:]))
        assert re.fullmatch("[0-9a-f]{64}", row["task_digest"])
    assert len(targets) == 4


def test_a_fit_has_a_row_for_each_state_action(here: Callable[..., Ended], pipeline: Pipeline) -> None:
    rows = _rows(here("export", pipeline.fit, "--to", "csv").out)
    with h5py.File(pipeline.fit) as file:
        mu, n = file["mu"][...], file["n"][...]
        actions = [name.decode() for name in file["action"][...]]
    assert len(rows) == mu.size
    for row in rows:
        at = (int(row["row"]), int(row["col"]), actions.index(row["action"]))
        assert int(row["n"]) == n[at]
        assert (float(row["mu"]) if row["mu"] else None) == (mu[at] if np.isfinite(mu[at]) else None)


def test_sources_have_a_row_for_each_task_and_state_action(
    here: Callable[..., Ended], pipeline: Pipeline, tmp_path: Path
) -> None:
    import pandas

    out = here("export", pipeline.sources, "-o", tmp_path / "s.csv").out
    frame = pandas.read_csv(out.strip())
    with h5py.File(pipeline.sources) as file:
        for name in ("q", "td_var", "eopl", "visits"):
            assert np.array_equal(frame[name].to_numpy(), file[name][...].ravel())
        assert np.array_equal(frame["goal_row"].to_numpy(), np.repeat(file["goal_row"][...], 6 * 6 * 4))


@pytest.mark.parametrize(("kind", "table"), [(kind, table) for kind in KINDS for table in KINDS[kind].tables])
def test_every_table_reads_alike_from_csv_and_from_parquet(
    here: Callable[..., Ended], of: dict[str, Path], tmp_path: Path, kind: str, table: str
) -> None:
    parquet = pytest.importorskip("pyarrow.parquet")
    path = of[kind]
    text = here("export", path, "--to", "csv", "--what", table)
    if table in (
        "evaluations",
        "final",
        "weights",
        "probes",
        "start-weights",
    ):  # which these artefacts have not
        assert text.code == 4
        return
    there = parquet.read_table(
        here("export", path, "--what", table, "-o", tmp_path / "t.parquet").out.strip()
    )
    rows = _rows(text.out)
    assert list(rows[0]) == there.column_names
    for name in there.column_names:
        for here_, value in zip((row[name] for row in rows), there[name].to_pylist(), strict=True):
            assert here_ == "" if value is None else type(value)(here_) == value


def test_parquet_carries_hash_and_settings(
    here: Callable[..., Ended], pipeline: Pipeline, tmp_path: Path
) -> None:
    parquet = pytest.importorskip("pyarrow.parquet")
    here("export", pipeline.fit, "-o", tmp_path / "f.parquet")
    said = json.loads(parquet.read_schema(tmp_path / "f.parquet").metadata[b"qinit"])
    with h5py.File(pipeline.fit) as file:
        assert said["artefacts"][0]["content_sha256"] == file.attrs["content_sha256"].decode()
        assert said["artefacts"][0]["spec"] == json.loads(file.attrs["spec_json"])


def test_values_that_are_not_there_are_null_or_empty(
    here: Callable[..., Ended], unknown: Path, tmp_path: Path
) -> None:
    assert {row["lognormal_median"] for row in _rows(here("export", unknown, "--to", "csv").out)} == {""}
    said = here("export", unknown, "--to", "json").out
    assert not re.search(r"NaN|Infinity", said)
    medians = json.loads(said)["artefacts"][0]["arrays"]["lognormal_median"]["values"]
    assert {value for row in medians for cell in row for value in cell} == {None}
    parquet = pytest.importorskip("pyarrow.parquet")
    here("export", unknown, "-o", tmp_path / "u.parquet")
    column = parquet.read_table(tmp_path / "u.parquet")["lognormal_median"]
    assert column.null_count == len(column)


def test_without_pyarrow_parquet_is_refused_with_what_to_install(
    here: Callable[..., Ended], pipeline: Pipeline, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "pyarrow", None)
    ended = here("export", pipeline.fit, "-o", tmp_path / "f.parquet")
    assert ended.code == 2
    assert "pip install -e '.[parquet]'" in ended.err
    assert len(ended.err.splitlines()) == 1
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("kind", list(KINDS))
@pytest.mark.parametrize("held", [0, named_arrays.HELD_BYTES])
def test_npz_and_json_hold_every_array(
    here: Callable[..., Ended],
    of: dict[str, Path],
    tmp_path: Path,
    kind: str,
    held: int,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Also where each column is too large to be held."""
    monkeypatch.setattr(named_arrays, "HELD_BYTES", held)
    path = of[kind]
    with np.load(here("export", path, "-o", tmp_path / "a.npz").out.strip(), allow_pickle=False) as packed:
        arrays = dict(packed)
    [told] = here("export", path, "--to", "json").json["artefacts"]
    with h5py.File(path) as file:
        said = json.loads(str(arrays.pop("metadata_json")))
        assert said["spec"] == told["spec"] == json.loads(file.attrs["spec_json"])
        assert said["content_sha256"] == file.attrs["content_sha256"].decode()
        assert arrays.keys() == told["arrays"].keys() == set(file)
        for name, dataset in file.items():
            values = dataset[...].astype(str) if dataset.dtype.kind == "S" else dataset[...]
            assert np.array_equal(arrays[name], values, equal_nan=values.dtype.kind == "f")
            assert told["arrays"][name]["dims"] == dataset.attrs["dims"].decode().split()
            assert np.array_equal(
                np.array(told["arrays"][name]["values"], dtype=values.dtype).reshape(values.shape),
                values,
                equal_nan=values.dtype.kind == "f",
            )


@pytest.mark.parametrize("kind", list(KINDS))
def test_netcdf_reads_back_to_the_bit(
    here: Callable[..., Ended],
    of: dict[str, Path],
    tmp_path: Path,
    kind: str,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Also where each column is too large to be held; `to_xarray` below holds them."""
    monkeypatch.setattr(named_arrays, "HELD_BYTES", 0)
    path = of[kind]
    there = xarray.load_dataset(here("export", path, "-o", tmp_path / "a.nc").out.strip())
    with h5py.File(path) as file:
        assert set(there.variables) == set(file)
        assert there.attrs["content_sha256"] == file.attrs["content_sha256"].decode()
        for name in ("spec_json", "provenance_json", "inputs_json"):
            assert json.loads(there.attrs[name]) == json.loads(bytes(file.attrs[name]))
        for name, dataset in file.items():
            values = dataset[...]
            if values.dtype.kind == "S":
                assert there[name].values.tolist() == values.astype(str).tolist()
            else:
                assert (there[name].dtype, there[name].values.tobytes()) == (values.dtype, values.tobytes())
            assert there[name].dims == tuple(dataset.attrs["dims"].decode().split())
            for said in ("units", "long_name"):
                assert there[name].attrs.get(said, "").encode() == dataset.attrs.get(said, b"")
    monkeypatch.undo()
    xarray.testing.assert_identical(there, qinit.open(path).to_xarray())


def test_several_artefacts_are_groups_of_one_netcdf_file(
    here: Callable[..., Ended], pipeline: Pipeline, tmp_path: Path
) -> None:
    names = [pipeline.fit, pipeline.sources]
    out = here("export", *names, "-o", tmp_path / "a.nc", "--what", "states").out.strip()
    assert out == ""  # sources have no such table
    out = here("export", *names, "-o", tmp_path / "a.nc").out.strip()
    for path in names:
        group = xarray.load_dataset(out, group=path.stem)
        xarray.testing.assert_identical(group, qinit.open(path).to_xarray())


def test_a_full_disk_ends_netcdf_with_7_and_leaves_nothing(
    here: Callable[..., Ended], pipeline: Pipeline, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(descriptor: int, content: object, offset: int) -> int:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "pwrite", full)
    ended = here("export", pipeline.fit, "-o", tmp_path / "f.nc")
    assert (ended.code, ended.out) == (7, "")
    assert "No space left" in ended.err
    assert list(tmp_path.iterdir()) == []


def test_the_same_artefact_gives_the_same_bytes(
    here: Callable[..., Ended], pipeline: Pipeline, tmp_path: Path
) -> None:
    for ending in ("csv", "nc", "npz", "json"):
        first, second = tmp_path / f"1.{ending}", tmp_path / f"2.{ending}"
        here("export", pipeline.fit, "-o", first)
        time.sleep(0.01)
        here("export", pipeline.fit, "-o", second)
        assert first.read_bytes() == second.read_bytes()


def test_runs_make_one_table_together(here: Callable[..., Ended], pipeline: Pipeline) -> None:
    names = ["zero", "maxqinit"]
    references = "".join(f"{pipeline.runs[name]}\n" for name in names)
    rows = _rows(here("export", "-", "--to", "csv", stdin=references).out)
    assert [row["method"] for row in rows] == [name for name in names for _ in range(4 * 60)]


def test_what_makes_no_table_together_is_refused(
    here: Callable[..., Ended], pipeline: Pipeline, tmp_path: Path
) -> None:
    ended = here("export", pipeline.fit, pipeline.sources, "--to", "csv")
    assert (ended.code, ended.out) == (4, "")
    twin = tmp_path / pipeline.fit.name
    twin.write_bytes(pipeline.fit.read_bytes())
    assert here("export", pipeline.fit, twin, "--to", "csv").code == 4


def test_several_artefacts_lie_side_by_side_in_an_npz(
    here: Callable[..., Ended], pipeline: Pipeline, tmp_path: Path
) -> None:
    here("export", pipeline.fit, pipeline.sources, "-o", tmp_path / "a.npz")
    with np.load(tmp_path / "a.npz") as arrays:
        assert f"{pipeline.fit.stem}/mu" in arrays
        assert f"{pipeline.sources.stem}/q" in arrays


def test_a_csv_file_has_a_sidecar_that_says_where_it_comes_from(
    here: Callable[..., Ended], pipeline: Pipeline, tmp_path: Path
) -> None:
    ended = here("export", pipeline.fit, "-o", tmp_path / "f.csv")
    assert ended.out == f"{tmp_path / 'f.csv'}\n"
    said = json.loads((tmp_path / "f.csv.json").read_text())
    with h5py.File(pipeline.fit) as file:
        assert said["artefacts"][0]["content_sha256"] == file.attrs["content_sha256"].decode()
    assert list(said["columns"]) == list(_rows((tmp_path / "f.csv").read_text())[0])
    assert said["columns"]["eopl_mean"]["unit"] == "step"


@pytest.mark.parametrize("ending", ["csv", "nc", "npz", "json"])
def test_a_file_that_is_there_is_replaced_only_by_force(
    here: Callable[..., Ended], pipeline: Pipeline, tmp_path: Path, ending: str
) -> None:
    target = tmp_path / f"mine.{ending}"
    target.write_text("mine")
    assert here("export", pipeline.fit, "-o", target).code == 4
    assert target.read_text() == "mine"
    assert here("export", pipeline.fit, "-o", target, "--force").code == 0
    assert target.stat().st_size > 1000


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        ([], "the format is missing"),
        (["--to", "npz"], "give a file"),
        (["--to", "parquet", "-o", "-"], "give a file"),
        (["--to", "nc"], "-o FILE.nc"),
        (["--to", "xlsx"], "xlsx"),
        (["--to", "csv", "--what", "state-action"], "did you mean state-actions?"),
    ],
)
def test_what_cannot_be_meant_ends_with_2_and_a_sentence(
    here: Callable[..., Ended], pipeline: Pipeline, arguments: list[str], said: str
) -> None:
    ended = here("export", pipeline.fit, *arguments)
    assert (ended.code, ended.out) == (2, "")
    assert said in ended.err
    assert len(ended.err.splitlines()) == 1


def test_the_folder_of_an_export_is_made_and_one_of_its_name_is_refused(
    here: Callable[..., Ended], pipeline: Pipeline
) -> None:
    ended = here("export", pipeline.fit, "-o", "new/folder/f.csv", "-q")
    assert (ended.code, ended.out) == (0, "new/folder/f.csv\n")
    assert {path.name for path in ended.path.parent.iterdir()} == {"f.csv", "f.csv.json"}
    ended = here("export", pipeline.fit, "--to", "csv", "-o", "new/folder")
    assert (ended.code, ended.out) == (2, "")
    assert "that is a folder" in ended.err


def test_a_table_of_another_kind_ends_with_4_and_the_tables_there_are(
    here: Callable[..., Ended], pipeline: Pipeline
) -> None:
    ended = here("export", pipeline.fit, "--to", "csv", "--what", "episodes")
    assert ended.code == 4
    assert "state-actions, states, library" in ended.err


def test_nothing_appears_where_writing_fails(
    here: Callable[..., Ended], pipeline: Pipeline, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(descriptor: int) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "fsync", full)
    ended = here("export", pipeline.fit, "-o", tmp_path / "f.csv")
    assert ended.code == 7
    assert list(tmp_path.iterdir()) == []


def test_a_damaged_task_is_not_exported(
    here: Callable[..., Ended], pipeline: Pipeline, tmp_path: Path
) -> None:
    bad, out = tmp_path / "bad.h5", tmp_path / "out"
    bad.write_bytes(pipeline.sources.read_bytes())
    with h5py.File(bad, "r+") as file:
        file["q"][1, 0, 0, 0] += 1e-9
    out.mkdir()
    ended = here("export", bad, "-o", out / "s.csv")
    assert ended.code == 6
    assert list(out.iterdir()) == []


def test_a_closed_pipe_ends_silently(pipeline: Pipeline) -> None:
    line = f"'{QINIT}' export '{pipeline.sources}' --to csv | head -1; echo ${{PIPESTATUS[0]}}"
    ended = subprocess.run(["bash", "-c", line], capture_output=True, text=True, timeout=60)
    assert ended.stdout.splitlines()[-1] == "141"
    assert ended.stderr == ""


def test_a_signal_leaves_no_piece_behind(pipeline: Pipeline, tmp_path: Path) -> None:
    script = (
        "import sys, time\n"
        "from qinit_cli.artefacts import formats\n"
        "def slow(file, *rest):\n"
        "    file.write('begun'); file.flush(); print('begun', flush=True); time.sleep(60)\n"
        "formats.write_csv = slow\n"
        "from qinit_cli.__main__ import main\n"
        f"sys.argv = ['qinit', 'export', {str(pipeline.fit)!r}, '-o', {str(tmp_path / 'f.csv')!r}]\n"
        "sys.exit(main())\n"
    )
    process = subprocess.Popen([sys.executable, "-c", script], stdout=subprocess.PIPE, text=True)
    assert process.stdout is not None
    assert process.stdout.readline() == "begun\n"
    assert [path.name.endswith(".part") for path in tmp_path.iterdir()] == [True]
    process.send_signal(signal.SIGTERM)
    process.communicate(timeout=30)
    assert process.returncode == 143
    assert list(tmp_path.iterdir()) == []


def test_pieces_are_bounded_whatever_the_artefact(
    pipeline: Pipeline, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(long_tables, "ROWS", 7)
    with open_artefact(pipeline.sources) as artefact:
        pieces = list(long_tables.rows(artefact, "tables"))
        q = artefact.read("q")
    assert max(len(piece["q"]) for piece in pieces) == 7
    assert np.array_equal(np.concatenate([piece["q"] for piece in pieces]), q.ravel())


def test_the_names_of_the_tables_are_those_in_the_help(here: Callable[..., Ended]) -> None:
    said = " ".join(re.sub(r"[│|]", " ", here("export", "--help").out).split())
    for names in (kind.tables for kind in KINDS.values()):
        assert ", ".join(names) in said


def test_help_imports_neither_pyarrow_nor_numpy() -> None:
    script = (
        "import sys\n"
        "from qinit_cli.app import run\n"
        "run(['export', '--help'])\n"
        "print([name for name in ('numpy', 'h5py', 'pyarrow', 'scipy', 'numba') if name in sys.modules])\n"
    )
    ended = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, timeout=60)
    assert ended.stdout.splitlines()[-1] == "[]"
