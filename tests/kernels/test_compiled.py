"""Where machine code is kept between runs."""

from __future__ import annotations

import os
import subprocess
import sys
import time
from pathlib import Path

import pytest

from qinit_cli.kernels import compiled


@pytest.fixture
def afresh() -> None:
    compiled.cache_folder.cache_clear()
    yield
    compiled.cache_folder.cache_clear()


@pytest.mark.usefixtures("afresh")
def test_machine_code_is_kept_beneath_the_folder_the_user_chose(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path / "chosen"))
    folder = compiled.cache_folder()
    assert folder is not None
    assert folder.is_relative_to(tmp_path / "chosen" / "qinit")
    assert compiled.cache_statement() is None
    assert compiled.needs_compiling("gridworld-sources")
    compiled.note_compiled("gridworld-sources")
    assert not compiled.needs_compiling("gridworld-sources")
    assert compiled.needs_compiling("gridworld-targets")


@pytest.mark.usefixtures("afresh")
def test_machine_code_is_else_kept_in_the_users_cache_folder(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.delenv("NUMBA_CACHE_DIR", raising=False)
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    folder = compiled.cache_folder()
    assert folder is not None
    assert folder.parent == tmp_path / "qinit"


@pytest.mark.usefixtures("afresh")
def test_other_kernel_files_mean_another_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path / "cache"))
    folders = set()
    for text in ("one", "two"):
        (tmp_path / "kernel.py").write_text(text)
        monkeypatch.setattr(compiled, "__file__", str(tmp_path / "compiled.py"))
        compiled.cache_folder.cache_clear()
        folders.add(compiled.cache_folder())
    assert len(folders) == 2


@pytest.mark.usefixtures("afresh")
def test_a_folder_that_cannot_be_written_is_told_with_the_remedy(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "file").touch()
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path / "file"))
    assert compiled.cache_folder() is None
    compiled.note_compiled("gridworld-sources")
    assert compiled.needs_compiling("gridworld-sources")
    assert "set NUMBA_CACHE_DIR" in (compiled.cache_statement() or "")


def test_learning_runs_where_nothing_can_be_kept(tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    code = "from qinit_cli.kernels import gridworld_exact as g; print(g.solve.stats.cache_path)"
    environment = os.environ | {"NUMBA_CACHE_DIR": str(tmp_path / "file")}
    done = subprocess.run(
        [sys.executable, "-c", code], env=environment, capture_output=True, text=True, check=True
    )
    assert done.stdout.strip() == "None"


def test_settings_of_learning_are_free_of_numpy_and_numba() -> None:
    code = "import sys, qinit_cli.learning; print({'numpy', 'numba'} & set(sys.modules))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "set()"


@pytest.mark.usefixtures("afresh")
def test_machine_code_that_nobody_used_for_a_month_is_removed_when_a_new_folder_is_made(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path))
    old, recent, foreign = (
        tmp_path / "qinit" / name for name in ("kernels-old", "kernels-recent", "of-another")
    )
    for folder, days in ((old, 31), (recent, 29), (foreign, 400)):
        folder.mkdir(parents=True)
        (folder / "code.nbi").write_bytes(b"machine code")
        used = time.time() - days * 24 * 3600
        os.utime(folder, (used, used))
    chosen = compiled.cache_folder()
    assert set((tmp_path / "qinit").iterdir()) == {chosen, recent, foreign}


@pytest.mark.usefixtures("afresh")
def test_a_folder_that_is_used_is_marked_as_used(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path))
    folder = compiled.cache_folder()
    assert folder is not None
    os.utime(folder, (0, 0))
    compiled.cache_folder.cache_clear()
    assert compiled.cache_folder() == folder
    assert time.time() - folder.stat().st_mtime < 3600


@pytest.mark.usefixtures("afresh")
def test_compiling_is_noted_even_if_the_folder_was_removed_meanwhile(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path))
    folder = compiled.cache_folder()
    assert folder is not None
    folder.rmdir()
    compiled.note_compiled("gridworld-sources")
    assert not compiled.needs_compiling("gridworld-sources")


def test_numba_does_not_import_scipys_linear_algebra_before_something_needs_it() -> None:
    code = """
import sys
import numba
import numpy as np
from qinit_cli.kernels import gridworld_exact

none = np.empty(0)
gridworld_exact.solve(none.astype(int), none, 3, 0.9, 1e-9, np.empty((0, 9, 4)), np.empty((0, 9, 4)))
before = "scipy.linalg" in sys.modules
table = np.arange(6.0).reshape(2, 3) ** 2
covariance = numba.njit(lambda table: np.cov(table))(table)
print(before, "scipy.linalg" in sys.modules, np.allclose(covariance, np.cov(table)))
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.split() == ["False", "True", "True"]
