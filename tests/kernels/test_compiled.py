"""Where machine code is kept between runs."""

from __future__ import annotations

import errno
import importlib
import os
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from qinit_cli.errors import NotAllowed
from qinit_cli.kernels import compiled, private_numba


@pytest.fixture
def afresh(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    compiled.cache_folder.cache_clear()
    monkeypatch.setattr(compiled, "_reported", [])
    monkeypatch.setattr(compiled, "_full", set())
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


def test_compiling_is_heard_once_and_code_that_was_kept_is_silent(tmp_path: Path) -> None:
    (tmp_path / "kernel.py").write_text(
        "from qinit_cli.kernels.compiled import lean\n@lean\ndef twice(x):\n    return 2 * x\n"
    )
    code = (
        "from qinit_cli.kernels.compiled import heard\n"
        "from kernel import twice\n"
        "with heard(print):\n    twice(1), twice(2)\n    print('then'), twice(1.5)\n"
        "twice(1j)"
    )
    environment = os.environ | {"NUMBA_CACHE_DIR": str(tmp_path / "cache"), "PYTHONPATH": str(tmp_path)}
    told = [
        subprocess.run(
            [sys.executable, "-c", code], env=environment, capture_output=True, text=True, check=True
        ).stdout.split()
        for _ in range(2)
    ]
    assert told == [["kernel", "then", "kernel"], ["then"]]


def test_numba_does_not_import_scipys_linear_algebra_before_something_needs_it() -> None:
    code = """
import sys
import numba
import numpy as np
from qinit_cli.kernels import gridworld_exact

moves, none = np.zeros((9, 4), np.int32), np.empty((0, 1))
gridworld_exact.solve(moves, none.astype(int), none, 0.9, 1e-9, np.empty((0, 9, 4)), np.empty((0, 9, 4)))
before = "scipy.linalg" in sys.modules
table = np.arange(6.0).reshape(2, 3) ** 2
covariance = numba.njit(lambda table: np.cov(table))(table)
print(before, "scipy.linalg" in sys.modules, np.allclose(covariance, np.cov(table)))
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.split() == ["False", "True", "True"]


def _by_all(place: Path) -> None:
    place.chmod(0o777)


def _by_the_group(place: Path) -> None:
    place.chmod(0o770)


def _of_another(place: Path) -> None:
    os.lchown(place, 4711, 4711)


def _linked(place: Path) -> None:
    aside = place.with_name("aside")
    place.rename(aside)
    place.symlink_to(aside)


root_only = pytest.mark.skipif(os.geteuid() != 0, reason="only root can give files away")


@pytest.mark.usefixtures("afresh")
@pytest.mark.parametrize("spoil", [_by_all, _by_the_group, pytest.param(_of_another, marks=root_only)])
@pytest.mark.parametrize("which", ["kernels", "qinit", "chosen", "above"])
def test_a_folder_that_others_may_write_or_replace_is_not_used_and_named_once(
    which: str,
    spoil: Any,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path / "above" / "chosen"))
    kernels = compiled.cache_folder()
    assert kernels is not None
    place = {"kernels": kernels, "qinit": kernels.parent, **{p.name: p for p in kernels.parents[1:3]}}[which]
    spoil(place)
    for _ in range(2):
        compiled.cache_folder.cache_clear()
        assert compiled.cache_folder() is None
    [line] = capsys.readouterr().err.splitlines()
    assert str(place) in line
    assert line.endswith("or set NUMBA_CACHE_DIR to a folder of your own")
    assert compiled.cache_statement() == line


@pytest.mark.usefixtures("afresh")
def test_a_folder_beneath_one_like_tmp_is_used_for_nobody_can_move_it_there(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    tmp_path.chmod(0o1777)
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path))
    assert compiled.cache_folder() is not None


@pytest.mark.usefixtures("afresh")
def test_what_is_made_for_machine_code_is_for_its_owner_alone(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path / "above" / "chosen"))
    folder = compiled.cache_folder()
    assert folder is not None
    assert {place.stat().st_mode & 0o777 for place in (folder, *folder.parents[:3])} == {0o700}


@pytest.mark.usefixtures("afresh")
@pytest.mark.parametrize(
    "plant",
    [pytest.param(_of_another, marks=root_only), lambda file: (file.unlink(), os.mkfifo(file)), _linked],
)
def test_a_folder_with_a_file_that_is_not_ours_or_no_file_is_not_used(
    plant: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path))
    folder = compiled.cache_folder()
    assert folder is not None
    (folder / "kernels_1").mkdir()
    (folder / "kernels_1" / "code.nbi").write_bytes(b"machine code")
    compiled.cache_folder.cache_clear()
    assert compiled.cache_folder() == folder
    plant(folder / "kernels_1" / "code.nbi")
    compiled.cache_folder.cache_clear()
    assert compiled.cache_folder() is None
    assert "code.nbi" in capsys.readouterr().err


@pytest.mark.usefixtures("afresh")
def test_a_linked_folder_is_not_used_but_a_link_of_ours_above_it_is_followed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "scratch").mkdir()
    (tmp_path / "cache").symlink_to("scratch")
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path / "cache"))
    folder = compiled.cache_folder()
    assert folder is not None
    assert folder.parent == tmp_path / "scratch" / "qinit"
    _linked(folder)
    compiled.cache_folder.cache_clear()
    assert compiled.cache_folder() is None


@pytest.mark.usefixtures("afresh")
@pytest.mark.parametrize("number", [errno.ENOSPC, errno.EDQUOT, errno.EROFS, errno.EIO])
@pytest.mark.parametrize("broken", ["_open_for_write", "_load_index"])
def test_machine_code_that_cannot_be_saved_or_read_is_compiled_and_the_folder_named_once(
    broken: str,
    number: int,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path / "cache"))
    monkeypatch.syspath_prepend(str(tmp_path))
    (tmp_path / "doubling.py").write_text("def double(number):\n    return 2 * number\n")
    monkeypatch.delitem(sys.modules, "doubling", raising=False)
    double = compiled.compiled(importlib.import_module("doubling").double)

    def failing(*arguments: Any) -> Any:
        raise OSError(number, os.strerror(number))

    monkeypatch.setattr(double._cache._cache_file, broken, failing)
    assert (double(2), double(1.5)) == (4, 3.0)
    [line] = capsys.readouterr().err.splitlines()
    assert str(tmp_path / "cache") in line
    assert os.strerror(number) in line


@pytest.mark.usefixtures("afresh")
def test_an_index_cut_off_by_a_full_disk_or_a_power_cut_is_compiled_over(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path / "cache"))
    monkeypatch.syspath_prepend(str(tmp_path))
    (tmp_path / "tripling.py").write_text("def triple(number):\n    return 3 * number\n")
    triple = importlib.import_module("tripling").triple
    first = compiled.compiled(triple)
    assert first(2) == 6
    Path(first._cache._cache_file._index_path).write_bytes(b"")
    assert compiled.compiled(triple)(2) == 6
    assert len(capsys.readouterr().err.splitlines()) == 1


@pytest.mark.usefixtures("afresh")
def test_machine_code_is_never_kept_in_a_folder_of_numbas_choice(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path / "cache"))
    monkeypatch.syspath_prepend(str(tmp_path))
    (tmp_path / "halving.py").write_text("def halve(number):\n    return number / 2\n")
    halve = importlib.import_module("halving").halve
    folder = compiled.cache_folder("halving")
    assert folder is not None
    folder.rmdir()
    folder.touch()  # as on a disk without room for a folder; Numba would go on to __pycache__
    assert compiled.compiled(halve).stats.cache_path is None


@pytest.mark.usefixtures("afresh")
def test_what_a_version_of_numba_lacks_is_done_without(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path / "cache"))
    monkeypatch.syspath_prepend(str(tmp_path))
    (tmp_path / "halving.py").write_text("def halve(number):\n    return number / 2\n")
    monkeypatch.setattr(private_numba, "_taken_options", lambda: frozenset({"_nrt"}))
    monkeypatch.setattr(private_numba, "keeps", lambda made: False)
    halve = compiled.inner(importlib.import_module("halving").halve)
    assert not {"no_cpython_wrapper", "no_cfunc_wrapper"} & halve.targetoptions.keys()
    assert "keeps machine code otherwise than is known here" in capsys.readouterr().err
    assert not [path for path in (tmp_path / "cache").rglob("*") if path.suffix in (".nbi", ".nbc")]


def test_a_version_of_numba_that_must_count_references_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(private_numba, "_taken_options", frozenset)
    with pytest.raises(NotAllowed, match="has no option _nrt, without which kernels are not safe"):
        compiled.lean(lambda number: number)
