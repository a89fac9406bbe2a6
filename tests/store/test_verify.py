"""Verification names what is damaged, salvage keeps the rest, merge puts shards together."""

from __future__ import annotations

import sys

import h5py
import numpy as np
import pytest
from fakes import LIGHT, SOURCES, make_fit, make_sources, one_task, rows_for, spec_for, statics_for

from qinit_store import verify as verifying
from qinit_store.errors import Damaged, NotFound, Refused
from qinit_store.mend import merge, salvage
from qinit_store.reading import describe, open_artefact
from qinit_store.verify import verify
from qinit_store.work import open_work


def change(path, name, where, value):
    """Write into a finished artefact behind the store's back, as no damage but a hand could."""
    with h5py.File(path, "r+") as file:
        file[name][where] = value


@pytest.fixture
def damaged(tmp_path):
    """Six source tasks of which 1 and 4 were tampered with."""
    path = make_sources(tmp_path / "a.h5")
    change(path, "q", (1, 0, 0, 0), 7.0)
    change(path, "goal_row", 4, 99)
    return path


def make_shard(path, ids, tasks=6, schema=SOURCES, seed=0, statics=None):
    with open_work(path, schema, spec_for(tasks, seed=seed)) as work:
        work.save(rows_for(ids, schema), np.array(ids))
        return work.finish(np.array(ids), statics or statics_for(schema))


def test_a_sound_artefact_is_found_sound(tmp_path):
    verdict = verify(make_sources(tmp_path / "a.h5"))
    assert verdict.sound
    assert verdict.content_sha256 == describe(tmp_path / "a.h5").content_sha256
    verdict.raise_if_damaged()
    assert verify(make_fit(tmp_path / "f.h5")).kind == "fit"


def test_the_damaged_tasks_are_named(damaged):
    verdict = verify(damaged)
    assert verdict.damaged == (1, 4)
    assert not verdict.problem
    with pytest.raises(Damaged, match=r"2 of 6 tasks do not hold \(1, 4\); `qinit salvage"):
        verdict.raise_if_damaged()


def test_a_damaged_task_is_never_read(damaged):
    with open_artefact(damaged) as artefact:
        with pytest.raises(Damaged, match="task 1, 4 does not hold"):
            artefact.read("td_var")
        blocks = artefact.blocks(["q"], 1)
        assert np.array_equal(next(blocks)["q"][0], one_task(0)["q"])
        with pytest.raises(Damaged):
            next(blocks)


def test_a_column_that_is_read_ahead_is_verified_with_the_rows(damaged, tmp_path):
    with open_artefact(damaged) as artefact:
        assert artefact.read_ahead(["goal_row"])["goal_row"][4] == 99
        with pytest.raises(Damaged, match="task 1, 4 does not hold"):
            artefact.check_tasks()
    with open_artefact(make_sources(tmp_path / "sound.h5")) as artefact:
        ahead = artefact.read_ahead(["goal_row"])["goal_row"]
        ahead[0] += 1  # a copy: what was read is not the reader's to change
        assert np.array_equal(
            artefact.read("goal_row"), [one_task(number)["goal_row"] for number in range(6)]
        )


def test_what_is_verified_is_what_was_read_ahead(tmp_path):
    path = make_sources(tmp_path / "a.h5")
    with open_artefact(path) as artefact:
        artefact.read_ahead(["solved"])
        artefact._ahead["solved"][2] ^= 1  # as if the disk had once read back something else
        with pytest.raises(Damaged, match="task 2 does not hold"):
            artefact.check_tasks()


def test_a_task_that_cannot_be_read_is_named(tmp_path):
    schema = LIGHT
    path = make_sources(tmp_path / "a.h5", schema=schema)
    with h5py.File(path) as file:
        info = file["steps"].id.get_chunk_info(0)
    content = bytearray(path.read_bytes())
    content[info.byte_offset + 3] ^= 1
    path.write_bytes(content)
    assert verify(path).damaged == (0, 1, 2, 3, 4, 5)


@pytest.mark.parametrize("name", ["start", "action", "task_digest"])
def test_damage_to_what_the_tasks_share_is_found_on_opening(tmp_path, name):
    path = make_sources(tmp_path / "a.h5", schema=LIGHT)
    change(path, name, 0, 1)
    with pytest.raises(Damaged, match="content hash does not hold; see `qinit verify"):
        open_artefact(path)
    assert "content hash" in verify(path).problem


def test_tampered_settings_are_found_on_opening(tmp_path):
    path = make_sources(tmp_path / "a.h5")
    content = path.read_bytes()
    with h5py.File(path, "r+") as file:
        spec = file.attrs["spec_json"].replace(b'"seed":0', b'"seed":1')
        file.attrs["spec_json"] = np.bytes_(spec)
    assert path.read_bytes() != content
    with pytest.raises(Damaged, match="settings are not those"):
        open_artefact(path)


def test_verifying_nothing_is_not_found(tmp_path):
    with pytest.raises(NotFound):
        verify(tmp_path / "nothing.h5")


def test_salvage_keeps_the_tasks_that_hold_and_the_same_command_completes_them(damaged, tmp_path):
    target = tmp_path / "saved.h5"
    assert salvage(damaged, target, {"command": "qinit salvage"}).tolist() == [1, 4]
    with open_artefact(target) as saved:
        assert saved.tasks.tolist() == [0, 2, 3, 5]
        assert np.array_equal(saved.read("q")[1], one_task(2)["q"])
    with open_work(target, SOURCES, spec_for()) as work:
        assert not work.complete
    make_sources(target)
    whole = make_sources(tmp_path / "whole.h5")
    assert describe(target).content_sha256 == describe(whole).content_sha256


def test_salvage_refuses_what_it_cannot_vouch_for(tmp_path):
    path = make_sources(tmp_path / "a.h5", schema=LIGHT)
    change(path, "start", 0, 1.0)
    with pytest.raises(Damaged, match="cannot be salvaged"):
        salvage(path, tmp_path / "b.h5", {})
    assert not (tmp_path / "b.h5").exists()


@pytest.mark.parametrize("schema", [SOURCES, LIGHT])
def test_merged_shards_equal_the_whole(tmp_path, schema):
    shards = [
        make_shard(tmp_path / f"{ids[0]}.h5", ids, schema=schema) for ids in ([4, 5], [0, 2], [1, 2, 3])
    ]
    merged = merge(shards, tmp_path / "merged.h5", {"command": "qinit merge"})
    whole = make_sources(tmp_path / "whole.h5", schema=schema)
    assert describe(merged).content_sha256 == describe(whole).content_sha256
    assert [one["name"] for one in describe(merged).inputs] == ["4.h5", "0.h5", "1.h5"]
    assert merge(shards, merged, {}) == merged


def test_shards_of_other_settings_or_other_contents_are_refused(tmp_path):
    one = make_shard(tmp_path / "one.h5", [0, 1])
    other = make_shard(tmp_path / "other.h5", [2, 3], seed=1)
    with pytest.raises(Refused, match="seed: asked for 0, there is 1"):
        merge([one, other], tmp_path / "merged.h5", {})
    with open_work(tmp_path / "liar.h5", SOURCES, spec_for()) as work:
        rows = rows_for([1])
        rows["q"] += 1
        work.save(rows, np.array([1]))
        liar = work.finish(np.array([1]))
    with pytest.raises(Refused, match="task 1 of"):
        merge([one, liar], tmp_path / "merged.h5", {})


def test_runs_whose_starts_differ_are_not_merged(tmp_path):
    statics = statics_for(LIGHT)
    one = make_shard(tmp_path / "one.h5", [0], schema=LIGHT)
    other = make_shard(
        tmp_path / "two.h5", [1], schema=LIGHT, statics={**statics, "start": statics["start"] + 1}
    )
    with pytest.raises(Refused, match="differ in what their tasks share"):
        merge([one, other], tmp_path / "merged.h5", {})


def test_how_much_is_read_is_told_block_by_block(tmp_path):
    told = []
    with open_artefact(make_sources(tmp_path / "a.h5")) as artefact:
        assert not artefact.damaged_tasks(lambda *read: told.append(read)).size
        size = artefact.schema.block_size
    assert told == [(min(first + size, 6), 6) for first in range(0, 6, size)]


def test_the_child_tells_its_progress_before_its_verdict():
    program = "print('read 3 of 9', flush=True); print('read 9 of 9'); print('{}'); import sys; sys.exit(4)"
    told = []
    done = verifying._run([sys.executable, "-c", program], 60, lambda *read: told.append(read))
    assert told == [(3, 9), (9, 9)]
    assert (done.returncode, done.stdout) == (4, b"{}\n")


def test_a_child_that_takes_too_long_is_ended():
    with pytest.raises(TimeoutError):
        verifying._run([sys.executable, "-c", "import time; time.sleep(60)"], 0, lambda *read: None)
