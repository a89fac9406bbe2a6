"""The oldest and the newest Numba that pyproject.toml allows compile the kernels to the same bits."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

pytestmark = pytest.mark.soak

ROOT = Path(__file__).parents[2]
TESTS = (  # pinned hashes of tables, and the plain loops that gridworlds, cars and hypotheses are compared with
    "tests/kernels/test_table_hashes.py",
    "tests/kernels/test_gridworld_learning.py",
    "tests/kernels/test_mountain_car_learning.py",
    "tests/kernels/test_posterior.py",
)


def allowed() -> dict[str, str]:
    """What to ask pip for: the oldest minor version, and the newest of all."""
    [(low, high)] = re.findall(r'"numba>=([\d.]+),<([\d.]+)"', (ROOT / "pyproject.toml").read_text())
    return {"oldest": f"numba=={low}.*", "newest": f"numba<{high}"}


@pytest.mark.parametrize("which", ["oldest", "newest"])
def test_kernels_are_compiled_to_the_same_bits(which: str, tmp_path: Path) -> None:
    python = tmp_path / "venv" / "bin" / "python"
    subprocess.run([sys.executable, "-m", "venv", python.parents[1]], check=True)
    install = [
        python,
        "-m",
        "pip",
        "install",
        "--quiet",
        "--upgrade",
        "--editable",
        f"{ROOT}[gym]",
        allowed()[which],
        "pytest",
    ]
    subprocess.run(install, check=True)
    told = subprocess.run(
        [python, "-c", "import numba; print(numba.__version__)"], check=True, capture_output=True, text=True
    ).stdout.strip()
    assert which == "newest" or allowed()["oldest"].startswith(f"numba=={told.rpartition('.')[0]}")
    ended = subprocess.run(
        [python, "-m", "pytest", "-q", "-p", "no:cacheprovider", *TESTS],
        cwd=ROOT,
        env=os.environ | {"NUMBA_CACHE_DIR": str(tmp_path / "cache")},
        capture_output=True,
        text=True,
        check=False,
    )
    assert ended.returncode == 0, f"Numba {told}: {ended.stdout[-3000:]}"
