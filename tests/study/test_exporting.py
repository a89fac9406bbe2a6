"""`qinit study export`: the plain commands make what `qinit study run` makes, and are quoted for what reads them."""

from __future__ import annotations

import json
import os
import shlex
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from qinit_store.reading import describe

TEXT = """\
[study]
title = "What's $HOME {in} it? # all"

[[distribution]]
family = "gridworld"
size = 5
variance = 2
sources = { tasks = 4, episodes = 60 }
targets = { tasks = 3, episodes = 20 }

[[method]]
name = ["zero", "mean"]
"""
Here = Callable[..., Any]


@pytest.fixture
def study(tmp_path: Path) -> Path:
    (tmp_path / "study.toml").write_text(TEXT)
    return tmp_path / "study.toml"


def test_the_exported_makefile_makes_the_same_hashes(here: Here, study: Path, tmp_path: Path) -> None:
    assert here("study", "export", study, "-o", "Makefile").out == "Makefile\n"
    path = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
    made = subprocess.run(
        ["make", "-j2"], cwd=tmp_path, env={**os.environ, "PATH": path}, capture_output=True, text=True
    )
    assert made.returncode == 0, made.stderr
    assert here("study", "run", study, "-o", "out", "-q").code == 0
    told = json.loads((tmp_path / "out" / "study.json").read_text())
    files = [
        file for kind in ("sources", "fits", "runs") for file in (tmp_path / "results" / kind).glob("*.h5")
    ]
    assert sorted(describe(file).content_sha256 for file in files) == sorted(
        one["content_sha256"] for one in told["artefacts"]
    )
    assert "What&#39;s $HOME {in} it? # all" in (tmp_path / "results" / "report.html").read_text()
    rows = (tmp_path / "results" / "tables" / "compare.csv").read_text().splitlines()
    assert len(rows) == 3


def test_every_form_holds_each_word_as_it_is(here: Here, study: Path) -> None:
    title = "What's $HOME {in} it? # all"
    shell = here("study", "export", study, "--to", "sh").out.splitlines()
    assert title in shlex.split(shell[-1])
    make = here("study", "export", study, "--to", "make").out.splitlines()
    assert title in shlex.split(make[-1].replace("$$", "$"))
    assert "$$HOME" in make[-1]
    snake = here("study", "export", study, "--to", "snakemake").out
    assert "$HOME {{in}} it? # all" in snake


def test_jobs_wait_for_the_shares_and_what_they_read(here: Here, study: Path) -> None:
    text = here("study", "export", study, "--to", "sbatch", "--shards", 3, "--time", "5").out
    submitted = [shlex.split(line) for line in text.splitlines() if "$(submit" in line]
    assert "--array=1-3" in text
    assert '--shard "$SLURM_ARRAY_TASK_ID"/3' in text
    assert '--dependency="afterok:$shares" --wrap' in text
    assert '--dependency="afterok:$job_2" --wrap' in text
    assert (
        len(submitted) == 1 + 1 + 1 + 2 + 3 + 1
    )  # shares, their joining, fit, runs, pictures and table, report


def test_what_a_form_cannot_use_is_refused(here: Here, study: Path, tmp_path: Path) -> None:
    ended = here("study", "export", study, "--to", "make", "--shards", 3)
    assert (ended.code, ended.out) == (2, "")
    assert "--shards is for jobs of Slurm" in ended.err
    assert here("study", "export", study, "-o", "commands").code == 2
    (tmp_path / "Makefile").write_text("mine")
    assert here("study", "export", study, "-o", "Makefile").code == 4
    assert (tmp_path / "Makefile").read_text() == "mine"
