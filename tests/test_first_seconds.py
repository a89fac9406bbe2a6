"""Ctrl-C and SIGTERM in the first seconds of any command: the exit code of the signal, and no traceback."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from terminals import tally


def commands(pipeline: Any) -> list[list[str]]:
    """Commands of every kind: those that learn, wait, read, draw, and help."""
    runs = [str(path) for path in pipeline.runs.values()]
    return [
        ["train-sources", "gridworld", "--tasks", "5000", "-o", "a.h5", "--force"],
        ["transfer", "posterior", str(pipeline.fit), "--tasks", "5000", "-o", "b.h5", "--force"],
        ["fit", str(pipeline.sources), "-o", "c.h5", "--force"],
        ["fit", "-"],
        ["compare", *runs],
        ["list"],
        ["verify", *runs],
        ["plot", "curves", *runs, "-o", "d.svg"],
        ["--help"],
    ]


def test_a_signal_in_the_first_seconds_ends_a_command_as_promised(pipeline: Any, tmp_path: Path) -> None:
    counts, faults = tally(commands(pipeline), tmp_path, 20, (0.1, 1.0), seed=3)
    assert not faults, counts


@pytest.mark.soak
def test_a_thousand_signals_in_the_first_two_seconds(
    pipeline: Any, tmp_path: Path, record_property: Callable[[str, Any], None]
) -> None:
    counts, faults = tally(commands(pipeline), tmp_path, 1000, (0.0, 2.0), seed=4)
    record_property("counts", dict(counts))
    print(dict(counts))
    assert not faults, counts


PROGRAM = """
import os, signal, sys, time
from qinit_cli import signals
signals.PATIENCE, signals.LOOK = 1.0, 0.3
signals.install()
def ask():
    os.kill(os.getpid(), signal.SIGTERM)
{}
time.sleep(60)
"""
SWALLOWING = {
    "an endless import": "sys.path.insert(0, sys.argv[1])\nimport endless",
    "a destructor": "class Asks:\n    def __del__(self): ask()\nAsks()",
    "whoever catches everything": "try:\n    ask()\nexcept BaseException: pass",
}
AFTERWARDS = """sys.path.insert(0, sys.argv[1])
try:
    import asking
    print("imported", flush=True)
    time.sleep(60)
except signals.Interrupted:
    sys.exit(signals.exit_code())
"""


def _ended(program: str, folder: Path) -> tuple[int, str, str]:
    """What becomes of a program beside two modules that ask for a signal while they are imported."""
    (folder / "asking.py").write_text(
        "import __main__\ntry:\n    __main__.ask()\nexcept BaseException:\n    raise ImportError\n"
    )
    (folder / "endless.py").write_text("import __main__, time\n__main__.ask()\ntime.sleep(60)\n")
    ended = subprocess.run(
        [sys.executable, "-c", PROGRAM.format(program), str(folder)],
        capture_output=True,
        text=True,
        timeout=50,
    )
    return ended.returncode, ended.stdout, ended.stderr


@pytest.mark.parametrize("where", SWALLOWING)
def test_a_signal_that_is_swallowed_ends_the_process_all_the_same(where: str, tmp_path: Path) -> None:
    assert _ended(SWALLOWING[where], tmp_path) == (143, "", "")


def test_a_signal_during_an_import_is_raised_after_it(tmp_path: Path) -> None:
    assert _ended(AFTERWARDS, tmp_path) == (143, "imported\n", "")
