"""qinit on terminals of its own, with a signal at a random moment of its first seconds."""

from __future__ import annotations

import fcntl
import os
import random
import signal
import subprocess
import termios
import threading
import time
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from running import QINIT

CTRL_C = b"\x03"
LONGEST = 120.0  # seconds until a command that ignores its signal is given up


@dataclass(frozen=True)
class Ended:
    """What became of a command that a signal was sent to."""

    number: int
    code: int  # negative: the signal itself ended it
    shown: str

    @property
    def kind(self) -> str:
        """ "kept" its promise, "done" before the signal came, "python" where that had not come to qinit yet; else the fault."""
        if "Traceback" in self.shown or "Error" in self.shown:
            early = "qinit_cli/app" not in self.shown and self.code in (-self.number, 1)
            return "python" if early and "KeyboardInterrupt" in self.shown else f"traceback {self.code}"
        if self.code == 128 + self.number:
            return "kept"
        if self.code == -self.number:
            return "python"
        return "done" if self.code in (0, 3) else f"code {self.code}"


def interrupted(words: Sequence[str], folder: Path, number: int, seconds: float) -> Ended:
    """Runs the command on a terminal; after `seconds` its Ctrl-C is pressed, or it is sent another signal."""
    master, slave = os.openpty()
    process = subprocess.Popen(
        [QINIT, *words],
        stdin=slave,
        stdout=slave,
        stderr=slave,
        cwd=folder,
        start_new_session=True,
        preexec_fn=lambda: fcntl.ioctl(0, termios.TIOCSCTTY, 0),  # no other thread runs now
    )
    os.close(slave)
    shown: list[bytes] = []
    reader = threading.Thread(target=_read, args=(master, shown))
    reader.start()
    time.sleep(seconds)
    if number == signal.SIGINT:
        os.write(master, CTRL_C)
    elif process.poll() is None:
        process.send_signal(number)
    try:
        code = process.wait(LONGEST)
    except subprocess.TimeoutExpired:
        process.kill()
        code = process.wait()
    reader.join()
    os.close(master)
    return Ended(number, code, b"".join(shown).decode(errors="replace"))


def _read(master: int, shown: list[bytes]) -> None:
    while True:
        try:
            part = os.read(master, 4096)
        except OSError:  # the last of those who had the terminal open has ended
            return
        if not part:
            return
        shown.append(part)


def tally(
    commands: Sequence[Sequence[str]], folder: Path, times: int, seconds: tuple[float, float], seed: int
) -> tuple[Counter[str], list[Ended]]:
    """How so many commands ended, by kind, and those that broke the promise."""
    probability = random.Random(seed)
    counts: Counter[str] = Counter()
    faults = []
    for _ in range(times):
        ended = interrupted(
            probability.choice(commands),
            folder,
            probability.choice((signal.SIGINT, signal.SIGTERM)),
            probability.uniform(*seconds),
        )
        counts[ended.kind] += 1
        if ended.kind not in ("kept", "done", "python"):
            faults.append(ended)
    return counts, faults
