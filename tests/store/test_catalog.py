"""Names and references, and what a store shows of itself."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from fakes import SOURCES, make_fit, make_sources, rows_for, spec_for
from hypothesis import given
from hypothesis import strategies as st

from qinit_store.catalog import NAME, Store
from qinit_store.errors import NotFound, Refused
from qinit_store.spec import spec_sha256
from qinit_store.work import open_work


@pytest.fixture
def store(tmp_path):
    return Store(tmp_path / "qinit-store")


def test_an_artefact_has_its_place_by_kind_and_spec(store):
    path = store.path_for("fit", "gridworld-mle", {"seed": 0})
    assert path == store.root / "fits" / f"gridworld-mle-{spec_sha256({'seed': 0})[:8]}.h5"


@given(st.text(max_size=120))
def test_a_name_is_plain_or_refused(stem):
    try:
        path = Store(Path("root")).path_for("run", stem, {})
    except Refused:
        assert not NAME.fullmatch(f"{stem}-{spec_sha256({})[:8]}.h5")
    else:
        assert path.parent.as_posix() == "root/runs"
        assert path.name.isascii()
        assert path.name[0].isalnum()


def test_a_reference_is_a_name_with_or_without_its_ending(store):
    path = make_sources(store.root / "sources" / "grid.h5")
    for reference in ("grid", "grid.h5", "sources/grid", "sources/grid.h5", str(path)):
        assert store.resolve(reference) == path


def test_a_name_in_two_folders_is_told_apart_by_its_folder(store):
    make_sources(store.root / "sources" / "grid.h5")
    make_fit(store.root / "fits" / "grid.h5")
    with pytest.raises(Refused, match="sources/grid and fits/grid"):
        store.resolve("grid")
    assert store.resolve("fits/grid").parent.name == "fits"


def test_a_missing_name_comes_with_the_nearest(store):
    make_sources(store.root / "sources" / "gridworld-7.h5")
    with pytest.raises(NotFound, match=r"did you mean gridworld-7\?"):
        store.resolve("gridwrold-7")


def test_a_missing_file_comes_with_the_nearest_beside_it(store, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    make_sources(tmp_path / "plain.h5")
    make_sources(tmp_path / "out" / "grid.h5")
    for reference, near in (
        ("plan.h5", "plain.h5"),
        ("./plan.h5", "./plain.h5"),
        ("out/gird.h5", "out/grid.h5"),
    ):
        with pytest.raises(NotFound, match=rf"did you mean {near}\?"):
            store.resolve(reference)
    with pytest.raises(NotFound, match=r"there is no nothing\.h5 here or in "):
        store.resolve("nothing.h5")


@pytest.mark.parametrize("reference", ["no/such/file.h5", "nothing.h5", "nothing", "runs/nothing"])
def test_what_is_not_there_is_not_found(store, reference):
    with pytest.raises(NotFound, match="there is no"):
        store.resolve(reference)


@pytest.mark.parametrize("reference", ["..", "fits/..", "", ".hidden", "a b", "x" * 101])
def test_what_is_no_name_is_refused(store, reference):
    with pytest.raises(Refused, match="is no name"):
        store.resolve(reference)


def test_a_path_wins_over_a_name(store, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    make_sources(store.root / "sources" / "grid.h5")
    make_sources(tmp_path / "grid.h5")
    assert store.resolve("grid.h5").resolve() == tmp_path / "grid.h5"
    assert store.resolve("grid").parent.name == "sources"


def test_entries_show_finished_unfinished_and_damaged(store):
    make_sources(store.root / "sources" / "whole.h5", tasks=3)
    make_fit(store.root / "fits" / "fit.h5")
    begun = store.root / "sources" / "begun.h5"
    (store.root / "fits" / "text.h5").write_bytes(b"nothing of ours")
    (store.root / "fits" / "spoilt.h5").write_bytes((store.root / "fits" / "fit.h5").read_bytes()[:2000])
    with open_work(begun, SOURCES, spec_for(9), provenance={"command": "qinit begun"}) as work:
        work.save(rows_for([1, 5]), np.array([1, 5]))
        during = {entry.path.name: entry for entry in store.entries()}
    after = {entry.path.name: entry for entry in store.entries()}
    states = {name: (entry.kind, entry.state, entry.tasks) for name, entry in after.items()}
    assert states == {
        "whole.h5": ("sources", "done", 3),
        "fit.h5": ("fit", "done", 0),
        "spoilt.h5": ("fit", "damaged", 0),
        "text.h5": ("fit", "foreign", 0),
        "begun.h5": ("sources", "unfinished", 2),
    }
    assert during["begun.h5"].state == "being written"
    assert after["begun.h5"].provenance == {"command": "qinit begun"}
    assert after["begun.h5"].spec["tasks"] == 9
    assert "spoilt.h5" in after["spoilt.h5"].problem


def test_an_empty_store_has_no_entries(store):
    assert list(store.entries()) == []
    assert store.names() == []


def test_relatives_differ_in_the_number_of_tasks_alone(store):
    for tasks in (2, 5):
        make_sources(store.path_for("sources", "grid", spec_for(tasks)), tasks=tasks)
    other = spec_for(2, seed=1)
    make_sources(store.path_for("sources", "grid", other), tasks=2, spec=other)
    assert [entry.tasks for entry in store.relatives("sources", spec_for(9))] == [5, 2]
