"""One command line, how it ended, and a small pipeline that many tests look at."""

from __future__ import annotations

import contextlib
import fcntl
import io
import json
import os
import pty
import struct
import subprocess
import sys
import termios
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

QINIT = Path(sys.executable).with_name("qinit")
SMALL_SOURCES = ("gridworld", "--size", "6", "--tasks", "4", "--episodes", "200", "--variance", "2")


@dataclass(frozen=True)
class Ended:
    """How a command ended."""

    code: int
    out: str
    err: str

    @property
    def path(self) -> Path:
        """The artefact's path, which must be all that is on stdout."""
        [line] = self.out.splitlines()
        return Path(line)

    @property
    def json(self) -> Any:
        """The one document on stdout; where there is none the failure shows what the command printed instead."""
        assert self.out, f"exit {self.code}: {self.err}"
        return json.loads(self.out)


def run_here(arguments: Sequence[str], stdin: str = "") -> Ended:
    """One command line in this process, with stdin as given."""
    from qinit_cli.app import run

    out, err, before = io.StringIO(), io.StringIO(), sys.stdin
    sys.stdin = io.StringIO(stdin)
    try:
        with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
            code = run([str(argument) for argument in arguments])
    finally:
        sys.stdin = before
    return Ended(code, out.getvalue(), err.getvalue())


@dataclass(frozen=True)
class Pipeline:
    """A small store: sources, their fit, and a run of each method on the same targets."""

    store: Path
    sources: Path
    fit: Path
    runs: Mapping[str, Path]


def on_terminal(
    qinit: Path, words: tuple[Any, ...], folder: Path, env: Mapping[str, str] | None = None
) -> tuple[str, int]:
    """All that a command writes on a terminal of 80 columns and 24 rows, stdout and stderr alike, and its code."""
    master, terminal = pty.openpty()
    fcntl.ioctl(terminal, termios.TIOCSWINSZ, struct.pack("HHHH", 24, 80, 0, 0))
    surroundings = {name: value for name, value in os.environ.items() if name not in ("COLUMNS", "LINES")}
    process = subprocess.Popen(
        [qinit, *map(str, words)],
        stdin=terminal,
        stdout=terminal,
        stderr=terminal,
        cwd=folder,
        env={**surroundings, "TERM": "xterm-256color", **(env or {})},
    )
    os.close(terminal)
    seen = b""
    while True:
        try:
            block = os.read(master, 65536)
        except OSError:  # the other end is closed
            break
        if not block:
            break
        seen += block
    os.close(master)
    return seen.decode(), process.wait(60)
