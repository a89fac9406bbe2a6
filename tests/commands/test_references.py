"""What is named on the command line and is no artefact: told as what it is."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest

Here = Callable[..., Any]


def sentence(ended: Any, code: int) -> str:
    assert ended.code == code, ended.err
    [line] = ended.err.splitlines()
    return str(line)


@pytest.mark.parametrize("command", ["fit", "show", "verify"])
def test_a_file_without_the_ending_is_not_reported_absent(here: Here, tmp_path: Path, command: str) -> None:
    np.savez(tmp_path / "mine.npz", q=np.ones((2, 3)))
    (tmp_path / "my runs").mkdir()
    assert "mine.npz lies here" in sentence(here(command, "mine.npz"), 2)
    assert "a zip archive, as numpy's .npz is" in sentence(here("fit", "./mine.npz"), 6)
    assert "is a folder here; name an artefact in it" in sentence(here(command, "my runs"), 2)
    assert "there is no other.npz" in sentence(here(command, "other.npz"), 2)


def test_an_artefact_with_a_note_of_its_owner_is_used_as_ever(
    here: Here, pipeline: Any, tmp_path: Path
) -> None:
    shutil.copy(pipeline.sources, tmp_path / "noted.h5")
    with h5py.File(tmp_path / "noted.h5", "r+") as file:
        file.attrs["note"] = "the good ones"
    for words in (("show",), ("verify",), ("fit", "-o", "fit.h5"), ("salvage", "-o", "new.h5")):
        ended = here(words[0], "noted.h5", *words[1:])
        assert ended.code == 0, ended.err


def test_an_artefact_with_a_dataset_of_its_owner_is_refused_in_words_and_salvaged(
    here: Here, pipeline: Any, tmp_path: Path
) -> None:
    shutil.copy(pipeline.sources, tmp_path / "noted.h5")
    with h5py.File(tmp_path / "noted.h5", "r+") as file:
        file["mine"] = np.arange(3)
    for command in ("fit", "show"):
        refused = sentence(here(command, "noted.h5"), 6)
        assert "mine has no dims" in refused
        assert "qinit salvage" in refused
        assert "damaged" not in refused
    assert here("verify", "noted.h5", "--format", "tsv").out.splitlines()[1].split("\t")[3] == "foreign"
    assert "0 lost" in here("salvage", "noted.h5", "-o", "clean.h5").err
    assert here("fit", "clean.h5", "-o", "fit.h5").code == 0


@pytest.mark.parametrize(
    ("kind", "words"),
    [
        ("sources", ["fit", "it.h5"]),
        ("fit", ["transfer", "zero", "it.h5"]),
        ("fit", ["lifelong", "zero", "it.h5"]),
        ("sources", ["tune", "ucoi", "it.h5"]),
        ("sources", ["salvage", "it.h5"]),
        ("sources", ["export", "it.h5", "--to", "npz"]),
    ],
)
@pytest.mark.parametrize("output", ["it.h5", "./it.h5", "link.h5"])
def test_no_output_takes_the_place_of_what_is_read(
    kind: str, words: list[str], output: str, here: Here, pipeline: Any, tmp_path: Path
) -> None:
    there = getattr(pipeline, kind).read_bytes()
    (tmp_path / "it.h5").write_bytes(there)
    (tmp_path / "link.h5").symlink_to("it.h5")
    ended = here(*words, "-o", output, "--force")
    assert (ended.code, ended.out) == (2, "")
    assert "is read by this command" in ended.err
    assert (tmp_path / "it.h5").read_bytes() == there


@pytest.mark.parametrize(
    ("kind", "words", "name"),
    [
        ("fit", ["plot", "heatmaps"], "it.png"),
        ("zero", ["plot", "curves"], "it.png"),
        ("fit", ["report"], "it.html"),
    ],
)
def test_no_picture_takes_the_place_of_what_it_shows(
    kind: str, words: list[str], name: str, here: Here, pipeline: Any, tmp_path: Path
) -> None:
    read = pipeline.runs[kind] if kind in pipeline.runs else getattr(pipeline, kind)
    (tmp_path / name).write_bytes(read.read_bytes())
    ended = here(*words, f"./{name}", "-o", name, "--force")
    assert ended.code == 2
    assert "is read by this command" in ended.err
