"""No file of the current folder is run: not by the command, not by the interpreters that it starts."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from qinit_store.interpreter import isolated

# what Python has imported before qinit begins is left out: that PYTHONPATH can replace it is its own doing
NAMES = ("h5py", "json", "numpy", "qinit_store", "resource", "signal", "store", "typer")


def set_traps(folder: Path) -> None:
    """Modules that end whoever imports them."""
    folder.mkdir(exist_ok=True)
    for name in NAMES:
        (folder / f"{name}.py").write_text("raise SystemExit(99)\n")


def test_verify_runs_no_file_of_the_current_folder_nor_of_pythonpath(
    here: Callable[..., Any], pipeline: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    set_traps(tmp_path)
    set_traps(tmp_path / "lib")
    monkeypatch.setenv("PYTHONPATH", f":{tmp_path / 'lib'}")
    ended = here("verify", pipeline.sources)
    assert ended.code == 0, ended.out


def test_a_child_finds_the_packages_where_its_parent_found_them_and_last(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    set_traps(tmp_path / "lib")
    (tmp_path / "lib" / "only_here.py").touch()
    (tmp_path / "lib" / "package").mkdir()
    (tmp_path / "lib" / "package" / "__init__.py").write_text("found = 'yes'")
    monkeypatch.syspath_prepend(tmp_path / "lib")
    program = "import package, json, sys; print(json.dumps([package.found, *sys.argv[1:]]))"
    command = isolated(program, ("package",), "a b")
    assert subprocess.run(command, capture_output=True, text=True, check=True).stdout == '["yes", "a b"]\n'
    with pytest.raises(ModuleNotFoundError, match="nowhere_at_all"):
        isolated("pass", ("nowhere_at_all",))


def ended_in(folder: Path, command: list[str], **variables: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        command, cwd=folder, capture_output=True, text=True, timeout=120, env=os.environ | variables
    )


def test_as_a_module_and_as_a_script_qinit_imports_nothing_from_the_current_folder(tmp_path: Path) -> None:
    set_traps(tmp_path)
    script = str(Path(sys.executable).with_name("qinit"))
    listed = ["list", "--store", "empty", "--format", "json"]
    for command, variables in (
        ([sys.executable, "-m", "qinit_cli", *listed], {}),
        ([script, *listed], {"PYTHONPATH": os.pathsep}),
        ([script, *listed], {"PYTHONPATH": f"{os.pathsep}{tmp_path / 'other'}"}),
    ):
        ended = ended_in(tmp_path, command, **variables)
        assert ended.returncode == 0, (command, variables, ended.stderr)
        assert '"rows": []' in ended.stdout


def test_a_module_named_store_on_pythonpath_is_no_part_of_qinit(tmp_path: Path, pipeline: Any) -> None:
    (tmp_path / "lib").mkdir()
    (tmp_path / "lib" / "store.py").write_text("raise SystemExit(99)\n")
    script = str(Path(sys.executable).with_name("qinit"))
    ended = ended_in(tmp_path, [script, "verify", str(pipeline.sources)], PYTHONPATH=str(tmp_path / "lib"))
    assert ended.returncode == 0, ended.stderr
