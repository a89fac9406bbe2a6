"""The lock of a work folder: one holder at a time, also over the folder's being taken away and made again."""

from __future__ import annotations

import threading
import time

import pytest

from qinit_store import folder as work_folders
from qinit_store.disk import Disk
from qinit_store.errors import Busy
from qinit_store.lock import being_held, held


@pytest.fixture
def folder(tmp_path):
    return tmp_path / ".a.h5.work"


def test_it_is_held_within_the_block_and_free_after_it(folder):
    assert not being_held(folder)
    with held(folder, Disk(), wait=False):
        assert being_held(folder)
        with pytest.raises(Busy, match=r"writing .*/a\.h5"), held(folder, Disk(), wait=False):
            pass
    assert not being_held(folder)
    with held(folder, Disk(), wait=False):
        pass


def test_looking_whether_it_is_held_does_not_turn_a_writer_away(folder):
    with held(folder, Disk(), wait=False):
        pass
    stop = threading.Event()

    def look():
        while not stop.is_set():
            being_held(folder)
            time.sleep(0.001)

    looking = threading.Thread(target=look)
    looking.start()
    try:
        for _ in range(30):
            with held(folder, Disk(), wait=False):
                pass
    finally:
        stop.set()
        looking.join()


def test_who_waited_for_a_lock_that_was_taken_away_waits_for_its_successor(folder):
    entered = threading.Event()

    def wait():
        with held(folder, Disk(), wait=True):
            entered.set()

    waiting = threading.Thread(target=wait)
    with held(folder, Disk(), wait=False):
        waiting.start()
        time.sleep(0.1)  # it waits for the file that goes now
        work_folders.remove_folder(folder, Disk())
        second = held(folder, Disk(), wait=False)
        second.__enter__()
    time.sleep(0.1)
    assert not entered.is_set()
    second.__exit__(None, None, None)
    waiting.join(5)
    assert entered.is_set()
