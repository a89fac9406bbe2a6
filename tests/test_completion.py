"""Names of artefacts completed without typer are those that typer completes."""

from __future__ import annotations

import io
import os
from pathlib import Path

import pytest

from qinit_cli import completion
from qinit_cli.app import run
from qinit_cli.artefacts.kinds import KINDS


@pytest.fixture
def store(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Three names that begin alike in two folders, and what is no finished artefact."""
    monkeypatch.chdir(tmp_path)
    for name in (
        "sources/grid-2.h5",
        "sources/grid-10.h5",
        "runs/grid-3.h5",
        "runs/.grid-4.h5",
        "fits/grid.txt",
    ):
        path = tmp_path / "qinit-store" / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.touch()
    return tmp_path / "qinit-store"


def _ask(monkeypatch: pytest.MonkeyPatch, line: str, at: int) -> None:
    asked = {"_QINIT_COMPLETE": "complete_bash", "COMP_WORDS": line, "COMP_CWORD": str(at)}
    for name, value in asked.items():
        monkeypatch.setenv(name, value)


def _by_typer(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    monkeypatch.setattr("sys.stdout", offered := io.StringIO())
    with pytest.raises(SystemExit):
        run([])
    return offered.getvalue().split()


def test_the_folders_are_those_of_the_kinds() -> None:
    assert set(completion.FOLDERS) == {kind.folder for kind in KINDS.values()}


@pytest.mark.usefixtures("store")
@pytest.mark.parametrize("command", sorted(completion.ONE | completion.SEVERAL))
def test_each_command_completes_as_typer_does(command: str, monkeypatch: pytest.MonkeyPatch) -> None:
    for begun, expected in (("", ["grid-10", "grid-2", "grid-3"]), ("grid-1", ["grid-10"]), ("x", [])):
        _ask(monkeypatch, f"qinit {command} {begun}", 2)
        assert completion.names() == expected
        assert _by_typer(monkeypatch) == expected


@pytest.mark.usefixtures("store")
@pytest.mark.parametrize("command", sorted(completion.SEVERAL))
def test_a_further_argument_completes_as_typer_does(command: str, monkeypatch: pytest.MonkeyPatch) -> None:
    _ask(monkeypatch, f"qinit {command} grid-2 grid-1", 3)
    assert completion.names() == _by_typer(monkeypatch) == ["grid-10"]


@pytest.mark.usefixtures("store")
@pytest.mark.parametrize(
    ("line", "at"),
    [
        ("qinit sh", 1),
        ("qinit show --", 2),
        ("qinit show --store elsewhere ", 4),
        ("qinit show grid-2 ", 3),
        ("qinit plot curves ", 3),
        ("qinit show 'gr", 2),
        ("qinit show grid-2 --json", 2),
    ],
)
def test_any_other_line_is_left_to_typer(line: str, at: int, monkeypatch: pytest.MonkeyPatch) -> None:
    _ask(monkeypatch, line, at)
    assert completion.names() is None


@pytest.mark.usefixtures("store")
def test_a_configured_store_is_left_to_typer(monkeypatch: pytest.MonkeyPatch) -> None:
    _ask(monkeypatch, "qinit show ", 2)
    assert completion.names() is not None
    Path("qinit.toml").write_text('store = "elsewhere"\n')
    assert completion.names() is None


def test_a_store_named_by_its_variable_is_listed(store: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    os.rename(store, store.with_name("other"))
    _ask(monkeypatch, "qinit show ", 2)
    assert completion.names() == []
    monkeypatch.setenv("QINIT_STORE", "other")
    assert completion.names() == _by_typer(monkeypatch) == ["grid-10", "grid-2", "grid-3"]
