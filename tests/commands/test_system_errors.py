"""One call of the system fails: exit code 7 and a sentence, or the same result; never damage, nothing set aside."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

HERE = Path(__file__).parent
COMPILER = shutil.which("cc")


@pytest.fixture(scope="module")
def shim(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The compiled failing_system.c."""
    if COMPILER is None or sys.platform != "linux":
        pytest.skip("needs a C compiler and LD_PRELOAD")
    made = tmp_path_factory.mktemp("shim") / "failing_system.so"
    command = [COMPILER, "-shared", "-fPIC", "-O1", "-o", made, HERE / "failing_system.c", "-ldl"]
    subprocess.run(command, check=True)
    return made


@pytest.mark.parametrize(("most", "least"), [(1, 40), pytest.param(24, 400, marks=pytest.mark.soak)])
def test_a_failing_call_is_7_and_costs_nothing_that_was_saved(
    shim: Path, tmp_path: Path, most: int, least: int
) -> None:
    ended = subprocess.run(
        [sys.executable, HERE / "failing_system.py", tmp_path, str(most)],
        env={**os.environ, "LD_PRELOAD": str(shim)},
        capture_output=True,
        text=True,
        check=False,
    )
    assert ended.returncode == 0, ended.stderr
    runs = [json.loads(line) for line in ended.stdout.splitlines()]
    assert sum(run["failed"] for run in runs) > least
    assert [run for run in runs if fault(run)] == []
    assert {run["command"] for run in runs if run["code"] == 7} >= {"show", "resume", "grow", "fit", "merge"}


def fault(run: dict[str, Any]) -> str:
    """What is wrong with how a command ended of which a call failed; "" where nothing is."""
    if run["code"] not in (0, 7):
        return f"exit code {run['code']}"
    if run["code"] == 7 and run["err"].count("qinit: ") != 1:
        return "no single sentence"
    for word in ("damaged", "Traceback", "fault of qinit"):
        if word in run["err"]:
            return word
    if run["lost"]:
        return "something is gone, another than before, or set aside"
    return "" if run.get("same", True) else "the same command does not end with the same content"
