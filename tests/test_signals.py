from __future__ import annotations

import os
import signal

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


def test_handlers_are_given_back() -> None:
    before = signal.getsignal(signal.SIGINT), signal.getsignal(signal.SIGTERM)
    with asking_first(lambda: None):
        assert signal.getsignal(signal.SIGINT) != before[0]
    assert (signal.getsignal(signal.SIGINT), signal.getsignal(signal.SIGTERM)) == before


def test_whoever_catches_everything_does_not_swallow_an_interrupt() -> None:
    assert not issubclass(Interrupted, Exception)
