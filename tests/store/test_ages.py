"""Artefacts of other versions: old ones stay readable, newer ones say what to install."""

from __future__ import annotations

import shutil
from pathlib import Path

import h5py
import numpy as np
import pytest
from fakes import ACTION, COL, ROW, make_fit, make_sources

from qinit_cli.artefacts.fit import fit_schema
from qinit_store.errors import Damaged
from qinit_store.reading import describe, open_artefact
from qinit_store.schema import Column, Schema
from qinit_store.verify import verify
from qinit_store.work import open_work

# Written once by schema 1 and never again: whoever must change these files has broken every artefact there is.
FROZEN = Path(__file__).with_name("data")
CONTENTS = {
    "sources": ("e23a4df7ee45d16a1df3f84e95ac1c8c8a15c180e1abd2d7982c851b4941a980", "eopl", 76),
    "fit": (
        "bc1f397dd8cd27597dee0e2292ae1a1bbb7095d688800bf89accecfbb4719b0e",
        "eopl_mean",
        13.064506602234117,
    ),
    "run": (
        "d82c0771d055ae55ced51aa35f84c831172865504c7f76f772c7fca50f6addda",
        "eval_return",
        48.12727084727142,
    ),
}


def give(path, name, value):
    with h5py.File(path, "r+", libver=("v110", "v110")) as file:
        file.attrs[name] = value


@pytest.mark.parametrize("kind", CONTENTS)
def test_an_artefact_of_schema_1_is_read_as_it_was_written(kind):
    content, name, value = CONTENTS[kind]
    path = FROZEN / f"schema-1-{kind}.h5"
    with open_artefact(path, kind) as artefact:
        assert artefact.schema_version == 1
        assert artefact.content_sha256 == content
        assert artefact.read(name).ravel()[0] == value
        artefact.check_tasks()


def test_an_artefact_of_schema_1_can_be_grown(tmp_path):
    path = tmp_path / "a.h5"
    shutil.copy(FROZEN / "schema-1-sources.h5", path)
    make_sources(path, tasks=6)
    assert describe(path).content_sha256 == describe(make_sources(tmp_path / "b.h5")).content_sha256


@pytest.mark.parametrize("reader", [open_artefact, describe])
def test_an_artefact_that_needs_a_newer_reader_says_what_to_install(tmp_path, reader):
    path = make_sources(tmp_path / "a.h5")
    give(path, "qinit_min_reader", np.int64(2))
    with pytest.raises(Damaged, match=r"needs a reader of schema 2.*`pip install --upgrade qinit`"):
        reader(path)
    assert "pip install" in verify(path).problem


def test_a_newer_artefact_that_older_readers_may_read_is_read(tmp_path):
    path = make_fit(tmp_path / "a.h5")
    give(path, "qinit_schema", np.int64(2))
    with open_artefact(path) as artefact:
        assert artefact.schema_version == 2


def test_columns_of_a_later_version_are_read_and_hashed(tmp_path):
    plain = fit_schema((ROW, COL), ACTION, 3)
    more = Column("normality_p", ("row", "col", "action"), "f8")
    schema = Schema("fit", plain.axes, (*plain.columns, more))
    statics = {one.name: np.ones(schema.row_shape(one), one.dtype) for one in schema.columns}
    contents = []
    for value in (0.25, 0.5):
        path = tmp_path / f"{value}.h5"
        with open_work(path, schema, {}) as work:
            work.finish(None, {**statics, "normality_p": np.full((3, 3, 4), value)})
        with open_artefact(path, "fit") as artefact:
            assert (artefact.read("normality_p") == value).all()
            contents.append(artefact.content_sha256)
    assert contents[0] != contents[1]
