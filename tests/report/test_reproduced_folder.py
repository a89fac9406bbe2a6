"""A page of a reproduction's folder, and folders that are not as they were made."""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

Run = Callable[..., Any]


@pytest.fixture
def folder(reproduction: Path, tmp_path: Path) -> Path:
    """A reproduction that may be spoiled."""
    copy: Path = shutil.copytree(reproduction, tmp_path / "reproduction")
    return copy


def changed(folder: Path, **entries: Any) -> None:
    """The folder's manifest with other entries."""
    path = folder / "reproduction.json"
    path.write_text(json.dumps(json.loads(path.read_text()) | entries))


def manifest(folder: Path) -> dict[str, Any]:
    told: dict[str, Any] = json.loads((folder / "reproduction.json").read_text())
    return told


def test_all_that_the_folder_holds_is_in_the_page(here: Run, folder: Path, tmp_path: Path) -> None:
    assert here("report", folder).code == 0
    page = (tmp_path / "report.html").read_text()
    for words in (
        "qinit reproduce fig6",
        "Learning curves",
        "Of lines.",
        "Methods on variance 2",
        "What was found",
    ):
        assert words in page
    for one in manifest(folder)["artefacts"]:
        assert one["content_sha256"] in page
    assert "not complete" not in page


def test_the_folder_may_come_from_stdin(here: Run, folder: Path) -> None:
    assert here("report", "-", stdin=f"{folder}\n").code == 0


def test_an_unfinished_reproduction_says_so(here: Run, folder: Path, tmp_path: Path) -> None:
    changed(folder, complete=False)
    assert here("report", folder).code == 0
    assert "not complete: the same command goes on" in (tmp_path / "report.html").read_text()


def test_artefacts_that_moved_are_found_in_the_store_and_lost_ones_are_named(
    here: Run, folder: Path, pipeline: Any, tmp_path: Path
) -> None:
    made = manifest(folder)["artefacts"]
    elsewhere = [{**one, "path": f"moved/runs/{Path(one['path']).name}"} for one in made]
    changed(folder, artefacts=elsewhere)
    assert here("report", folder, "--store", pipeline.store).code == 0
    assert "cannot be told of" not in (tmp_path / "report.html").read_text()
    assert here("report", folder, "--store", tmp_path / "empty").code == 0
    page = (tmp_path / "report.html").read_text()
    assert "3 artefacts of 3 cannot be told of here" in page
    assert all(one["content_sha256"] in page for one in made)


def test_artefacts_that_are_no_longer_the_same_are_refused(here: Run, folder: Path) -> None:
    first, *rest = manifest(folder)["artefacts"]
    changed(folder, artefacts=[{**first, "content_sha256": "0" * 64}, *rest])
    ended = here("report", folder)
    assert (ended.code, ended.out) == (4, "")
    assert f"{folder} were made of; make it again" in ended.err


@pytest.mark.parametrize(
    "entries",
    [
        {"schema": "another/1"},
        {"artefacts": None},
        {"figures": [{"file": "fig6-a.svg"}]},
        {"seconds": "long"},
        {"verdicts": "../reproduction.json"},
        {"verdicts": "nowhere.json"},
        {"tables": [{"title": "a", "file": "/etc/passwd"}]},
        {"tables": [{"title": "a", "file": "fig6-a.svg"}]},
    ],
)
def test_a_folder_that_is_not_as_it_was_made_is_refused_in_a_sentence(
    here: Run, folder: Path, entries: dict[str, Any]
) -> None:
    changed(folder, **entries)
    ended = here("report", folder)
    assert (ended.code, ended.out) == (4, "")
    assert ended.err.count("\n") == 1
    assert "unexpected" not in ended.err


def test_a_picture_that_could_act_is_refused(here: Run, folder: Path) -> None:
    (folder / "fig6-a.svg").write_text(
        '<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 1 1"><script>alert(1)</script></svg>'
    )
    ended = here("report", folder)
    assert (ended.code, ended.out) == (4, "")
    assert "script" in ended.err


def test_a_folder_without_a_reproduction_tells_what_makes_one(here: Run, tmp_path: Path) -> None:
    ended = here("report", tmp_path)
    assert (ended.code, ended.out) == (2, "")
    assert "qinit reproduce" in ended.err


@pytest.mark.parametrize("more", [("another",), ("--baseline", "mean")])
def test_a_reproduction_stands_alone(here: Run, folder: Path, more: tuple[str, ...]) -> None:
    ended = here("report", folder, *more)
    assert (ended.code, ended.out) == (2, "")
