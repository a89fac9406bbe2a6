"""Whole commands that find no machine code: two at once, who fill one cache folder, learn what one alone learns."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from qinit_store.reading import describe

pytestmark = pytest.mark.soak

QINIT = Path(sys.executable).with_name("qinit")


def started(store: Path, cache: Path, *words: str) -> subprocess.Popen[str]:
    return subprocess.Popen(
        [QINIT, *words, "--quiet", "--store", str(store)],
        stdout=subprocess.PIPE,
        text=True,
        env=os.environ | {"NUMBA_CACHE_DIR": str(cache)},
    )


def content(process: subprocess.Popen[str]) -> str:
    """The hash of what the command made."""
    out, _ = process.communicate(timeout=300)
    assert process.returncode == 0
    return describe(Path(out.strip())).content_sha256


@pytest.mark.parametrize(
    "family",
    [
        ("gridworld", "--size", "8", "--tasks", "6", "--episodes", "300"),
        ("mountain-car", "--bins", "6", "--tasks", "10", "--episodes", "60"),
    ],
    ids=["gridworld", "mountain-car"],
)
def test_two_commands_that_compile_at_once_learn_what_one_alone_learns(
    family: tuple[str, ...], tmp_path: Path
) -> None:
    together = [
        started(tmp_path / f"store-{place}", tmp_path / "shared", "train-sources", *family)
        for place in range(2)
    ]
    first, second = [content(process) for process in together]
    alone = content(started(tmp_path / "alone", tmp_path / "own", "train-sources", *family))
    warm = content(started(tmp_path / "warm", tmp_path / "shared", "train-sources", *family))
    assert first == second == alone == warm
