"""File systems that lack a call: gone on without it where that is safe, else the way out is printed."""

from __future__ import annotations

import errno
import os

import numpy as np
import pytest
from breakable import Unflushed
from fakes import LIGHT, make_sources, rows_for, spec_for, statics_for

from qinit_store.disk import Disk
from qinit_store.errors import Refused, SystemFailed
from qinit_store.folder import work_folder
from qinit_store.lock import being_held, held
from qinit_store.probe import FileSystem, tried
from qinit_store.reading import describe
from qinit_store.work import open_work


class Lacking(Disk):
    """A disk of which one operation is answered with one error, always."""

    def __init__(self, operation, reason):
        self.operation, self.reason = operation, reason

    def attempt(self, operation, path, call):
        if operation == self.operation:
            raise OSError(self.reason, os.strerror(self.reason))
        return call()


NO_LINKS = ("EXDEV", "EACCES", "EPERM", "ENOTSUP", "EMLINK", "ENOSYS")
NO_DIRECTORY_FLUSH = ("EINVAL", "ENOTSUP", "EBADF", "EACCES")
NO_LOCKS = ("ENOLCK", "ENOTSUP", "ENOSYS")


@pytest.fixture(scope="module")
def straight(tmp_path_factory):
    return describe(make_sources(tmp_path_factory.mktemp("straight") / "a.h5", schema=LIGHT)).content_sha256


@pytest.mark.parametrize(
    ("operation", "reason"),
    [("link", one) for one in NO_LINKS] + [("flush the directory", one) for one in NO_DIRECTORY_FLUSH],
)
def test_what_can_be_done_without_is_done_without(tmp_path, straight, operation, reason):
    path = tmp_path / "store" / "a.h5"
    make_sources(path, schema=LIGHT, disk=Lacking(operation, getattr(errno, reason)))
    assert describe(path).content_sha256 == straight
    assert [one.name for one in path.parent.iterdir()] == ["a.h5"]


@pytest.mark.parametrize("operation", ["link", "flush the directory", "lock"])
@pytest.mark.parametrize("reason", ["EIO", "ENOSPC"])
def test_a_disk_that_fails_is_not_taken_for_one_that_lacks_something(tmp_path, operation, reason):
    path = tmp_path / "a.h5"
    with pytest.raises(SystemFailed, match=os.strerror(getattr(errno, reason))):
        make_sources(path, schema=LIGHT, disk=Lacking(operation, getattr(errno, reason)))
    assert not path.exists()


def test_without_links_what_took_the_name_meanwhile_is_not_replaced(tmp_path):
    path = tmp_path / "a.h5"
    disk = Lacking("link", errno.EXDEV)
    with open_work(path, LIGHT, spec_for(), disk=disk) as work:
        work.save(rows_for(range(6), LIGHT), np.arange(6))
        path.write_text("of somebody else")
        with pytest.raises(Refused, match="appeared while this was being written"):
            work.finish(np.arange(6), statics_for(LIGHT))
    assert path.read_text() == "of somebody else"


@pytest.mark.parametrize("reason", NO_LOCKS)
@pytest.mark.parametrize("wait", [False, True])
def test_without_locks_another_place_is_asked_for(tmp_path, reason, wait):
    path = tmp_path / "a.h5"
    with pytest.raises(SystemFailed, match=r"has no locks, .* with --store or -o"):
        make_sources(path, schema=LIGHT, disk=Lacking("lock", getattr(errno, reason)), wait=wait)
    assert not path.exists()


def test_where_there_are_no_locks_nothing_is_being_written(tmp_path, monkeypatch):
    with held(work_folder(tmp_path / "a.h5"), Unflushed(), wait=False):
        pass

    def lacking(descriptor, how):
        raise OSError(errno.ENOLCK, os.strerror(errno.ENOLCK))

    monkeypatch.setattr("fcntl.flock", lacking)
    assert not being_held(work_folder(tmp_path / "a.h5"))


def test_what_a_folder_offers_is_tried_and_nothing_is_left(tmp_path):
    assert tried(tmp_path, Disk()) == FileSystem(links="", flushes_directories=True)
    assert tried(tmp_path, Lacking("link", errno.EPERM)).links == "Operation not permitted"
    assert not tried(tmp_path, Lacking("flush the directory", errno.EINVAL)).flushes_directories
    with pytest.raises(SystemFailed, match="has no locks"):
        tried(tmp_path, Lacking("lock", errno.ENOLCK))
    assert list(tmp_path.iterdir()) == []
