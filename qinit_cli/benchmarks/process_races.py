"""Whole processes: how long until qinit speaks, and what a pipeline costs beside the learning in it."""

from __future__ import annotations

import json
import os
import subprocess
import tempfile
import time
from collections.abc import Sequence
from statistics import median
from typing import Any

from qinit_cli.benchmarks.race import Race, Result, Runner
from qinit_store.interpreter import isolated

RUN = "from qinit_cli.__main__ import main; main()"
PACKAGES = ("qinit_cli", "qinit_store", "typer", "rich", "numpy", "scipy", "h5py", "numba")


def start_up() -> Race:
    """`qinit --help` against an interpreter that does nothing."""
    return Race(
        "start-up",
        "qinit --help",
        "ms",
        Runner("qinit", lambda: _once(isolated(RUN, PACKAGES, "--help"))),
        [Runner("bare python", lambda: _once(isolated("pass", ())))],
    )


def pipelines(turns: int, *, quick: bool) -> list[Result]:
    """sources | fit | transfer of the gridworld, exact and learned, each command beside the learning in it; wall time, one job.

    The turn that does not count compiles.
    """
    few = ["--tasks", "8"] if quick else []
    short = [*few, "--episodes", "200"] if quick else []
    found: list[Result] = []
    for learner in ("exact", "q-learning"):
        sources = [
            "train-sources",
            "gridworld",
            "--learner",
            learner,
            *(few if learner == "exact" else short),
        ]
        commands = [sources, ["fit", "-"], ["transfer", "logqinit-median", "-", *short]]
        found += _pipeline(learner, commands, turns)
    return found


def _pipeline(learner: str, commands: Sequence[Sequence[str]], turns: int) -> list[Result]:
    taken: list[list[tuple[float, float]]] = [[] for _ in commands]
    for turn in range(1 + turns):
        with tempfile.TemporaryDirectory() as store:
            reference = ""
            for command, seconds in zip(commands, taken, strict=True):
                jobs = [] if command[0] == "fit" else ["--jobs", "1"]
                whole, told = _told([*command, *jobs, "--store", store], reference)
                reference = str(told["path"])
                if turn > 0:
                    seconds.append((whole, float(told["seconds"])))
    return [
        _result(f"{command[0]}, {learner}", seconds) for command, seconds in zip(commands, taken, strict=True)
    ]


def _result(case: str, seconds: Sequence[tuple[float, float]]) -> Result:
    shares = [learning / whole for whole, learning in seconds]
    return Result(
        what="pipeline",
        case=case,
        unit="ms",
        other="the learning in it",
        ours_figure=1e3 * median(whole for whole, _ in seconds),
        other_figure=1e3 * median(learning for _, learning in seconds),
        ratio=median(shares),
        ratio_low=min(shares),
        ratio_high=max(shares),
        turns=len(seconds),
    )


def _told(arguments: Sequence[str], stdin: str) -> tuple[float, dict[str, Any]]:
    """Wall seconds of a command, and the object it prints."""
    began = time.perf_counter()
    ended = _run(isolated(RUN, PACKAGES, *arguments, "--json", "--quiet"), stdin)
    return time.perf_counter() - began, json.loads(ended)


def _once(command: Sequence[str]) -> float:
    _run(command)
    return 1.0


def _run(command: Sequence[str], stdin: str = "") -> str:
    """What the command prints, run where no settings of the user's are: they would change what is timed."""
    kept = {name: value for name, value in os.environ.items() if not name.startswith("QINIT_")}
    with tempfile.TemporaryDirectory() as nowhere:
        return subprocess.run(
            command,
            input=stdin,
            stdout=subprocess.PIPE,
            text=True,
            check=True,
            cwd=nowhere,
            env=kept | {"XDG_CONFIG_HOME": nowhere},
        ).stdout
