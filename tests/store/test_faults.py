"""Every operation on the disk broken: before it, in its middle, after it; by a kill, an error or a signal."""

from __future__ import annotations

import errno
import os

import h5py
import numpy as np
import pytest
from breakable import Breakable, Full, Killed, Liar, ShortWrites, moments, operations_of
from fakes import LIGHT, make_sources, rows_for, spec_for, statics_for

from qinit_store.disk import Disk
from qinit_store.errors import SystemFailed
from qinit_store.folder import work_folder
from qinit_store.reading import describe
from qinit_store.work import open_work

# Every moment in the soak run, else every third.
SHARES = pytest.mark.parametrize("share", [3, pytest.param(1, marks=pytest.mark.soak)], ids=["third", "all"])


def make_light(path, **how):
    return make_sources(path, schema=LIGHT, **how)


@pytest.fixture
def path(tmp_path):
    return tmp_path / "store" / "a.h5"


@pytest.fixture(scope="module")
def straight(tmp_path_factory):
    """The content hash of the six tasks made in one go."""
    return describe(make_light(tmp_path_factory.mktemp("straight") / "a.h5")).content_sha256


def make(path):
    return lambda disk: make_light(path, batch=3, disk=disk)


def kills(operations):
    """(number, when) of every state a kill can leave; after one operation is before the next."""
    for at in moments(operations):
        yield at, "before"
        if operations[at][0] == "write":
            yield at, "middle"
    yield len(operations) - 1, "after"


@SHARES
def test_killed_at_any_operation_the_same_command_ends_with_the_same_content(tmp_path, straight, share):
    operations = operations_of(make(tmp_path / "count.h5"))
    assert len(operations) > 25
    for at, when in [*kills(operations)][::share]:
        path = tmp_path / f"{when}{at}" / "a.h5"
        with pytest.raises(Killed):
            make(path)(Breakable(at, when))
        assert not path.exists() or describe(path).content_sha256 == straight
        make_light(path)
        assert describe(path).content_sha256 == straight, operations[at]
        assert [one.name for one in path.parent.iterdir()] == ["a.h5"], operations[at]


@SHARES
def test_killed_at_any_operation_of_a_growth_the_old_or_the_new_is_whole(tmp_path, share):
    def grow(path):
        return lambda disk: make_light(path, tasks=4, disk=disk)

    old = make_light(tmp_path / "old.h5", tasks=2).read_bytes()
    new = make_light(tmp_path / "new.h5", tasks=4).read_bytes()
    (tmp_path / "count.h5").write_bytes(old)
    for at, when in [*kills(operations_of(grow(tmp_path / "count.h5")))][::share]:
        path = tmp_path / f"{when}{at}.h5"
        path.write_bytes(old)
        with pytest.raises(Killed):
            grow(path)(Breakable(at, when))
        assert path.read_bytes() in (old, new)
        make_light(path, tasks=4)
        assert path.read_bytes() == new
        assert not work_folder(path).exists()


def report(path, disk, reported):
    with open_work(path, LIGHT, spec_for(), disk=disk) as work:
        for some in ([0, 1, 2], [3, 4, 5]):
            work.save(rows_for(some, LIGHT), np.array(some))
            reported += some
        work.finish(np.arange(6), statics_for(LIGHT))


def test_what_was_reported_as_saved_is_there_after_a_kill_at_any_later_operation(tmp_path):
    operations = operations_of(make(tmp_path / "count.h5"))
    for at in moments(operations):
        path = tmp_path / str(at) / "a.h5"
        reported = []
        with pytest.raises(Killed):
            report(path, Breakable(at), reported)
        with open_work(path, LIGHT, spec_for()) as work:
            assert set(reported) <= set(work.saved.tolist()), operations[at]


REASONS = (errno.ENOSPC, errno.EIO, errno.EACCES, errno.EROFS, errno.EDQUOT)


@SHARES
def test_a_failing_operation_is_reported_and_the_same_command_goes_on(tmp_path, straight, share):
    operations = operations_of(make(tmp_path / "count.h5"))
    for number, at in enumerate(moments(operations)[::share]):
        path = tmp_path / f"{at}" / "a.h5"
        reason = REASONS[number % len(REASONS)]
        with pytest.raises(SystemFailed, match=os.strerror(reason)):
            make(path)(Breakable(at, trouble=OSError(reason, os.strerror(reason))))
        make_light(path)
        assert describe(path).content_sha256 == straight, operations[at]


def written(make):
    """The bytes that `make(disk)` writes, up to the final file and in all."""
    disk = Full(room=0, operations=())
    make(disk)
    return -disk.room_at_reserve, -disk.room


def test_a_full_disk_keeps_the_parts_and_says_where(path, straight):
    parts, _ = written(make(path.with_name("count.h5")))
    with pytest.raises(SystemFailed, match=r"No space left.*3 tasks are kept in .*\.a\.h5\.work"):
        make(path)(Full(room=parts // 3))
    with open_work(path, LIGHT, spec_for()) as work:
        assert work.saved.tolist() == [0, 1, 2]
    make_light(path)
    assert describe(path).content_sha256 == straight


@pytest.mark.parametrize("tenths", range(0, 10, 2))
def test_a_disk_that_fills_while_hdf5_writes_is_reported_and_harms_nothing(tmp_path, tenths):
    parts, total = written(lambda disk: make_sources(tmp_path / "whole.h5", disk=disk))
    path = tmp_path / "a.h5"
    with pytest.raises(SystemFailed, match="No space left"):
        make_sources(path, disk=Full(parts + 1 + (total - parts) * tenths // 10, operations=("write",)))
    assert not path.exists()
    assert not list(work_folder(path).glob("whole*")), "the room it took is given back"
    make_sources(path)
    assert path.read_bytes() == (tmp_path / "whole.h5").read_bytes()


def test_a_disk_without_room_for_the_final_file_is_met_before_hdf5_writes(path):
    parts, _ = written(make(path.with_name("count.h5")))
    disk = Full(parts)
    with pytest.raises(SystemFailed, match=r"cannot reserve room for .*6 tasks are kept"):
        make(path)(disk)


def test_a_failed_flush_is_never_tried_again(path):
    operations = operations_of(make(path.with_name("count.h5")))
    at = operations.index(
        ("flush to the disk", next(name for _, name in operations if name.startswith("part")))
    )
    disk = Breakable(at, trouble=OSError(errno.EIO, "I/O error"))
    with open_work(path, LIGHT, spec_for(), disk=disk) as work:
        with pytest.raises(SystemFailed):
            work.save(rows_for([0, 1, 2], LIGHT), np.arange(3))
        tried = len(disk.done)
        with pytest.raises(SystemFailed):
            work.save(rows_for([3], LIGHT), np.array([3]))
        assert len(disk.done) == tried
        assert work.saved.tolist() == []


def test_short_writes_are_completed(path, straight):
    make_light(path, disk=ShortWrites())
    assert describe(path).content_sha256 == straight


def test_a_directory_that_cannot_be_written_is_reported(path):
    class ReadOnly(Disk):
        def attempt(self, operation, path, call):
            raise OSError(errno.EROFS, os.strerror(errno.EROFS))

    with pytest.raises(SystemFailed, match="Read-only"):
        make_light(path, disk=ReadOnly())


@pytest.mark.parametrize("every", [12, pytest.param(1, marks=pytest.mark.soak)])
def test_an_interrupt_during_a_write_of_the_final_file_passes_hdf5_by(path, straight, every):
    operations = operations_of(make(path.with_name("count.h5")))
    writes = [
        at for at, (operation, name) in enumerate(operations) if (operation, name) == ("write", "whole.tmp")
    ]
    for at in {*writes[::every], writes[-1]}:
        target = path.with_name(f"{at}.h5")
        with pytest.raises(KeyboardInterrupt):
            make(target)(Breakable(at, trouble=KeyboardInterrupt()))
        with open_work(target, LIGHT, spec_for()) as work:
            assert work.saved.size == 6
        make_light(target)
        assert describe(target).content_sha256 == straight


def save_twice_over(path, disk):
    """Make it as a head process does that saves what it has when it is interrupted, and then goes on."""
    with open_work(path, LIGHT, spec_for(), disk=disk) as work:
        for some in ([0, 1, 2], [3, 4, 5]):
            try:
                work.save(rows_for(some, LIGHT), np.array(some))
            except KeyboardInterrupt:
                work.save(rows_for(some, LIGHT), np.array(some))
        work.finish(np.arange(6), statics_for(LIGHT))


def test_an_interrupted_save_can_be_made_again_at_once(path, straight):
    operations = operations_of(make(path.with_name("count.h5")))
    saving = [
        at for at, (_, name) in enumerate(operations) if name.startswith("part") and name.endswith("tmp")
    ]
    for at in saving:
        target = path.with_name(f"{at}.h5")
        save_twice_over(target, Breakable(at, trouble=KeyboardInterrupt()))
        assert describe(target).content_sha256 == straight


def test_a_final_file_that_does_not_read_back_is_not_published(path, straight):
    writes = operations_of(make(path.with_name("count.h5"))).count(("write", "whole.tmp"))
    reasons = []
    for at in range(0, writes, 3):
        target = path.with_name(f"{at}.h5")
        try:
            make(target)(Liar("whole", at))
        except SystemFailed as failure:
            reasons.append(str(failure))
        else:
            assert describe(target).content_sha256 == straight  # it was written over, or is padding
    assert len(reasons) > 5
    assert all("does not read back as it was written; is the disk sound?" in reason for reason in reasons)


def test_a_part_whose_numbers_changed_on_the_disk_is_set_aside(path, straight):
    with open_work(path, LIGHT, spec_for()) as work:
        work.save(rows_for([0, 1, 2], LIGHT), np.arange(3))
        part = next(work_folder(path).glob("part-*"))
    with h5py.File(part) as file:
        place = file["steps"].id.get_offset()
    content = bytearray(part.read_bytes())
    content[place + 2] ^= 1
    part.write_bytes(content)
    with open_work(path, LIGHT, spec_for()) as work:
        assert work.saved.tolist() == []
        assert work.set_aside == 3
