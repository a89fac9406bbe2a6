"""The digests are a promise to other programs: recomputed here from qinit_store.digest's text, without its code."""

from __future__ import annotations

import hashlib
import json
import struct

import h5py
import numpy as np
import pytest
from fakes import SOURCES, make_fit, make_sources, rows_for, spec_for

from qinit_store.digest import content_sha256, task_digests
from qinit_store.reading import describe, open_artefact
from qinit_store.schema import Column


def test_a_task_digest_is_the_sha256_of_its_hashed_columns_by_name():
    columns = (
        Column("q", ("task", "row"), "f8"),
        Column("goal_row", ("task",), "i4"),
        Column("seconds", ("task",), "f8", hashed=False),
    )
    rows = {"q": np.array([[0.5, -1.0]]), "goal_row": np.array([7], "i4"), "seconds": np.array([3.0])}
    by_hand = hashlib.sha256(
        b"qinit task 1\0"
        + struct.pack("<q", 12)
        + b"goal_row\0<i4\0\0"
        + struct.pack("<i", 7)
        + b"q\0<f8\0002\0"
        + struct.pack("<dd", 0.5, -1.0)
    ).digest()
    assert task_digests(columns, np.array([12]), rows).tobytes() == by_hand


def test_byte_order_and_memory_layout_leave_a_digest_unchanged():
    columns = (Column("q", ("task", "row", "col"), "f8"),)
    values = np.arange(12.0).reshape(2, 3, 2)
    plain = task_digests(columns, np.arange(2), {"q": values})
    swapped = task_digests(columns, np.arange(2), {"q": np.asfortranarray(values.astype(">f8"))})
    assert np.array_equal(plain, swapped)


def test_a_content_hash_is_the_sha256_of_spec_tasks_and_datasets():
    spec_json = json.dumps({"seed": 0})
    digests = np.arange(64, dtype=np.uint8).reshape(2, 32)
    by_hand = hashlib.sha256(
        b"qinit content 1\0sources\0"
        + spec_json.encode()
        + b"\0"
        + struct.pack("<qq", 2, 4)
        + bytes(range(32, 64))
        + struct.pack("<q", 9)
        + bytes(range(32))
        + b"action\0|S2\0002\0upgo"
        + b"mu\0<f8\0001,2\0"
        + struct.pack("<dd", 1.0, 2.0)
    ).hexdigest()
    datasets = {"mu": np.array([[1.0, 2.0]]), "action": np.array([b"up", b"go"])}
    assert content_sha256("sources", spec_json, np.array([9, 4]), digests, datasets) == by_hand


def test_a_stored_content_hash_can_be_recomputed_with_h5py_alone(tmp_path):
    path = make_sources(tmp_path / "a.h5")
    with h5py.File(path) as file:
        digest = hashlib.sha256(b"qinit content 1\0sources\0" + file.attrs["spec_json"] + b"\0")
        digest.update(struct.pack("<q", file["task"].size))
        for number, row in zip(file["task"][:], file["task_digest"][:], strict=True):
            digest.update(struct.pack("<q", number) + row.tobytes())
        for name in sorted(name for name in file if not file[name].attrs["dims"].startswith(b"task")):
            values = file[name][...]
            shape = ",".join(map(str, values.shape))
            digest.update(f"{name}\0{values.dtype.str}\0{shape}\0".encode() + values.tobytes())
        assert digest.hexdigest().encode() == file.attrs["content_sha256"]


@pytest.mark.parametrize(
    ("order", "batch"), [([0, 1, 2, 3, 4, 5], 6), ([5, 0, 3, 1, 4, 2], 1), ([4, 5, 2, 3, 0, 1], 4)]
)
def test_order_and_batching_of_saves_leave_every_byte_unchanged(tmp_path, order, batch):
    straight = make_sources(tmp_path / "straight.h5")
    other = make_sources(tmp_path / "other.h5", order=order, batch=batch)
    assert straight.read_bytes() == other.read_bytes()


def test_seconds_and_provenance_are_not_hashed(tmp_path):
    from qinit_store.work import open_work

    ids = np.arange(6)
    rows = {**rows_for(ids), "seconds": np.full(6, 99.0)}
    with open_work(tmp_path / "slow.h5", SOURCES, spec_for()) as work:
        work.save(rows, ids)
        work.finish(ids, {}, {"command": "another"}, [])
    fast = describe(make_sources(tmp_path / "fast.h5"))
    assert describe(tmp_path / "slow.h5").content_sha256 == fast.content_sha256


@pytest.mark.parametrize("name", [column.name for column in SOURCES.task_columns if column.hashed])
def test_every_hashed_column_changes_the_content_hash(tmp_path, name):
    from qinit_store.work import open_work

    ids = np.arange(6)
    rows = rows_for(ids)
    rows[name].reshape(-1)[-1] += 1
    with open_work(tmp_path / "changed.h5", SOURCES, spec_for()) as work:
        work.save(rows, ids)
        work.finish(ids)
    plain = describe(make_sources(tmp_path / "plain.h5"))
    assert describe(tmp_path / "changed.h5").content_sha256 != plain.content_sha256


def test_a_fit_is_hashed_over_its_datasets(tmp_path):
    with (
        open_artefact(make_fit(tmp_path / "one.h5")) as one,
        open_artefact(make_fit(tmp_path / "two.h5", 1)) as two,
    ):
        assert np.array_equal(one.read("mu"), two.read("mu"))
        assert one.content_sha256 != two.content_sha256  # the specs differ
