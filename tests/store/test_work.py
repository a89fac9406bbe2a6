"""The protocol: what was saved is kept, what is published is whole, what is in the way is refused."""

from __future__ import annotations

import errno
import os
import threading
from itertools import pairwise

import numpy as np
import pytest
from breakable import Breakable
from fakes import DISK, SOURCES, make_fit, make_run, make_sources, rows_for, spec_for
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from qinit_store.disk import Disk
from qinit_store.errors import Busy, Damaged, Refused
from qinit_store.folder import read_record, work_folder
from qinit_store.lock import being_held
from qinit_store.mend import merge
from qinit_store.reading import describe, open_artefact
from qinit_store.schema import Column, Schema
from qinit_store.work import open_work


@pytest.fixture
def path(tmp_path):
    return tmp_path / "store" / "a.h5"


@pytest.fixture(scope="module")
def straight(tmp_path_factory):
    """The content hash of the six tasks made in one go."""
    return describe(make_sources(tmp_path_factory.mktemp("straight") / "a.h5")).content_sha256


def save_some(path, ids, spec=None, **how):
    with open_work(path, SOURCES, spec or spec_for(), provenance={"command": "qinit first"}, **how) as work:
        work.save(rows_for(ids), np.asarray(ids))


def test_the_folder_is_gone_once_the_artefact_is_there(path):
    make_sources(path)
    assert [entry.name for entry in path.parent.iterdir()] == ["a.h5"]


def test_the_same_command_again_finds_it_complete_and_touches_nothing_but_its_time(path):
    make_sources(path)
    disk = Breakable()
    with open_work(path, SOURCES, spec_for(), disk=disk) as work:
        assert work.complete
        assert work.saved.tolist() == [0, 1, 2, 3, 4, 5]
    assert disk.done == [("set the time of", path.name)]


def test_an_exception_between_saves_loses_nothing(path, straight):
    def interrupted():
        with open_work(path, SOURCES, spec_for()) as work:
            work.save(rows_for([4, 1]), np.array([4, 1]))
            raise RuntimeError("interrupted")

    with pytest.raises(RuntimeError, match="interrupted"):
        interrupted()
    with open_work(path, SOURCES, spec_for()) as work:
        assert work.saved.tolist() == [1, 4]
        assert not work.complete
        assert work.set_aside == 0
    make_sources(path)
    assert describe(path).content_sha256 == straight


def test_a_work_that_saved_nothing_leaves_nothing_behind(path):
    with pytest.raises(RuntimeError), open_work(path, SOURCES, spec_for()):
        raise RuntimeError
    assert list(path.parent.iterdir()) == []


def test_tasks_are_never_saved_twice(path):
    with open_work(path, SOURCES, spec_for()) as work:
        work.save(rows_for([0, 1]), np.array([0, 1]))
        with pytest.raises(ValueError, match="saved already"):
            work.save(rows_for([1]), np.array([1]))


def test_an_artefact_is_not_published_before_all_its_tasks_are_saved(path):
    with open_work(path, SOURCES, spec_for()) as work:
        work.save(rows_for([0, 1]), np.array([0, 1]))
        with pytest.raises(ValueError, match="not saved"):
            work.finish(np.arange(6))
    assert not path.exists()


@pytest.mark.parametrize(
    "spoil",
    [
        lambda rows: rows.pop("q"),
        lambda rows: rows.update(extra=np.zeros(2)),
        lambda rows: rows.update(q=rows["q"][:, :2]),
        lambda rows: rows.update(eopl=np.full_like(rows["eopl"], 2**40, dtype=np.int64)),
        lambda rows: rows.update(eopl=rows["eopl"] + 0.5),
    ],
)
def test_rows_that_do_not_fit_the_schema_are_an_error(path, spoil):
    rows = rows_for([0, 1])
    spoil(rows)
    with open_work(path, SOURCES, spec_for()) as work, pytest.raises((ValueError, TypeError)):
        work.save(rows, np.array([0, 1]))


# A kept or finished artefact, and other settings.


def settings_changed(spec, names=()):
    """(name, the spec with that one setting changed) for every setting but the number of tasks."""
    for name, value in spec.items():
        if isinstance(value, dict):
            for inner, changed in settings_changed(value, (*names, name)):
                yield inner, {**spec, name: changed}
        elif name != "tasks":
            yield ".".join((*names, name)), {**spec, name: f"other than {value}"}


@pytest.mark.parametrize(("name", "spec"), list(settings_changed(spec_for())))
def test_every_changed_setting_is_refused_and_named(tmp_path, name, spec):
    make_sources(tmp_path / "whole.h5")
    save_some(tmp_path / "begun.h5", [0])
    for path in (tmp_path / "whole.h5", tmp_path / "begun.h5"):
        with pytest.raises(Refused, match=rf"{name}: asked for .*, there is"):
            make_sources(path, spec=spec)


@pytest.mark.parametrize(
    "spec", [{**spec_for(), "extra": 1}, {k: v for k, v in spec_for().items() if k != "seed"}]
)
def test_a_setting_too_many_or_too_few_is_refused(path, spec):
    make_sources(path)
    with pytest.raises(Refused, match="other settings"):
        make_sources(path, spec=spec)


def test_force_replaces_what_has_other_settings(path):
    make_sources(path, spec=spec_for(seed=1))
    make_sources(path, force=True)
    assert describe(path).spec == spec_for()


def test_force_discards_the_begun_work_of_other_settings(path, straight):
    save_some(path, [0, 1, 2], spec=spec_for(seed=1))
    make_sources(path, force=True)
    assert describe(path).content_sha256 == straight


def test_force_goes_on_with_its_own_interrupted_work(path):
    make_sources(path)
    save_some(path, [3, 4], force=True)
    with open_work(path, SOURCES, spec_for(), force=True) as work:
        assert work.saved.tolist() == [3, 4]


def test_a_file_of_another_kind_is_refused(path):
    make_fit(path)
    with pytest.raises(Refused, match="is of the kind fit; sources is needed"):
        make_sources(path)


def test_a_stranger_under_the_name_is_not_replaced(path):
    path.parent.mkdir()
    path.write_text("my thesis")
    with pytest.raises(Damaged, match="--force"):
        make_sources(path)
    assert path.read_text() == "my thesis"


@pytest.mark.parametrize("odd", ["link", "dangling", "directory", "fifo"])
def test_an_odd_thing_under_the_name_is_refused_even_with_force(tmp_path, odd):
    path, other = tmp_path / "a.h5", tmp_path / "other"
    if odd == "directory":
        path.mkdir()
    elif odd == "fifo":
        os.mkfifo(path)
    else:
        path.symlink_to(other)
        if odd == "link":
            other.write_text("precious")
    for force in (False, True):
        with pytest.raises(Refused, match="no regular file"):
            make_sources(path, force=force)
    assert not other.exists() or other.read_text() == "precious"


ODD = {
    "link": lambda path, other: path.symlink_to(other),
    "dangling link": lambda path, other: path.symlink_to(other / "file"),
    "fifo": lambda path, other: os.mkfifo(path),
}


@pytest.mark.parametrize("place", ["folder", "lock"])
@pytest.mark.parametrize("odd", [*ODD, "other"])
def test_an_odd_thing_in_place_of_the_work_folder_or_its_lock_is_refused(tmp_path, place, odd):
    path, other = tmp_path / "a.h5", tmp_path / "other"
    other.mkdir()
    where = work_folder(path)
    if place == "lock":
        where.mkdir()
        where = where / "lock"
    if odd == "other":
        where.mkdir() if place == "lock" else where.write_text("precious")
    else:
        ODD[odd](where, other)
    assert not being_held(work_folder(path))
    for force in (False, True):
        with pytest.raises(Refused):
            make_sources(path, force=force)
    assert list(other.iterdir()) == []
    assert os.path.lexists(where)


@pytest.mark.parametrize("odd", ODD)
def test_an_odd_thing_in_place_of_the_kept_settings_holds_nobody_up(path, odd):
    save_some(path, [0])
    kept = work_folder(path) / "spec.json"
    kept.unlink()
    ODD[odd](kept, path.parent)
    assert read_record(work_folder(path)) is None
    with open_work(path, SOURCES, spec_for()) as work:
        assert work.saved.tolist() == [0]


# Growing and shrinking.


def test_asking_for_more_learns_only_what_is_new(path, tmp_path):
    make_sources(path, tasks=4)
    with open_work(path, SOURCES, spec_for(9)) as work:
        assert not work.complete
        assert work.saved.tolist() == [0, 1, 2, 3]
    make_sources(path, tasks=9)
    whole = make_sources(tmp_path / "whole.h5", tasks=9)
    assert path.read_bytes() == whole.read_bytes()


def test_the_old_artefact_stays_until_the_grown_one_is_whole(path):
    make_sources(path, tasks=4)
    save_some(path, [5], spec=spec_for(9))
    assert describe(path).tasks == 4


def test_an_interrupted_smaller_run_goes_on_as_a_larger_one(path, tmp_path):
    save_some(path, [0, 2], spec=spec_for(4))
    with open_work(path, SOURCES, spec_for(9)) as work:
        assert work.saved.tolist() == [0, 2]
    make_sources(path, tasks=9)
    assert describe(path).content_sha256 == describe(make_sources(tmp_path / "b.h5", 9)).content_sha256


def test_an_interrupted_larger_run_goes_on_as_a_smaller_one_where_nothing_is_lost(path, straight):
    save_some(path, [0, 2], spec=spec_for(9))
    make_sources(path)
    assert describe(path).content_sha256 == straight


def test_saved_tasks_beyond_those_asked_for_are_refused_not_lost(path):
    save_some(path, [0, 7], spec=spec_for(9))
    with pytest.raises(Refused, match=r"begun for 9 tasks.*`qinit first`"):
        make_sources(path)
    with open_work(path, SOURCES, spec_for(9)) as work:
        assert work.saved.tolist() == [0, 7]
    make_sources(path, force=True)
    assert describe(path).tasks == 6


def test_an_artefact_with_more_tasks_than_asked_for_is_refused(path):
    make_sources(path, tasks=9)
    with pytest.raises(Refused, match="tasks: asked for 6, there is 9"):
        make_sources(path)


def test_tasks_are_adopted_from_an_artefact_of_another_name(path, tmp_path, straight):
    small = make_sources(tmp_path / "small.h5", tasks=4)
    large = make_sources(tmp_path / "large.h5", tasks=9)
    for other in (small, large):
        with open_work(path, SOURCES, spec_for()) as work, open_artefact(other) as artefact:
            work.adopt(artefact)
    make_sources(path)
    assert describe(path).content_sha256 == straight


def test_tasks_of_other_settings_are_not_adopted(path, tmp_path):
    other = make_sources(tmp_path / "other.h5", spec=spec_for(seed=1))
    with (
        open_work(path, SOURCES, spec_for()) as work,
        open_artefact(other) as artefact,
        pytest.raises(Refused, match="seed"),
    ):
        work.adopt(artefact)


# what a later version might store of the same settings
LATER = Schema("sources", SOURCES.axes, (*SOURCES.columns, Column("eval_steps", ("task",), "i4")))


def test_tasks_that_lack_a_column_of_a_later_version_are_learned_again(path, tmp_path):
    make_sources(path, tasks=4)
    make_sources(path, schema=LATER)
    straight = describe(make_sources(tmp_path / "b.h5", schema=LATER)).content_sha256
    assert describe(path).content_sha256 == straight


def test_an_artefact_without_a_column_of_a_later_version_is_complete_and_readable(path):
    make_sources(path)
    with open_work(path, LATER, spec_for(), disk=Breakable(at=1)) as work:
        assert work.complete


def test_shards_of_two_versions_are_not_merged(tmp_path):
    shards = [
        make_some(tmp_path / "new.h5", np.arange(3), 6, LATER),
        make_some(tmp_path / "old.h5", np.arange(3, 6), 6),
    ]
    with pytest.raises(Refused, match=r"old\.h5 has no eval_steps"):
        merge(shards, tmp_path / "all.h5", {})
    assert not (tmp_path / "all.h5").exists()


def make_some(path, ids, tasks, schema=SOURCES):
    """An artefact of `tasks` that holds only those with these ids."""
    with open_work(path, schema, spec_for(tasks), disk=DISK) as work:
        new = np.setdiff1d(ids, work.saved)
        work.save(rows_for(new, schema), new)
        return work.finish(work.saved)


def test_an_artefact_that_lacks_tasks_is_not_complete_for_as_many_as_it_holds(path):
    make_some(path, [0, 1, 2, 3, 4, 8], tasks=9)
    with pytest.raises(Refused, match="tasks: asked for 6, there is 9"):
        make_sources(path)


def test_the_tasks_that_are_wanted_make_it_complete(path):
    make_some(path, [2, 3], tasks=6)
    for wanted, complete in (([2, 3], True), ([3], True), ([1, 2], False), (None, False)):
        with open_work(path, SOURCES, spec_for(), tasks=wanted, disk=DISK) as work:
            assert work.complete == complete
            assert work.saved.tolist() == [2, 3]
        assert [entry.name for entry in path.parent.iterdir()] == ["a.h5"]


# Parts that do not hold.


def parts(path):
    return sorted(work_folder(path).glob("part-*.h5"))


def test_a_bad_part_is_set_aside_and_its_tasks_are_learned_again(path, straight):
    for first in (0, 2):
        save_some(path, [first, first + 1])
    damaged = parts(path)[1]
    content = bytearray(damaged.read_bytes())
    content[-200] ^= 16
    damaged.write_bytes(content[: len(content) // 2])
    with open_work(path, SOURCES, spec_for()) as work:
        assert work.saved.tolist() == [0, 1]
        assert work.set_aside == 2
    assert not damaged.exists()
    assert [one.name.startswith(damaged.name) for one in work_folder(path).glob("*.bad")] == [True]
    make_sources(path)
    assert describe(path).content_sha256 == straight
    assert not work_folder(path).exists()


@pytest.mark.parametrize("content", [b"", b"not hdf5 at all", b"\x89HDF\r\n\x1a\n"])
def test_a_part_that_is_no_artefact_is_set_aside(path, content):
    save_some(path, [0, 1])
    parts(path)[0].write_bytes(content)
    with open_work(path, SOURCES, spec_for()) as work:
        assert work.saved.tolist() == []
        assert work.set_aside == 2


def test_a_part_of_other_settings_is_set_aside_where_the_record_says_otherwise(path, tmp_path):
    save_some(path, [0])
    save_some(tmp_path / "other.h5", [3], spec=spec_for(seed=1))
    stray = parts(tmp_path / "other.h5")[0]
    stray.rename(work_folder(path) / stray.name)
    with open_work(path, SOURCES, spec_for()) as work:
        assert work.saved.tolist() == [0]
        assert work.set_aside == 1


@pytest.mark.parametrize("record", [None, "", "{", "[]", '{"kind": "sources"}'])
def test_parts_are_known_by_themselves_when_the_record_is_lost(path, record):
    save_some(path, [0, 1])
    kept = work_folder(path) / "spec.json"
    kept.unlink() if record is None else kept.write_text(record)
    with pytest.raises(Refused, match="seed"):
        make_sources(path, spec=spec_for(seed=1))
    with open_work(path, SOURCES, spec_for()) as work:
        assert work.saved.tolist() == [0, 1]


def test_a_part_damaged_while_the_work_goes_on_is_noticed(path):
    with open_work(path, SOURCES, spec_for(2)) as work:
        work.save(rows_for([0, 1]), np.arange(2))
        content = parts(path)[0].read_bytes()
        parts(path)[0].write_bytes(content[:-100])
        with pytest.raises(Damaged):
            work.finish(np.arange(2))
    assert not path.exists()


# Two writers, and names that appear.


def test_a_second_writer_is_told_that_it_is_busy(path):
    with (
        open_work(path, SOURCES, spec_for()),
        pytest.raises(Busy, match="--wait"),
        open_work(path, SOURCES, spec_for()),
    ):
        pass


def test_a_waiting_writer_finds_what_the_first_one_made(path):
    found = []

    def second():
        with open_work(path, SOURCES, spec_for(), wait=True) as work:
            found.append(work.complete)

    with open_work(path, SOURCES, spec_for()) as work:
        waiting = threading.Thread(target=second)
        waiting.start()
        work.save(rows_for(range(6)), np.arange(6))
        work.finish(np.arange(6))
    waiting.join(10)
    assert found == [True]
    assert not work_folder(path).exists()


class Intruder(Disk):
    """Puts a file under the name just before `operation`."""

    def __init__(self, path, operation, no_links=False):
        self.path = path
        self.operation = operation
        self.no_links = no_links

    def attempt(self, operation, path, call):
        if operation == self.operation:
            self.path.write_text("precious")
        if operation == "link" and self.no_links:
            raise OSError(errno.EOPNOTSUPP, os.strerror(errno.EOPNOTSUPP))
        return call()


@pytest.mark.parametrize("no_links", [False, True])
def test_a_file_that_appears_under_the_name_meanwhile_is_not_replaced(path, no_links):
    with pytest.raises(Refused, match="appeared"):
        make_sources(path, disk=Intruder(path, "link", no_links))
    assert path.read_text() == "precious"
    path.unlink()
    with open_work(path, SOURCES, spec_for()) as work:
        assert work.saved.size == 6


def test_a_file_system_without_hard_links_will_do(path, straight):
    make_sources(path, disk=Intruder(path.with_name("elsewhere.h5"), "link", no_links=True))
    assert describe(path).content_sha256 == straight


def test_a_file_of_somebody_else_in_the_work_folder_is_left_alone(path):
    save_some(path, [0])
    (work_folder(path) / "notes.txt").write_text("mine")
    make_sources(path)
    assert [one.name for one in work_folder(path).iterdir()] == ["notes.txt"]


def test_finding_it_complete_keeps_the_saved_tasks_of_an_interrupted_growth(path):
    make_sources(path)
    save_some(path, [7], spec=spec_for(9))
    with open_work(path, SOURCES, spec_for()) as work:
        assert work.complete
    with open_work(path, SOURCES, spec_for(9)) as work:
        assert work.saved.tolist() == [0, 1, 2, 3, 4, 5, 7]


def test_a_run_and_a_fit_are_made_the_same_way(tmp_path):
    assert describe(make_fit(tmp_path / "f.h5")).kind == "fit"
    assert describe(make_run(tmp_path / "r.h5")).tasks == 4
    make_fit(tmp_path / "f.h5")
    with pytest.raises(Refused, match="seed"):
        make_fit(tmp_path / "f.h5", seed=1)


@settings(max_examples=8, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(order=st.permutations(range(6)), cuts=st.lists(st.integers(0, 6), max_size=4), stops=st.booleans())
def test_any_order_batching_and_interruption_gives_the_same_content(
    tmp_path_factory, straight, order, cuts, stops
):
    path = tmp_path_factory.mktemp("any") / "a.h5"
    edges = [0, *sorted(set(cuts) - {0, 6}), 6]
    for first, stop in pairwise(edges):
        if stops:
            save_some(path, order[first:stop])
    make_sources(path, order=order, batch=2)
    assert describe(path).content_sha256 == straight


def test_parts_that_a_dead_process_left_are_flushed_before_they_count(path):
    save_some(path, [0, 1])
    disk = Breakable()
    with open_work(path, SOURCES, spec_for(), disk=disk):
        done = list(disk.done)
    assert ("flush the directory", work_folder(path).name) in done
    assert ("flush the directory", path.parent.name) in done
