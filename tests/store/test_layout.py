"""What other programs see of an artefact: h5py, xarray, and the names scripts read."""

from __future__ import annotations

import subprocess
import sys

import h5py
import numpy as np
import pytest
import xarray
from fakes import (
    ACTION,
    COL,
    PARAMETERS,
    ROW,
    SOURCES,
    make_fit,
    make_run,
    make_sources,
    narrow_schema,
    one_task,
    rows_for,
    spec_for,
)

from qinit_cli.artefacts.run import run_schema
from qinit_cli.artefacts.sources import sources_schema
from qinit_store.folder import work_folder
from qinit_store.reading import open_artefact
from qinit_store.schema import Column, Schema
from qinit_store.work import open_work

MAKERS = {"sources": make_sources, "fit": make_fit, "run": make_run}
TABLE = ("row", "col", "action")


@pytest.fixture(params=MAKERS)
def path(request, tmp_path):
    return MAKERS[request.param](tmp_path / "a.h5")


def test_xarray_shows_labelled_arrays_with_named_axes(tmp_path):
    with xarray.open_dataset(make_sources(tmp_path / "a.h5"), engine="h5netcdf") as sources:
        assert sources.q.dims == ("task", *TABLE)
        assert sources.action.values.tolist() == ["up", "down", "left", "right"]
        assert np.array_equal(sources.q.sel(task=4, action="left"), one_task(4)["q"][:, :, 2])
        assert sources.seconds.attrs["units"] == "s"
    with xarray.open_dataset(make_fit(tmp_path / "f.h5"), engine="h5netcdf") as fit:
        assert fit.library_q.dims == ("library", *TABLE)
    with xarray.open_dataset(make_run(tmp_path / "r.h5"), engine="h5netcdf") as run:
        assert run.steps.dims == ("task", "episode")
        assert run.potential.dims == ("task", "row", "col")
        assert run.start.dims == TABLE


def test_every_dimension_of_every_dataset_has_a_scale_of_its_name(path):
    with h5py.File(path) as file:
        for dataset in file.values():
            if not dataset.is_scale:
                dims = dataset.attrs["dims"].decode().split()
                assert [dataset.dims[axis][0].name for axis in range(dataset.ndim)] == [
                    f"/{one}" for one in dims
                ]


def test_no_type_is_of_variable_length_but_what_dimension_scales_need(path):
    with h5py.File(path) as file:
        for owner in (file, *file.values()):
            for name in owner.attrs:
                if name in ("DIMENSION_LIST", "REFERENCE_LIST"):
                    continue
                kind = owner.attrs.get_id(name).get_type()
                assert kind.get_class() in (h5py.h5t.INTEGER, h5py.h5t.STRING)
                assert kind.get_class() != h5py.h5t.STRING or not kind.is_variable_str()
        assert {dataset.dtype.kind for dataset in file.values()} <= set("iufS")


def test_every_dataset_is_compressed_and_carries_checksums(path):
    with h5py.File(path) as file:
        for dataset in file.values():
            assert (dataset.compression, dataset.compression_opts) == ("gzip", 1)
            assert dataset.shuffle
            assert dataset.fletcher32


def test_a_part_keeps_what_the_digests_cover_as_it_is_and_the_rest_with_checksums(tmp_path):
    with open_work(tmp_path / "a.h5", SOURCES, spec_for()) as work:
        work.save(rows_for([0, 1]), np.array([0, 1]))
    (part,) = work_folder(tmp_path / "a.h5").glob("part-*.h5")
    with h5py.File(part) as file:
        bare = {name for name, dataset in file.items() if not dataset.fletcher32}
        assert bare == {column.name for column in SOURCES.task_columns if column.hashed}
        assert {"q", "td_var", "visits"} <= bare
        assert all(file[name].chunks is None for name in bare)
        assert all(file[name].compression == "gzip" for name in file.keys() - bare)


def test_chunks_hold_about_256_kib_of_tasks(tmp_path):
    length = 2048  # 16 KiB a task
    path = make_sources(tmp_path / "a.h5", tasks=40, schema=narrow_schema(length, keep_q=True))
    with h5py.File(path) as file:
        assert file["q"].chunks == (16, length, 1)


def test_the_same_data_gives_the_same_bytes(tmp_path):
    assert make_run(tmp_path / "a.h5").read_bytes() == make_run(tmp_path / "b.h5").read_bytes()
    assert make_fit(tmp_path / "c.h5").read_bytes() == make_fit(tmp_path / "d.h5").read_bytes()


def test_what_is_read_is_what_was_saved(tmp_path):
    with open_artefact(make_sources(tmp_path / "a.h5")) as artefact:
        for number in range(6):
            for name, values in one_task(number).items():
                assert np.array_equal(artefact.read(name)[number], values), name
        assert [list(block) for block in artefact.blocks(["q", "p"], 4)] == [["task", "q", "p"]] * 2
        assert artefact.axes["action"].values.tolist() == ACTION.values.tolist()


def test_sources_hold_the_columns_that_scripts_read():
    dims = {column.name: (column.dtype, column.dims) for column in SOURCES.columns}
    pair = ("task", *TABLE)
    assert dims == {
        "q": ("f8", pair),
        "td_var": ("f8", pair),
        "eopl": ("i4", pair),
        "visits": ("i8", pair),
        "curve_steps": ("f4", ("task", "bin")),
        "curve_reached": ("f4", ("task", "bin")),
        "goal_row": ("i4", ("task",)),
        "goal_col": ("i4", ("task",)),
        "p": ("f8", ("task",)),
        "solved": ("u1", ("task",)),
        "steps": ("i8", ("task",)),
        "seconds": ("f8", ("task",)),
        "task_digest": ("u1", ("task", "byte")),
    }


def test_the_exact_learner_leaves_no_curve():
    names = {column.name for column in sources_schema((ROW, COL), ACTION, PARAMETERS, 0).columns}
    assert not {"curve_steps", "curve_reached"} & names


def test_a_run_holds_what_was_asked_for_and_no_more():
    least = run_schema(
        (ROW, COL),
        ACTION,
        (),
        9,
        start_per_task=False,
        potential_per_task=False,
        exact_values=False,
        evaluations=0,
        keep_q=False,
    )
    columns = {one.name: one.dims for one in least.columns}
    assert columns == {
        "steps": ("task", "episode"),
        "reached": ("task", "episode"),
        "start": TABLE,
        "potential": ("row", "col"),
        "seconds": ("task",),
        "task_digest": ("task", "byte"),
    }


def test_a_column_on_an_unknown_axis_is_an_error():
    with pytest.raises(ValueError, match="no axis nowhere"):
        Schema("sources", (), (Column("q", ("task", "nowhere"), "f8"),))


def test_errors_cost_neither_numpy_nor_h5py():
    program = "import qinit_store.errors, sys; print(sorted({'numpy', 'h5py'} & set(sys.modules)))"
    found = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert found.stdout.strip() == "[]"


def test_names_can_be_completed_without_numpy_or_h5py(tmp_path):
    make_sources(tmp_path / "sources" / "a.h5")
    program = (
        "import qinit_store.catalog, sys, pathlib; print(qinit_store.catalog.Store(pathlib.Path(sys.argv[1])).names(),"
        " sorted({'numpy', 'h5py'} & set(sys.modules)))"
    )
    command = [sys.executable, "-c", program, str(tmp_path)]
    assert subprocess.run(command, capture_output=True, text=True, check=True).stdout.strip() == "['a'] []"
