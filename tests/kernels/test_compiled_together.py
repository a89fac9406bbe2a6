"""One cache folder under several processes: filled at once, by processes that are killed, for code in a read-only folder."""

from __future__ import annotations

import importlib
import os
import signal
import subprocess
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import pytest

from qinit_cli.kernels import compiled

LOOPS = """
from qinit_cli.kernels.compiled import compiled, inner

@inner
def half(number):
    return number / 2

@inner
def doubled(number):
    return number + number

@compiled
def summed(numbers):
    total = doubled(numbers[0])
    for number in numbers[1:]:
        total += doubled(number)
    return total, half(total)
"""
CHILD = """
import os, sys
import numpy as np
import loops

{before}
print("ready", flush=True)
sys.stdin.readline()
for kind in sys.argv[1:]:
    total, half = loops.summed(np.arange(1, 4).astype(kind))
    print(float(total) if np.dtype(kind).kind == "f" else int(total), float(half), sum(loops.summed.stats.cache_misses.values()))
"""
KINDS = ("float64", "float32", "int64", "int32")
RIGHT = ["12.0 6.0", "12.0 6.0", "12 6.0", "12 6.0"]


@pytest.fixture
def place(tmp_path: Path) -> Path:
    """Where the loops are, and a folder `cache` that is not there yet."""
    (tmp_path / "loops.py").write_text(LOOPS)
    return tmp_path


def started(place: Path, kinds: Sequence[str], before: str = "") -> subprocess.Popen[str]:
    """A process that has imported the loops and waits for a line to call them."""
    found = os.pathsep.join([str(place), str(Path(compiled.__file__).parents[2])])
    child = subprocess.Popen(
        [sys.executable, "-B", "-c", CHILD.format(before=before), *kinds],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
        env=os.environ | {"PYTHONPATH": found, "NUMBA_CACHE_DIR": str(place / "cache")},
    )
    assert child.stdout is not None
    assert child.stdout.readline() == "ready\n"
    return child


def results(child: subprocess.Popen[str]) -> list[str]:
    """What it computes, and how often the machine code was not there."""
    told, _ = child.communicate("\n")
    assert child.returncode == 0
    return told.splitlines()


def test_cold_processes_that_fill_one_folder_at_once_are_all_right(place: Path) -> None:
    orders = [KINDS, KINDS[::-1], KINDS]
    children = [started(place, kinds) for kinds in orders]
    for child in children:
        assert child.stdin is not None
        child.stdin.write("\n")
        child.stdin.flush()
    for child, kinds in zip(children, orders, strict=True):
        told = [line.rpartition(" ")[0] for line in results(child)]
        assert told == [RIGHT[KINDS.index(kind)] for kind in kinds]
    results(started(place, KINDS))  # compiles what one of them may have struck from another's index
    assert results(started(place, KINDS)) == [f"{right} 0" for right in RIGHT]


DEATHS = {  # how it dies: what of the cache it replaces, and the file that it has half written by then
    "half of the code": ("_save_data", "kept._data_path(what)"),
    "half of an index": ("_save_index", "kept._index_path"),
    "an index without the code": ("_save_data", "os.devnull"),
}


@pytest.mark.parametrize("death", DEATHS)
def test_a_process_killed_while_it_keeps_machine_code_harms_none_after_it(place: Path, death: str) -> None:
    results(started(place, KINDS[:1]))
    saving, half = DEATHS[death]
    dying = f"""
import signal
kept = loops.summed._cache._cache_file
def dying(what, *rest):
    if {half} == os.devnull:
        os.kill(os.getpid(), signal.SIGKILL)
    with kept._open_for_write({half}) as file:
        file.write(b"half")
        file.flush()
        os.kill(os.getpid(), signal.SIGKILL)
kept.{saving} = dying
"""
    killed = started(place, KINDS[1:2], dying)
    killed.communicate("\n")
    assert killed.returncode == -signal.SIGKILL
    told = [line.rpartition(" ")[0] for line in results(started(place, KINDS[:2]))]
    assert told == RIGHT[:2]
    assert results(started(place, KINDS[:2])) == [f"{right} 0" for right in RIGHT[:2]]


def test_processes_that_keep_code_for_other_types_at_once_never_run_each_others(
    place: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(place / "cache"))
    monkeypatch.syspath_prepend(str(place))
    (place / "adding.py").write_text("def add(number):\n    return number + 1\n")
    compiled.cache_folder.cache_clear()
    try:
        assert results_of_a_race(importlib.import_module("adding").add) == (2.5, 2)
    finally:
        compiled.cache_folder.cache_clear()


def results_of_a_race(add: Callable[[Any], Any]) -> tuple[float, int]:
    """What a third one computes once a second has begun to save before the first one's index was there, and ended first."""
    first, second = compiled.compiled(add), compiled.compiled(add)
    its, others = first._cache._cache_file, second._cache._cache_file
    save_index = its._save_index
    others._load_index = dict  # as it was when it looked: empty

    def interrupted(overloads: dict[Any, Any]) -> None:
        save_index(overloads)
        second(1.5)

    its._save_index = interrupted
    first(1)
    third = compiled.compiled(add)
    return third(1.5), third(1)


def test_nothing_is_written_beside_the_code(place: Path) -> None:
    place.joinpath("loops.py").chmod(0o444)
    place.joinpath("cache").mkdir()
    place.chmod(0o555)
    try:
        results(started(place, KINDS[:1]))
        assert results(started(place, KINDS[:1])) == ["12.0 6.0 0"]
        assert {path.name for path in place.iterdir()} == {"loops.py", "cache"}
    finally:
        place.chmod(0o755)
