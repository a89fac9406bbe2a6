"""Signals wait while HDF5 writes through Python, and come where an exception does no harm."""

from __future__ import annotations

import os
import signal
import threading

import pytest
from breakable import Unflushed, operations_of
from fakes import LIGHT, make_sources, spec_for

from qinit_store.interrupts import held_back
from qinit_store.reading import describe
from qinit_store.work import open_work


class Came(BaseException):
    """What the handler of this test raises."""


@pytest.fixture(params=[signal.SIGINT, signal.SIGTERM])
def number(request):
    """A signal whose handler raises."""

    def handler(number, frame):
        raise Came(number)

    before = signal.signal(request.param, handler)
    yield request.param
    signal.signal(request.param, before)


def interrupted(number, reached, deliver):
    """Send the signal within the block, and note what is reached after it."""
    with held_back() as signals:
        os.kill(os.getpid(), number)
        reached.append("sent")
        if deliver:
            signals.deliver()
            reached.append("delivered")


@pytest.mark.parametrize("deliver", [False, True])
def test_a_signal_waits_until_it_is_delivered_or_the_block_is_left(number, deliver):
    reached = []
    with pytest.raises(Came):
        interrupted(number, reached, deliver)
    assert reached == ["sent"]
    with pytest.raises(Came):
        os.kill(os.getpid(), number)


def test_without_a_signal_nothing_happens(number):
    handler = signal.getsignal(number)
    with held_back() as signals:
        signals.deliver()
    assert signal.getsignal(number) is handler


def test_a_signal_that_is_ignored_stays_ignored():
    before = signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        with held_back():
            os.kill(os.getpid(), signal.SIGINT)
    finally:
        signal.signal(signal.SIGINT, before)


def test_other_threads_leave_handlers_alone(number):
    found = []

    def look():
        with held_back():
            found.append(signal.getsignal(number))

    handler = signal.getsignal(number)
    thread = threading.Thread(target=look)
    thread.start()
    thread.join()
    assert found == [handler]


class Signalling(Unflushed):
    """Sends a signal to this process at write number `at` of the final file."""

    def __init__(self, number, at):
        self.number = number
        self.left = at

    def write(self, descriptor, path, content, offset):
        if path.name == "whole.tmp":
            self.left -= 1
            if self.left == -1:
                os.kill(os.getpid(), self.number)
        return super().write(descriptor, path, content, offset)


@pytest.mark.parametrize("share", [0, 0.5, 1], ids=["first write", "middle", "last write"])
def test_a_signal_while_the_final_file_is_written_loses_nothing_and_is_no_fault_of_the_disk(
    tmp_path, number, share
):
    path, straight = tmp_path / "a.h5", tmp_path / "straight.h5"
    operations = operations_of(lambda disk: make_sources(straight, schema=LIGHT, disk=disk))
    at = round(share * (operations.count(("write", "whole.tmp")) - 1))
    with pytest.raises(Came):
        make_sources(path, schema=LIGHT, disk=Signalling(number, at))
    assert not path.exists()
    with open_work(path, LIGHT, spec_for()) as work:
        assert work.saved.size == 6
    make_sources(path, schema=LIGHT)
    assert describe(path).content_sha256 == describe(straight).content_sha256
