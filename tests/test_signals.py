from __future__ import annotations

import os
import signal
import subprocess
import sys
import threading
from concurrent.futures import ThreadPoolExecutor

import pytest

from qinit_cli.errors import Interrupted
from qinit_cli.signals import asking_first


@pytest.mark.parametrize(("number", "code"), [(signal.SIGINT, 130), (signal.SIGTERM, 143)])
def test_the_first_signal_asks_and_the_second_ends(number: signal.Signals, code: int) -> None:
    asked: list[bool] = []
    with asking_first(lambda: asked.append(True)) as received:
        os.kill(os.getpid(), number)
        assert received == [number]
        assert asked == [True]
        with pytest.raises(Interrupted) as ended:
            os.kill(os.getpid(), number)
    assert asked == [True]
    assert ended.value.exit_code == code


def test_one_signal_asks_the_blocks_of_all_threads_and_those_that_come_later() -> None:
    asked: list[str] = []
    entered, leave = threading.Event(), threading.Event()
    received: dict[str, list[int]] = {}

    def learn(name: str) -> None:
        with asking_first(lambda: asked.append(name)) as mine:
            received[name] = mine
            entered.set()
            assert leave.wait(10)

    with asking_first(lambda: asked.append("main")), ThreadPoolExecutor(2) as threads:
        first = threads.submit(learn, "first")
        assert entered.wait(10)
        os.kill(os.getpid(), signal.SIGINT)
        assert asked == ["main", "first"]
        leave.set()
        threads.submit(learn, "later").result()
        first.result()
    assert asked == ["main", "first", "later"]
    assert received == {"first": [signal.SIGINT], "later": [signal.SIGINT]}


def test_a_thread_is_not_asked_by_the_signal_of_a_block_that_was_left() -> None:
    with asking_first(lambda: None):
        os.kill(os.getpid(), signal.SIGINT)
    asked: list[bool] = []

    def learn() -> list[int]:
        with asking_first(lambda: asked.append(True)) as mine:
            return list(mine)

    with ThreadPoolExecutor(1) as threads:
        assert threads.submit(learn).result() == []
    assert asked == []


def test_handlers_are_given_back() -> None:
    before = signal.getsignal(signal.SIGINT), signal.getsignal(signal.SIGTERM)
    with asking_first(lambda: None):
        assert signal.getsignal(signal.SIGINT) != before[0]
    assert (signal.getsignal(signal.SIGINT), signal.getsignal(signal.SIGTERM)) == before


def test_whoever_catches_everything_does_not_swallow_an_interrupt() -> None:
    assert not issubclass(Interrupted, Exception)


def test_an_end_in_good_order_that_takes_long_keeps_the_code_of_its_signal() -> None:
    program = """
import os, signal, sys, time
from qinit_cli import signals
from qinit_cli.errors import Interrupted

class Slow:
    def __del__(self, sleep=time.sleep):
        sleep(0.3)

signals.PATIENCE = signals.LOOK = 0.1
signals.install()
slow = Slow()
try:
    os.kill(os.getpid(), signal.SIGINT)
    time.sleep(1)
except Interrupted as interrupted:
    sys.exit(interrupted.exit_code)
"""
    assert subprocess.run([sys.executable, "-c", program], timeout=30).returncode == 130
