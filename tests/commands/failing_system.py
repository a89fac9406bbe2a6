"""A process of its own, preloaded with failing_system.c: python failing_system.py FOLDER MOST.

Runs commands while one call of the system after another fails, and prints as JSON, one a line, what became of each. Of
each kind of call of a command at most MOST are made to fail, each alone, evenly over the command, with changing errors.
"""

from __future__ import annotations

import contextlib
import ctypes
import errno
import io
import json
import os
import shutil
import sys
from dataclasses import dataclass
from pathlib import Path

from qinit_cli.app import run
from qinit_store.reading import describe, open_artefact
from qinit_store.work import open_work

SYSTEM = ctypes.CDLL(None)
SYSTEM.calls.restype = SYSTEM.failures.restype = ctypes.c_long
SYSTEM.fail_next.argtypes = (ctypes.c_int, ctypes.c_int, ctypes.c_long, ctypes.c_char_p)
OPEN, READ, STAT, LIST, LOCK, MEMORY = range(6)
KINDS = {OPEN: "open", READ: "read", STAT: "stat", LIST: "list", LOCK: "lock", MEMORY: "memory"}
ERRORS = ("EIO", "EMFILE", "ENFILE", "ENOMEM", "EACCES", "EINTR", "ESTALE")
IN_A_CHILD = (
    8  # calls of each kind that fail in the process that verify starts, which cannot be counted from here
)

TINY = ("gridworld", "--size", "4", "--learner", "exact")
TARGETS = ("--tasks", "3", "--episodes", "20")


@dataclass(frozen=True)
class Command:
    """A command, and what of its folder it must leave as it is."""

    words: tuple[str, ...]
    made: str = ""  # the artefact it makes
    like: str = ""  # one with the content hash which that must have
    in_child: bool = False
    memory: bool = (
        True  # whether the lack of it is reported by us: not by a starting interpreter, nor by FreeType
    )


COMMANDS = {
    "list": Command(("list", "--store", "store", "--format", "json")),
    "show": Command(("show", "all.h5", "--format", "json")),
    "verify": Command(("verify", "all.h5"), in_child=True, memory=False),
    "resume": Command(("train-sources", *TINY, "--tasks", "9", "-o", "begun.h5"), "begun.h5", "all.h5"),
    "grow": Command(("train-sources", *TINY, "--tasks", "9", "-o", "some.h5"), "some.h5", "all.h5"),
    "grow in store": Command(("train-sources", *TINY, "--tasks", "9", "--store", "store"), "", "all.h5"),
    "fit": Command(("fit", "all.h5", "-o", "made.h5"), "made.h5", "fit.h5"),
    "transfer": Command(("transfer", "zero", "fit.h5", *TARGETS, "-o", "made.h5"), "made.h5", "zero.h5"),
    "compare": Command(("compare", "zero.h5", "mean.h5", "--format", "json")),
    "salvage": Command(("salvage", "all.h5", "-o", "made.h5"), "made.h5", "all.h5"),
    "merge": Command(("merge", "one.h5", "two.h5", "-o", "made.h5"), "made.h5", "all.h5"),
    "plot": Command(("plot", "curves", "zero.h5", "-o", "made.svg"), memory=False),
    "export": Command(("export", "all.h5", "--to", "json", "-o", "made.json")),
}


def qinit(*words: str) -> tuple[int, str, str]:
    """Exit code, stdout and stderr of one command line in this process."""
    out, err = io.StringIO(), io.StringIO()
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
        code = run(list(words))
    return code, out.getvalue(), err.getvalue()


def prepare(folder: Path) -> None:
    """What the commands read: artefacts, shares, a store, and work that was begun in parts of two tasks."""
    os.chdir(folder)
    sources = ("train-sources", *TINY, "-q", "--tasks")
    for words in (
        (*sources, "9", "-o", "all.h5"),
        (*sources, "4", "-o", "some.h5"),
        (*sources, "4", "--store", "store"),
        (*sources, "9", "--shard", "1/2", "-o", "one.h5"),
        (*sources, "9", "--shard", "2/2", "-o", "two.h5"),
        ("fit", "all.h5", "-o", "fit.h5", "-q"),
        *(("transfer", name, "fit.h5", *TARGETS, "-o", f"{name}.h5", "-q") for name in ("zero", "mean")),
    ):
        code, _, err = qinit(*words)
        assert code == 0, err
    with open_artefact(Path("all.h5")) as whole:
        columns = [column.name for column in whole.schema.task_columns if column.given]
        with open_work(Path("begun.h5"), whole.schema, whole.spec) as work:
            for first in (0, 2, 4):
                rows = whole.rows(first, first + 2)
                work.save({name: rows[name] for name in columns}, rows["task"])


def attempt(command: Command, name: str, kind: int, reason: str, at: int, pristine: Path) -> None:
    """One run in a copy of the folder with one call failing; then the same again with none."""
    folder = pristine.with_name("run")
    shutil.rmtree(folder, ignore_errors=True)
    shutil.copytree(pristine, folder)
    os.chdir(folder)
    number, where = getattr(errno, reason), ".h5"
    if command.in_child:
        os.environ["FAILING_SYSTEM"] = f"{kind} {number} {at} {where}"
    else:
        SYSTEM.fail_next(kind, number, at, where.encode())
    try:
        code, _, err = qinit(*command.words)
    finally:
        failed = SYSTEM.failures()
        SYSTEM.fail_next(-1, 0, -1, b"")
        os.environ.pop("FAILING_SYSTEM", None)
    told = {"command": name, "kind": KINDS[kind], "reason": reason, "at": at, "failed": failed, "code": code}
    told |= {"err": err, "lost": lost(pristine, folder, command)}
    if command.made:
        again, _, _ = qinit(*command.words, "-q")
        like = describe(pristine / command.like).content_sha256
        told["same"] = again == 0 and describe(folder / command.made).content_sha256 == like
    print(json.dumps(told), flush=True)


def lost(pristine: Path, folder: Path, command: Command) -> list[str]:
    """Files that are gone or others than before, though the command did not finish what it makes of them."""
    finished = bool(command.made) and describes(folder / command.made, pristine / command.like)
    gone = []
    for path in sorted(pristine.rglob("*.h5")):
        name = path.relative_to(pristine)
        kept = (folder / name).is_file() and (folder / name).read_bytes() == path.read_bytes()
        own = str(name) == command.made or f".{command.made}.work" in name.parts
        if not kept and not (own and finished):
            gone.append(str(name))
    return gone + [str(path) for path in folder.rglob("*.bad")]


def describes(path: Path, like: Path) -> bool:
    return path.is_file() and describe(path).content_sha256 == describe(like).content_sha256


def main(folder: Path, most: int) -> None:
    pristine = folder / "pristine"
    pristine.mkdir()
    prepare(pristine)
    turn = 0
    for name, command in COMMANDS.items():
        shutil.rmtree(folder / "run", ignore_errors=True)
        shutil.copytree(pristine, folder / "run")
        os.chdir(folder / "run")
        qinit(*command.words)  # what is imported and compiled is there from now on
        shutil.rmtree(folder / "run")
        shutil.copytree(pristine, folder / "run")
        os.chdir(folder / "run")
        SYSTEM.fail_next(-1, 0, -1, b".h5")
        assert qinit(*command.words)[0] == 0
        counted = {kind: IN_A_CHILD if command.in_child else SYSTEM.calls(kind) for kind in KINDS}
        if not command.memory:
            del counted[MEMORY]
        for kind, calls in counted.items():
            for at in sorted({(2 * one + 1) * calls // (2 * most) for one in range(most)} if calls else ()):
                attempt(command, name, kind, ERRORS[turn % len(ERRORS)], at, pristine)
                turn += 1


if __name__ == "__main__":
    main(Path(sys.argv[1]), int(sys.argv[2]))
