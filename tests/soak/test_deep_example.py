"""The example for deep agents, at a small size: a DQN with a start reaches the flag earlier than one from scratch."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

pytestmark = pytest.mark.soak

ROOT = Path(__file__).parents[2]
SOURCES = ("--noise", "0.005", "--reward", "step", "--tasks", "20", "--episodes", "100000")
MARGIN = 25.0  # steps, of the 200 after which an episode is cut off


def test_a_dqn_with_a_start_is_ahead_of_one_from_scratch(tmp_path: Path) -> None:
    pytest.importorskip(
        "stable_baselines3", reason="stable-baselines3 is not installed here; docs/deep.md has how"
    )
    shutil.copytree(ROOT / "examples" / "deep", tmp_path, dirs_exist_ok=True)
    bin_folder = Path(sys.executable).parent
    environment = os.environ | {"PATH": os.pathsep.join([str(bin_folder), os.environ["PATH"]])}

    def told(*words: str) -> str:
        ended = subprocess.run(
            words, cwd=tmp_path, env=environment, capture_output=True, text=True, check=False
        )
        assert ended.returncode == 0, ended.stderr
        return ended.stdout

    told("qinit", "train-sources", "mountain-car", *SOURCES, "-o", "sources.h5")
    told("qinit", "fit", "sources.h5", "-o", "fit.h5")
    told("qinit", "start", "logqinit-median", "fit.h5", "-o", "start.npz")
    alone, names, *rows = told(
        sys.executable, "dqn.py", "start.npz", "--seeds", "3", "--steps", "3000"
    ).splitlines()
    assert names.split("\t") == ["steps", "scratch", "regression", "prior"]
    means = [[float(cell.split()[0]) for cell in row.split("\t")] for row in rows]
    assert [row[0] for row in means] == [1000, 2000, 3000]
    assert float(alone.split()[-3]) > -150  # -121 measured
    for _, scratch, regression, prior in means:
        assert regression > scratch + MARGIN  # by 45 to 51 measured
        assert prior > scratch + MARGIN  # by 50 to 69 measured
