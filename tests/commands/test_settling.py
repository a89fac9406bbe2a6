"""Make comes to rest: what is found complete is as new as now, so that nothing is made for ever."""

from __future__ import annotations

import errno
import os
import subprocess
from pathlib import Path
from typing import Any

import pytest
from ready import Ready

LONG_AGO = 1_000_000_000
MAKEFILE = """
fit.h5: sources.h5
\tqinit fit sources.h5 -o fit.h5 -q
sources.h5: settings
\tqinit train-sources gridworld --size 4 --tasks 3 --learner exact -o sources.h5 -q
"""


def _stages(pipeline: Any, folder: Path) -> dict[str, tuple[Any, ...]]:
    small = ("train-sources", "gridworld", "--size", 4, "--tasks", 12, "--learner", "exact")
    sources = folder / "sources.h5"
    few = ("--tasks", 2, "--episodes", 5)
    return {
        "train-sources": (*small, "-o", sources),
        "fit": ("fit", sources, "-o", folder / "fit.h5"),
        "transfer": ("transfer", "mean", folder / "fit.h5", *few, "-o", folder / "run.h5"),
        "lifelong": ("lifelong", "mean", folder / "fit.h5", *few, "--update", "-o", folder / "life.h5"),
        "tune": ("tune", "ucoi", sources, "--kappa", "1,3", "--episodes", 5, "-o", folder / "tuning.h5"),
        "salvage": ("salvage", sources, "-o", folder / "salvaged.h5"),
        "plot": ("plot", "heatmaps", folder / "fit.h5", "-o", folder / "map.svg"),
        "export": ("export", sources, "--to", "json", "-o", folder / "sources.json"),
        "report": ("report", folder / "fit.h5", "-o", folder / "page.html"),
    }


def test_whatever_is_found_complete_or_made_alike_is_as_new_as_now(
    here: Any, pipeline: Any, tmp_path: Path
) -> None:
    for stage, words in _stages(pipeline, tmp_path).items():
        made = here(*words, "-q")
        assert made.code == 0, (stage, made.err)
        target = Path(words[words.index("-o") + 1])
        os.utime(target, (LONG_AGO, LONG_AGO))
        content = target.read_bytes()
        again = here(*words, "-q", *(("--force",) if stage == "export" else ()))
        assert again.code == 0, (stage, again.err)
        assert target.stat().st_mtime > LONG_AGO, stage
        if target.suffix == ".h5":
            assert target.read_bytes() == content, stage


@pytest.mark.parametrize("number", [errno.EPERM, errno.EACCES, errno.EROFS])
def test_a_file_whose_time_may_not_be_set_is_complete_all_the_same(
    number: int, here: Any, pipeline: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    words = ("fit", pipeline.sources, "-o", tmp_path / "fit.h5")
    assert here(*words, "-q").code == 0

    def refuse(*_: Any, **__: Any) -> None:
        raise OSError(number, os.strerror(number))

    monkeypatch.setattr("qinit_store.disk.os.utime", refuse)
    ended = here(*words)
    assert (ended.code, "already complete" in ended.err) == (0, True)


def test_make_has_nothing_to_do_the_second_time(tmp_path: Path, ready: Ready) -> None:
    (tmp_path / "Makefile").write_text(MAKEFILE)
    (tmp_path / "settings").touch()

    def make() -> str:
        path = {**os.environ, "PATH": f"{ready.folder}{os.pathsep}{os.environ['PATH']}"}
        ended = subprocess.run(["make"], cwd=tmp_path, env=path, capture_output=True, text=True, timeout=120)
        assert ended.returncode == 0, ended.stderr
        return ended.stdout

    make()
    os.utime(tmp_path / "fit.h5", (LONG_AGO, LONG_AGO))
    os.utime(tmp_path / "sources.h5", (LONG_AGO + 1, LONG_AGO + 1))
    os.utime(tmp_path / "settings", (LONG_AGO + 2, LONG_AGO + 2))
    assert "qinit fit" in make()
    assert "up to date" in make()
