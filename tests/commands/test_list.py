"""`qinit list`: finished, unfinished and damaged artefacts, for people and for programs."""

from __future__ import annotations

import csv
import io
import json
import re
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import h5py
import numpy as np
import pytest

from qinit_cli.artefacts.settings import SourcesSettings
from qinit_cli.artefacts.sources import sources_schema
from qinit_cli.environments.gridworld import Gridworld
from qinit_cli.tasks import SourceTasks
from qinit_store.schema import Axis
from qinit_store.work import open_work

if TYPE_CHECKING:
    from running import Ended, Pipeline


def _rows(out: str) -> list[dict[str, str]]:
    return list(csv.DictReader(io.StringIO(out), delimiter="\t"))


@pytest.fixture
def store(pipeline: Pipeline, tmp_path: Path) -> Path:
    """A copy of the small pipeline's store, to be changed."""
    return Path(shutil.copytree(pipeline.store, tmp_path / "store"))


def _leave_unfinished(store: Path, command: str) -> None:
    """Two of five tasks saved, and then nothing more."""
    family = Gridworld(size=2)
    tasks = SourceTasks(family, "exact", family.source_learning, seed=9)
    action = Axis("action", np.array(family.actions, dtype="S"), "", "action")
    schema = sources_schema(family.axes(), action, family.parameters(), 0)
    rows = {
        column.name: np.full((2, *schema.row_shape(column)), column.low or 0, column.little_endian)
        for column in schema.task_columns
        if column.given
    }
    target = store / "sources" / "begun.h5"
    with open_work(
        target, schema, SourcesSettings.of(tasks, 5).spec(), provenance={"command": command}
    ) as work:
        work.save(rows, np.arange(2))


def test_every_artefact_has_a_line_that_agrees_with_the_file(
    here: Callable[..., Ended], pipeline: Pipeline
) -> None:
    rows = _rows(here("list", "--store", pipeline.store).out)
    made = {pipeline.sources, pipeline.fit, *pipeline.runs.values()}
    assert {Path(row["path"]) for row in rows} >= made
    for row in rows:
        with h5py.File(row["path"]) as file:
            assert row["content_sha256"] == file.attrs["content_sha256"].decode()
            assert "qinit/" + row["kind"] == file.attrs["qinit_format"].decode()
            assert row["command"] == json.loads(file.attrs["provenance_json"])["command"]
        assert float(row["megabytes"]) == Path(row["path"]).stat().st_size / 1e6
        assert (row["family"], row["tasks"], row["state"]) == ("gridworld", "4", "done")


def test_unfinished_work_is_listed_with_the_command_that_goes_on(
    here: Callable[..., Ended], store: Path
) -> None:
    _leave_unfinished(store, "qinit train-sources gridworld --size 2 --seed 9")
    ended = here("list", "--store", store)
    [row] = [row for row in _rows(ended.out) if row["state"] == "unfinished"]
    assert (row["name"], row["kind"], row["tasks"], row["tasks_wanted"]) == ("begun", "sources", "2", "5")
    assert row["command"] == "qinit train-sources gridworld --size 2 --seed 9"
    assert "to go on with begun: qinit train-sources gridworld --size 2 --seed 9" in ended.err
    assert re.search(r"begun .*2/5 .*unfinished", here("list", "--store", store, "--format", "table").out)


def test_damage_is_said_and_the_rest_is_listed(here: Callable[..., Ended], store: Path) -> None:
    whole = next(store.glob("fits/*.h5")).read_bytes()
    (store / "fits" / "broken.h5").write_bytes(whole[: len(whole) // 2])
    (store / "fits" / "text.h5").write_bytes(b"no HDF5")
    ended = here("list", "--store", store)
    states = {row["name"]: row["state"] for row in _rows(ended.out)}
    assert states.pop("broken") == "damaged"
    assert states.pop("text") == "foreign"
    assert set(states.values()) == {"done"}
    assert ended.code == 0
    assert "broken.h5" in here("list", "--store", store, "--format", "table").err


@pytest.mark.parametrize("kind", ["sources", "fit", "run"])
def test_one_kind_alone(here: Callable[..., Ended], pipeline: Pipeline, kind: str) -> None:
    rows = _rows(here("list", "--store", pipeline.store, "--kind", kind).out)
    assert {row["kind"] for row in rows} == {kind}


def test_names_are_chosen_by_a_part_or_a_pattern(here: Callable[..., Ended], pipeline: Pipeline) -> None:
    wanted = pipeline.runs["maxqinit"].stem
    for pattern in ("maxqinit", "*maxqinit*", wanted):
        rows = _rows(here("list", "--store", pipeline.store, "--name", pattern).out)
        assert [row["name"] for row in rows] == [wanted]
    assert _rows(here("list", "--store", pipeline.store, "--name", "max*").out) == []
    assert here("list", "--store", pipeline.store, "--kind", "table").code == 2


def test_an_empty_store_is_no_error(here: Callable[..., Ended], tmp_path: Path) -> None:
    ended = here("list", "--store", tmp_path / "nowhere")
    assert ended.code == 0
    assert _rows(ended.out) == []
    assert "qinit train-sources" in ended.err
    assert here("list", "--store", tmp_path, "--json").json["rows"] == []


def test_listing_reads_no_dataset(
    here: Callable[..., Ended], store: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refused(*arguments: object) -> None:
        raise AssertionError("a dataset was read")

    monkeypatch.setattr(h5py.Dataset, "__getitem__", refused)
    assert len(_rows(here("list", "--store", store).out)) >= 3


def test_each_of_three_hundred_artefacts_is_opened_once(
    here: Callable[..., Ended], pipeline: Pipeline, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "sources").mkdir()
    content = pipeline.sources.read_bytes()
    for number in range(300):
        (tmp_path / "sources" / f"copy-{number}.h5").write_bytes(content)
    opened = []
    real = h5py.File

    def counting(*arguments: Any, **options: Any) -> Any:
        opened.append(arguments)
        return real(*arguments, **options)

    monkeypatch.setattr(h5py, "File", counting)
    assert len(_rows(here("list", "--store", tmp_path).out)) == 300
    assert len(opened) == 300
