"""Damage is named by verify, mended by salvage as far as it goes, and read by no command as numbers."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import h5py
import pytest
from running import Ended, Pipeline

from qinit_store.reading import describe, open_artefact


@pytest.fixture
def damaged(pipeline: Any, tmp_path: Path) -> dict[str, Path]:
    """Copies of sources, fit and run with one number changed in each: in task 2, in the fit, in target 1."""
    given = {"sources": pipeline.sources, "fit": pipeline.fit, "run": pipeline.runs["zero"]}
    places = {"sources": ("q", (2, 0, 0, 0)), "fit": ("mu", (0, 0, 0)), "run": ("steps", (1, 3))}
    for kind, path in given.items():
        name, where = places[kind]
        shutil.copy(path, tmp_path / f"{kind}.h5")
        with h5py.File(tmp_path / f"{kind}.h5", "r+", libver=("v110", "v110")) as file:
            file[name][where] = file[name][where] + 1
    return {kind: tmp_path / f"{kind}.h5" for kind in given}


def test_sound_artefacts_are_told_with_their_content_hash(here: Callable[..., Any], pipeline: Any) -> None:
    paths = [pipeline.sources, pipeline.fit, *pipeline.runs.values()][:3]
    ended = here("verify", *paths, "--format", "json")
    assert ended.code == 0
    rows = ended.json["rows"]
    assert [row["state"] for row in rows] == ["sound"] * 3
    assert [row["kind"] for row in rows] == ["sources", "fit", "run"]
    assert [row["detail"] for row in rows] == [describe(path).content_sha256 for path in paths]


def test_damaged_tasks_are_named_and_the_others_are_still_examined(
    here: Callable[..., Any], damaged: dict[str, Path], pipeline: Any
) -> None:
    ended = here("verify", "-", "--format", "json", stdin=f"{damaged['sources']}\n{pipeline.fit}\n")
    assert ended.code == 6
    first, second = ended.json["rows"]
    assert (first["state"], first["damaged_tasks"]) == ("damaged", "2")
    assert second["state"] == "sound"
    [sentence] = ended.err.splitlines()
    assert f"1 of 4 tasks do not hold (2); `qinit salvage {damaged['sources']}` keeps the others" in sentence


@pytest.mark.parametrize("name", ["q", "solved"])
@pytest.mark.parametrize("how", [[], ["--dry-run"], ["--holdout", "3"]], ids=["fit", "dry", "too-few"])
def test_no_fit_is_told_of_damaged_sources(
    here: Callable[..., Any], pipeline: Any, tmp_path: Path, name: str, how: list[str]
) -> None:
    shutil.copy(pipeline.sources, tmp_path / "a.h5")
    assert here("fit", "a.h5", "-o", "f.h5").code == 0
    with h5py.File(tmp_path / "a.h5", "r+", libver=("v110", "v110")) as file:
        file[name][2] = 1 - file[name][2]
    for target in ("f.h5", "g.h5"):  # one that is there already, and a new one
        ended = here("fit", "a.h5", "-o", target, *how)
        assert ended.code == 6
        assert "the digest of task 2 does not hold" in ended.err
    assert not (tmp_path / "g.h5").exists()


@pytest.mark.parametrize("content", [b"", b"a letter", b"\x89HDF\r\n\x1a\n" + bytes(200)])
def test_what_is_no_artefact_is_refused_with_6(
    here: Callable[..., Any], tmp_path: Path, content: bytes
) -> None:
    (tmp_path / "a.h5").write_bytes(content)
    ended = here("verify", "a.h5")
    assert ended.code == 6
    assert "Traceback" not in ended.err


def test_verifying_what_is_not_there_is_a_mistake_of_the_caller(here: Callable[..., Any]) -> None:
    assert here("verify", "nothing.h5").code == 2


READERS = {
    "fit": ("sources", ("fit", "{}", "-o", "made.h5")),
    "transfer": ("fit", ("transfer", "zero", "{}", "-o", "made.h5", "--tasks", "2", "--episodes", "5")),
    "compare": ("run", ("compare", "{}", "{other}")),
    "plot curves": ("run", ("plot", "curves", "{}", "-o", "made.png")),
    "plot heatmaps": ("fit", ("plot", "heatmaps", "{}", "-o", "made.png")),
    "export": ("sources", ("export", "{}", "--to", "csv", "-o", "made.csv")),
    "merge": ("sources", ("merge", "{}", "{}", "-o", "made.h5")),
}


@pytest.mark.parametrize(("kind", "words"), READERS.values(), ids=READERS)
def test_no_command_uses_a_number_of_a_damaged_input(
    here: Callable[..., Any],
    damaged: dict[str, Path],
    pipeline: Any,
    tmp_path: Path,
    kind: str,
    words: tuple[str, ...],
) -> None:
    other = str(pipeline.runs["maxqinit"])
    ended = here(*(word.replace("{other}", other).replace("{}", str(damaged[kind])) for word in words))
    assert (ended.code, ended.out) == (6, ""), ended.err
    [sentence] = [line for line in ended.err.splitlines() if line.startswith("qinit: ")]
    assert "is damaged" in sentence
    assert "qinit verify" in sentence
    assert not list(tmp_path.glob("*made*"))


def test_salvage_keeps_what_holds_and_the_first_command_completes_it(
    here: Callable[..., Any], damaged: dict[str, Path], pipeline: Any, tmp_path: Path
) -> None:
    ended = here("salvage", damaged["sources"], "-o", "saved.h5")
    assert (ended.code, ended.out) == (0, "saved.h5\n")
    assert "3 tasks kept, 1 lost (2); the command that made it, with -o saved.h5" in ended.err
    with open_artefact(tmp_path / "saved.h5") as saved:
        assert saved.tasks.tolist() == [0, 1, 3]
    words = ("train-sources", "gridworld", "--size", 6, "--tasks", 4, "--episodes", 200, "--variance", 2)
    told = here(*words, "-o", "saved.h5", "--json").json
    assert (told["skipped"], told["digest"]) == (3, describe(pipeline.sources).content_sha256)


def test_salvage_of_what_is_sound_is_the_same_again(
    here: Callable[..., Any], pipeline: Any, tmp_path: Path
) -> None:
    told = here("salvage", pipeline.sources, "-o", "copy.h5", "--json").json
    assert (told["tasks"], told["lost"]) == (4, [])
    assert told["digest"] == describe(pipeline.sources).content_sha256
    before = (tmp_path / "copy.h5").stat().st_ino
    assert here("salvage", pipeline.sources, "-o", "copy.h5").code == 0
    assert (tmp_path / "copy.h5").stat().st_ino == before


def test_a_fit_that_does_not_hold_cannot_be_salvaged(
    here: Callable[..., Any], damaged: dict[str, Path], tmp_path: Path
) -> None:
    ended = here("salvage", damaged["fit"], "-o", "saved.h5")
    assert (ended.code, ended.out) == (6, "")
    assert "cannot be salvaged" in ended.err
    assert not (tmp_path / "saved.h5").exists()


def test_a_lower_limit_of_the_shell_is_kept_to_and_a_sound_file_is_sound(
    shell: Callable[..., Ended], pipeline: Pipeline
) -> None:
    ended = shell(f"ulimit -v 2500000; ulimit -t 300; qinit verify {pipeline.sources}")
    assert ended.code == 0, ended.err
