"""Every registered kind is known wherever kinds are told apart."""

from __future__ import annotations

from pathlib import Path

import pytest
from running import run_here

from qinit_cli.artefacts.kind import Kind
from qinit_cli.artefacts.kinds import KINDS
from qinit_store.kinds import REGISTERED, folder_of

ROOT = Path(__file__).parents[2]
EVERY = [pytest.param(kind, id=name) for name, kind in KINDS.items()]


@pytest.mark.parametrize("kind", EVERY)
def test_the_store_knows_the_kind_its_folder_and_what_makes_it(kind: Kind) -> None:
    assert folder_of(kind.name) == kind.folder
    assert REGISTERED[kind.name].maker == kind.maker


def test_no_two_kinds_share_a_folder_or_a_name() -> None:
    assert len({kind.folder for kind in KINDS.values()}) == len(KINDS)
    assert all(name == kind.name for name, kind in KINDS.items())


@pytest.mark.parametrize("kind", EVERY)
def test_a_command_makes_the_kind(kind: Kind) -> None:
    assert run_here([kind.maker, "-h"]).code == 0


def test_list_takes_every_kind() -> None:
    told = run_here(["list", "-h"]).out
    assert all(name in told for name in KINDS)


def test_export_tells_of_every_table() -> None:
    told = " ".join(run_here(["export", "-h"]).out.replace("│", " ").split())
    assert [table for kind in KINDS.values() for table in kind.tables if table not in told] == []


@pytest.mark.parametrize("kind", EVERY)
def test_the_manual_tells_of_the_kind(kind: Kind) -> None:
    pages = "".join(path.read_text() for path in [ROOT / "README.md", *(ROOT / "docs").glob("*.md")])
    assert f"qinit {kind.maker}" in pages
    assert [table for table in kind.tables if table not in pages] == []


@pytest.mark.parametrize("kind", EVERY)
def test_settings_of_another_kind_are_refused(kind: Kind) -> None:
    with pytest.raises(ValueError, match="its settings are of 'another', the artefact is of"):
        kind.check({"kind": "another"})
