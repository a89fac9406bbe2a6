"""`qinit` forked from a process that has imported everything: the imports cost more than most commands.

Each command is a process, with its own streams, folder, environment and exit code. What modules read while they are imported (the
folder of compiled kernels, ...) and the order of sets are those of the first process.
`python ready.py SOCKET` is that process; the script that `Ready.stand_in` writes passes a command to it.
"""

from __future__ import annotations

import contextlib
import gc
import importlib
import io
import json
import os
import pkgutil
import signal
import socket
import subprocess
import sys
import tempfile
import threading
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

# -I -S: what it imports is a tenth of what a command line otherwise waits for
STAND_IN = """#!{python} -IS
import json, os, signal, socket, sys
with socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET) as there:
    there.connect({address!r})
    words = json.dumps([{command!r} + sys.argv[1:], os.getcwd(), dict(os.environ)])
    socket.send_fds(there, [words.encode("utf-8", "surrogatepass")], [0, 1, 2])
    for stream in (0, 1, 2):
        os.close(stream)
    there.recv(16)  # its number
    code = int(there.recv(16) or 1)
if code < 0:
    signal.signal(-code, signal.SIG_DFL)
    os.kill(os.getpid(), -code)
os._exit(code)
"""
MODULES = ("matplotlib.backends.backend_agg", "matplotlib.backends.backend_svg", "scipy.stats", "jinja2")
MOST_BYTES = 1 << 17  # of a command line with its environment


@dataclass(frozen=True)
class Ready:
    """A process that waits for commands."""

    folder: Path  # that qinit is found in

    @property
    def qinit(self) -> Path:
        """An executable in the place of qinit."""
        return self.folder / "qinit"

    def stand_in(self, path: Path, command: str = "qinit") -> None:
        """Writes an executable; `command` is qinit, or a script of Python."""
        address = str(self.folder / "socket")
        path.write_text(STAND_IN.format(python=sys.executable, address=address, command=[command]))
        path.chmod(0o755)

    @contextlib.contextmanager
    def process(self, folder: Path, *words: object, command: str = "qinit") -> Iterator[Running]:
        """A command that is told of by its number, so that signals reach it and not a stand-in; killed with the context."""
        asked = json.dumps([[command, *map(str, words)], str(folder), dict(os.environ)])
        streams = [os.open(os.devnull, os.O_RDONLY), *(os.memfd_create(name) for name in ("out", "err"))]
        with socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET) as there:
            there.connect(str(self.folder / "socket"))
            socket.send_fds(there, [asked.encode("utf-8", "surrogatepass")], streams)
            running = Running(there, int(there.recv(16)), (streams[1], streams[2]))
            try:
                yield running
            finally:
                if running.code is None:
                    running.send_signal(signal.SIGKILL)
                    running.wait()
                for stream in streams:
                    os.close(stream)


@dataclass
class Running:
    """A command of `Ready.process`."""

    there: socket.socket
    number: int
    streams: tuple[int, int]
    code: int | None = None  # None while it runs; negative: the signal that ended it
    out: str = ""  # all that it wrote, once it has ended
    err: str = ""

    def send_signal(self, number: int) -> None:
        """Sends it a signal."""
        os.kill(self.number, number)

    def wait(self, seconds: float = 60.0) -> int:
        """Its exit code; TimeoutError where it goes on for longer."""
        if self.code is None:
            self.there.settimeout(seconds)
            self.code = int(self.there.recv(16) or 1)
            self.out, self.err = (
                os.pread(stream, os.fstat(stream).st_size, 0).decode() for stream in self.streams
            )
        return self.code

    def wait_until(self, reached: Callable[[], bool]) -> None:
        """Returns once that is so, while the command still runs; AssertionError where it ended before."""
        for _ in range(20_000):
            if reached():
                return
            with contextlib.suppress(TimeoutError):
                raise AssertionError(f"exit {self.wait(0.005)}: {self.err}")
        raise AssertionError("not reached")


@contextlib.contextmanager
def started(folder: Path, **environment: str) -> Iterator[Ready]:
    """The process, with a socket in the folder; it ends with the context."""
    with subprocess.Popen(
        [sys.executable, __file__, folder / "socket"],
        env={**os.environ, "PYTHONHASHSEED": "7", **environment},
        stdout=subprocess.PIPE,
        text=True,
    ) as process:
        assert process.stdout is not None
        assert process.stdout.readline() == "ready\n"
        made = Ready(folder)
        made.stand_in(made.qinit)
        try:
            yield made
        finally:  # else whoever fails waits for it for ever
            process.kill()


def serve(address: str) -> None:
    """Imports everything, then forks for each command that arrives, without end."""
    import qinit_cli

    for found in pkgutil.walk_packages(qinit_cli.__path__, "qinit_cli."):
        if not found.name.endswith("__main__"):
            importlib.import_module(found.name)
    for name in MODULES:
        importlib.import_module(name)
    _warm_up()
    gc.freeze()
    signal.signal(signal.SIGCHLD, signal.SIG_IGN)  # children leave nothing behind
    with socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET) as listening:
        listening.bind(address)
        listening.listen(64)
        print("ready", flush=True)
        while True:
            there, _ = listening.accept()
            if os.fork() == 0:
                listening.close()
                _run(there)
            there.close()


def _warm_up() -> None:
    """Runs a command of each stage: what the first of a process loads is there then, machine code and fonts among it."""
    from running import run_here

    small = ("--tasks", "2", "--episodes", "2", "-q", "-o")
    with tempfile.TemporaryDirectory() as folder, contextlib.chdir(folder):
        for words in (
            ("train-sources", "gridworld", "--size", "4", *small, "sources.h5"),
            ("fit", "sources.h5", "-q", "-o", "fit.h5"),
            ("transfer", "mean", "fit.h5", *small, "run.h5"),
            ("plot", "curves", "run.h5", "-q", "-o", "curves.png"),
        ):
            ended = run_here(words)
            assert ended.code == 0, ended.err
    assert threading.active_count() == 1  # a fork has no other


def _run(there: socket.socket) -> None:
    """The command in a process of its own, and its code to whoever asked."""
    words, streams, _, _ = socket.recv_fds(there, MOST_BYTES, 3)
    signal.signal(signal.SIGCHLD, signal.SIG_DFL)
    if (child := os.fork()) == 0:
        there.close()
        code = 1
        try:
            code = _command(words, streams)
        finally:
            os._exit(code)
    for stream in streams:
        os.close(stream)
    with contextlib.suppress(OSError):  # whoever asked is gone
        there.send(str(child).encode())
    _, status = os.waitpid(child, 0)
    with contextlib.suppress(OSError):
        there.send(str(os.waitstatus_to_exitcode(status)).encode())
    os._exit(0)


def _command(words: bytes, streams: Sequence[int]) -> int:
    sys.argv, folder, environment = json.loads(words.decode("utf-8", "surrogatepass"))
    for number, stream in enumerate(streams):
        os.dup2(stream, number)
        os.close(stream)
    sys.stdin = io.TextIOWrapper(io.BufferedReader(io.FileIO(0, closefd=False)), encoding="utf-8")
    sys.stdout, sys.stderr = (
        io.TextIOWrapper(
            io.BufferedWriter(io.FileIO(number, "w", closefd=False)),
            encoding="utf-8",
            errors=errors,
            line_buffering=number == 2 or os.isatty(number),
        )
        for number, errors in ((1, "strict"), (2, "backslashreplace"))
    )
    os.chdir(folder)
    os.environ.clear()
    os.environ.update(environment)
    code: object = 0
    try:
        if sys.argv[0] == "qinit":
            from qinit_cli.__main__ import main

            main()
        else:
            import runpy

            runpy.run_path(sys.argv[0], run_name="__main__")
    except SystemExit as end:
        code = end.code
    sys.stdout.flush()
    sys.stderr.flush()
    return code if isinstance(code, int) else 1


if __name__ == "__main__":
    serve(sys.argv[1])
