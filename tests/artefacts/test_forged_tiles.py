"""Tiled artefacts whose digests hold and whose weights, probes or settings cannot be: refused before a kernel sees them."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
from forging import LIBVER, mend, put, settle
from running import Ended, Pipeline, run_here

Here = Callable[..., Ended]


@pytest.fixture(scope="module")
def tiled(tmp_path_factory: pytest.TempPathFactory) -> Pipeline:
    """Made once: 2 tilings of 2 tiles along 2 dimensions, 18 weights an action."""
    store = tmp_path_factory.mktemp("forged-tiles") / "store"

    def made(*arguments: object) -> Path:
        ended = run_here([*map(str, arguments), "--store", str(store), "--quiet"])
        assert ended.code == 0, ended.err
        return ended.path

    tiles = ("--representation", "tiles", "--tilings", 2, "--tiles", 2, "--probes", 16)
    sources = made("train-sources", "mountain-car", *tiles, "--tasks", 2, "--episodes", 100)
    fit = made("fit", sources)
    return Pipeline(
        store, sources, fit, {"run": made("transfer", "mean", fit, "--tasks", 1, "--episodes", 5)}
    )


def of(pipeline: Pipeline, kind: str) -> Path:
    return {"sources": pipeline.sources, "fit": pipeline.fit, "run": pipeline.runs["run"]}[kind]


def refused(here: Here, path: Path, words: str) -> None:
    ended = here("show", path)
    assert (ended.code, ended.out, ended.err.count("\n")) == (6, "", 1)
    assert words in ended.err


WEIGHTS = {"sources": "weights", "fit": "library_weights", "run": "start_weights"}


@pytest.mark.parametrize("kind", WEIGHTS)
@pytest.mark.parametrize("value", [np.nan, np.inf])
def test_weights_and_probes_are_finite(
    here: Here, tiled: Pipeline, tmp_path: Path, kind: str, value: float
) -> None:
    for name in (WEIGHTS[kind], "probes"):
        refused(here, put(of(tiled, kind), tmp_path / "forged.h5", name, -1, value), f"{name} is {value}")


def test_values_that_learning_would_not_have_left_are_refused(
    here: Here, tiled: Pipeline, tmp_path: Path
) -> None:
    refused(here, put(tiled.sources, tmp_path / "forged.h5", "q", -1, 1e300), "q is 1e+300")
    refused(here, put(tiled.fit, tmp_path / "forged-fit.h5", "library_q", -1, 1e300), "library_q is 1e+300")


@pytest.mark.parametrize("kind", WEIGHTS)
@pytest.mark.parametrize("count", [17, 19])
def test_there_are_as_many_weights_as_the_settings_make(
    here: Here, tiled: Pipeline, tmp_path: Path, kind: str, count: int
) -> None:
    path = shutil.copy(of(tiled, kind), tmp_path / "forged.h5")
    with h5py.File(path, "r+", libver=LIBVER) as file:
        shape = file[WEIGHTS[kind]].shape
        _replace(file, "tile", np.arange(count))
        _replace(file, WEIGHTS[kind], np.zeros((*shape[:-2], count, 3)))
    mend(path)
    refused(here, path, "its axis tile is not that of its settings")


@pytest.mark.parametrize("kind", WEIGHTS)
@pytest.mark.parametrize("names", [[b"position"], [b"velocity", b"position"], [b"a", b"b", b"c", b"d"]])
def test_probes_have_the_dimensions_of_the_family(
    here: Here, tiled: Pipeline, tmp_path: Path, kind: str, names: list[bytes]
) -> None:
    path = shutil.copy(of(tiled, kind), tmp_path / "forged.h5")
    with h5py.File(path, "r+", libver=LIBVER) as file:
        _replace(file, "dimension", np.array(names))
        _replace(file, "probes", np.zeros((16, len(names))))
    mend(path)
    refused(here, path, "its axis dimension is not that of its settings")


@pytest.mark.parametrize("kind", WEIGHTS)
@pytest.mark.parametrize(
    ("name", "value", "words"),
    [
        ("tiles", 3, "its axis tile"),
        ("tilings", 1, "its axis tile"),
        ("tilings", 64, "its axis tile"),
        ("probes", 17, "its axis probe"),
    ],
)
def test_settings_of_tiles_are_those_of_the_arrays(
    here: Here, tiled: Pipeline, tmp_path: Path, kind: str, name: str, value: int, words: str
) -> None:
    def change(spec: dict[str, Any]) -> None:
        (spec["sources"] if kind == "fit" else spec)["family"]["tiles"][name] = value

    refused(here, settle(of(tiled, kind), tmp_path / "forged.h5", change), words)


@pytest.mark.parametrize("kind", WEIGHTS)
def test_more_tiles_than_there_may_be(here: Here, tiled: Pipeline, tmp_path: Path, kind: str) -> None:
    def change(spec: dict[str, Any]) -> None:
        (spec["sources"] if kind == "fit" else spec)["family"]["tiles"] |= {"tilings": 64, "tiles": 1000}

    refused(here, settle(of(tiled, kind), tmp_path / "forged.h5", change), "at most 4000000 are kept")


@pytest.mark.parametrize(
    ("kind", "name"),
    [
        ("sources", "probes"),
        ("fit", "library_weights"),
        ("fit", "probes"),
        ("run", "probes"),
    ],
)
def test_probes_and_weights_are_there(
    here: Here, tiled: Pipeline, tmp_path: Path, kind: str, name: str
) -> None:
    path = shutil.copy(of(tiled, kind), tmp_path / "forged.h5")
    with h5py.File(path, "r+", libver=LIBVER) as file:
        del file[name]
    mend(path)
    refused(here, path, f"it lacks {name}")


@pytest.mark.parametrize("kind", WEIGHTS)
def test_commands_refuse_what_show_refuses(here: Here, tiled: Pipeline, tmp_path: Path, kind: str) -> None:
    path = put(of(tiled, kind), tmp_path / "forged.h5", "probes", 0, np.nan)
    commands: dict[str, tuple[tuple[object, ...], ...]] = {
        "sources": (("fit", path), ("plot", "eopl", path, "-o", "x.png")),
        "fit": (("transfer", "ops-tl", path), ("start", "mean", path, "-o", "x.npz")),
        "run": (("plot", "heatmaps", path, "-o", "x.png"), ("compare", path)),
    }
    for command in (("verify", path), *commands[kind]):
        ended = here(*command)
        assert (ended.code, "unexpected" in ended.err) == (6, False), (command, ended.err)


def _replace(file: Any, name: str, values: Any) -> None:
    """Another array in the place of a dataset, with its attributes but for HDF5's own links."""
    told = {
        key: value
        for key, value in file[name].attrs.items()
        if key not in ("DIMENSION_LIST", "REFERENCE_LIST")
    }
    del file[name]
    file.create_dataset(name, data=values).attrs.update(told)
