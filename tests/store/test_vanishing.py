"""What others move, remove or replace while an artefact is made or read: reported as what happened."""

from __future__ import annotations

import errno
import os
import shutil

import h5py
import numpy as np
import pytest
from fakes import DISK, LIGHT, make_sources, rows_for, spec_for, statics_for

from qinit_store import source
from qinit_store.catalog import Store
from qinit_store.errors import Damaged, NotFound, Refused, SystemFailed, TooNew
from qinit_store.folder import part_paths, work_folder
from qinit_store.reading import open_artefact
from qinit_store.verify import OPENING, _examined
from qinit_store.work import open_work


@pytest.fixture
def path(tmp_path):
    return tmp_path / "store" / "a.h5"


def begun(path, tasks=6):
    """Work on `path` of which tasks 0 to 2 are saved; a context."""
    return open_work(path, LIGHT, spec_for(tasks), disk=DISK)


def save(work, ids):
    work.save(rows_for(ids, LIGHT), np.array(ids))


REMOVALS = {
    "the work folder removed": lambda path: shutil.rmtree(work_folder(path)),
    "the work folder moved": lambda path: work_folder(path).rename(path.with_name("elsewhere")),
    "the store removed": lambda path: shutil.rmtree(path.parent),
    "the store moved": lambda path: path.parent.rename(path.parent.with_name("elsewhere")),
}


@pytest.mark.parametrize("remove", REMOVALS.values(), ids=REMOVALS)
@pytest.mark.parametrize("then", ["save", "finish"])
def test_a_work_folder_that_is_gone_is_reported_with_what_was_in_it(path, remove, then):
    with begun(path) as work:
        save(work, [0, 1, 2])
        remove(path)
        assert work.kept == 0
        with pytest.raises(SystemFailed) as error:
            save(work, [3]) if then == "save" else work.finish(np.arange(3), statics_for(LIGHT))
    assert "was moved or removed while this was being written, with 3 saved tasks in it" in str(error.value)
    assert "are kept" not in str(error.value)
    assert not work_folder(path).exists()


def test_a_work_folder_that_is_moved_back_goes_on(path):
    with begun(path) as work:
        save(work, [0, 1, 2])
        work_folder(path).rename(path.with_name("elsewhere"))
        with pytest.raises(SystemFailed, match="move it back"):
            save(work, [3])
    path.with_name("elsewhere").rename(work_folder(path))
    with begun(path) as work:
        assert work.saved.tolist() == [0, 1, 2]


def test_into_a_folder_that_took_the_place_nothing_is_written(path):
    with begun(path) as work:
        save(work, [0, 1, 2])
        work_folder(path).rename(path.with_name("elsewhere"))
        work_folder(path).mkdir()
        with pytest.raises(SystemFailed, match=r"the folder replaced .* 0 of 3 saved tasks are in it"):
            save(work, [3])
    assert list(work_folder(path).iterdir()) == []


def test_without_its_lock_nothing_more_is_written_and_the_parts_stay(path):
    with begun(path) as work:
        save(work, [0, 1, 2])
        (work_folder(path) / "lock").unlink()
        with pytest.raises(SystemFailed, match=r"the lock .* was removed .* 3 of 3 saved tasks are in it"):
            save(work, [3])
    with begun(path) as work:
        assert work.saved.tolist() == [0, 1, 2]


def test_a_part_that_is_gone_is_reported_with_what_is_left(path):
    with begun(path) as work:
        save(work, [0, 1, 2])
        save(work, [3, 4])
        part_paths(work_folder(path))[0].unlink()
        assert work.kept == 2
        with pytest.raises(
            SystemFailed, match=r"there is no .*part.* was moved or removed .* 2 tasks are kept"
        ):
            work.finish(np.arange(5), statics_for(LIGHT))


def test_an_artefact_that_was_replaced_while_it_grew_is_not_written_over(path):
    make_sources(path, tasks=2, schema=LIGHT)
    with begun(path) as work:
        save(work, [2, 3, 4, 5])
        other = make_sources(path.with_name("b.h5"), tasks=4, schema=LIGHT)
        content = other.read_bytes()
        other.replace(path)
        with pytest.raises(Refused, match=r"was replaced by another program .* 6 tasks are kept"):
            work.finish(np.arange(6), statics_for(LIGHT))
    assert path.read_bytes() == content
    assert len(part_paths(work_folder(path))) == 2


def test_a_file_written_over_while_it_is_read_is_not_called_damaged(path):
    make_sources(path, schema=LIGHT)
    with open_artefact(path) as artefact:
        with h5py.File(path) as file:
            place = file["steps"].id.get_chunk_info(0).byte_offset
        with path.open("r+b") as file:
            file.seek(place)
            file.write(b"others")
        os.utime(path, ns=(1, 1))  # in case the clock stood still
        with pytest.raises(SystemFailed, match="was written by another program while it was read"):
            artefact.check_tasks()


def test_a_file_replaced_or_removed_while_it_is_read_is_read_to_its_end(path):
    make_sources(path, schema=LIGHT)
    with open_artefact(path) as artefact:
        path.unlink()
        artefact.check_tasks()


def test_a_file_that_went_since_the_folder_was_listed_is_no_entry(path, monkeypatch):
    store = Store(path.parent)
    for name in ("a", "b"):
        make_sources(store.root / "sources" / f"{name}.h5", tasks=1, schema=LIGHT)
    entries = store.entries()
    assert next(entries).path.stem == "a"
    (store.root / "sources" / "b.h5").unlink()
    assert list(entries) == []
    with pytest.raises(NotFound):
        open_artefact(store.root / "sources" / "b.h5")


@pytest.fixture
def broken(monkeypatch):
    """Makes the read with a number fail, the first being 1; a list of how many are left until then."""

    def breaks(number, first):
        left = [first]
        real = os.preadv

        def preadv(descriptor, buffers, offset):
            left[0] -= 1
            if left[0] == 0:
                raise OSError(number, os.strerror(number))
            return real(descriptor, buffers, offset)

        monkeypatch.setattr(source.os, "preadv", preadv)
        return left

    return breaks


@pytest.mark.parametrize("reason", [errno.EIO, errno.ENOMEM, errno.ESTALE])
def test_whichever_read_fails_it_is_the_system_and_no_part_is_set_aside(path, broken, monkeypatch, reason):
    with begun(path) as work:
        save(work, [0, 1, 2])
        save(work, [3, 4])
    parts = {one: one.read_bytes() for one in part_paths(work_folder(path))}
    counted = broken(reason, 10**6)
    with begun(path):
        reads = 10**6 - counted[0]
    assert reads > 20
    for first in range(1, reads + 1):
        monkeypatch.undo()
        broken(reason, first)
        with pytest.raises(SystemFailed, match=os.strerror(reason)), begun(path):
            pass
        assert {one: one.read_bytes() for one in part_paths(work_folder(path))} == parts


def test_memory_that_lacked_once_is_asked_for_again_and_at_last_reported(path, monkeypatch):
    make_sources(path, schema=LIGHT)
    opened = source.Source(path)
    answers = [RuntimeError("memory allocation failed"), "read"]

    def call():
        answer = answers.pop(0)
        if isinstance(answer, Exception):
            raise answer
        return answer

    assert opened.asked(call) == "read"
    answers += [RuntimeError("memory allocation failed")] * 4
    with pytest.raises(Damaged):
        opened.asked(call)
    monkeypatch.setattr(source, "SPARE_MEMORY", 2**62)
    with pytest.raises(MemoryError):
        opened.asked(call)
    opened.close()


def test_a_part_of_a_later_version_is_not_set_aside(path):
    with begun(path) as work:
        save(work, [0, 1, 2])
    [part] = part_paths(work_folder(path))
    with h5py.File(part, "r+", libver=("v110", "v110")) as file:
        file.attrs["qinit_min_reader"] = np.int64(2)
    with pytest.raises(TooNew, match="pip install --upgrade qinit"), begun(path):
        pass
    assert part_paths(work_folder(path)) == [part]


def test_verification_that_could_not_read_is_no_damage(path, broken):
    make_sources(path, schema=LIGHT)
    broken(errno.EIO, 5)
    verdict = _examined(path, OPENING)
    assert (verdict.state, verdict.damaged) == ("unread", ())
    with pytest.raises(SystemFailed, match="Input/output error"):
        verdict.raise_if_damaged()
