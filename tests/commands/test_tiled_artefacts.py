"""What commands make of sources, fits and runs over continuous states."""

from __future__ import annotations

import csv
import io
import json
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
from running import Ended, Pipeline, run_here

import qinit_cli as qinit

Here = Callable[..., Ended]
TILES = ("--representation", "tiles", "--tilings", 2, "--tiles", 4, "--probes", 64)
SOURCES = ("train-sources", "mountain-car", *TILES, "--tasks", 4, "--episodes", 200, "--seed", 3)


@pytest.fixture(scope="session")
def tiled(tmp_path_factory: pytest.TempPathFactory) -> Pipeline:
    """Made once; look, do not touch."""
    store = tmp_path_factory.mktemp("tiled") / "store"

    def made(*arguments: object) -> Path:
        ended = run_here([*map(str, arguments), "--store", str(store), "--quiet"])
        assert ended.code == 0, ended.err
        return ended.path

    sources = made(*SOURCES)
    fit = made("fit", sources)
    targets = ("--tasks", 2, "--episodes", 20)
    runs = {name: made("transfer", name, fit, *targets) for name in ("zero", "logqinit-median", "optimal")}
    return Pipeline(store, sources, fit, runs)


@pytest.mark.parametrize(
    ("plot", "of", "words"),
    [
        ("normality", "fit", "has a test at each of 64 probes, which make no map"),
        ("occupancy", "sources", "mountain-car by tiles has no table"),
        ("heatmaps", "sources", "wanted a fit or a run"),
        ("posterior", "run", "keeps no weights: it is a run of zero"),
    ],
)
def test_what_cannot_be_drawn_is_refused_in_a_sentence(
    here: Here, tiled: Pipeline, plot: str, of: str, words: str
) -> None:
    artefact = {"fit": tiled.fit, "sources": tiled.sources, "run": tiled.runs["zero"]}[of]
    ended = here("plot", plot, artefact, "-o", "picture.png")
    assert (ended.code, ended.out, ended.err.count("\n")) == (4, "", 1)
    assert words in ended.err


def test_counts_of_probes_make_no_map(here: Here, tiled: Pipeline) -> None:
    ended = here("plot", "heatmaps", tiled.fit, "--quantity", "n", "-o", "picture.png")
    assert ended.code == 4
    assert f"`qinit export {tiled.fit} --what state-actions`" in ended.err


@pytest.mark.parametrize("plot", ["car", "eopl", "histograms"])
def test_pictures_of_sources_are_drawn(here: Here, tiled: Pipeline, plot: str) -> None:
    ended = here("plot", plot, tiled.sources, "-o", "picture.svg")
    assert (ended.code, ended.out) == (0, "picture.svg\n"), ended.err
    assert "(0)" not in Path("picture.svg").read_text()  # a probe's number is no state


def test_histograms_take_the_coordinates_of_a_continuous_state(here: Here, tiled: Pipeline) -> None:
    from qinit_cli.plots import PLOTS

    histograms: Any = PLOTS["histograms"]
    drawn = histograms(state=["-0.5,0", "-1,0.05"]).drawn([tiled.sources])
    q = qinit.open(tiled.sources).to_xarray().q.values[:, 0]  # of the first probe, where targets start
    greedy = q[:, q.mean(axis=0).argmax()]
    assert f"({chr(8722)}0.5, 0)" in drawn.alt
    assert f"median of Q {np.median(greedy[greedy > 0]):.4f}" in drawn.alt
    ended = here("plot", "histograms", tiled.sources, "--state=-0.5,0.2")
    assert ended.code == 2
    assert "--state -0.5,0.2: velocity is from -0.07 to 0.07" in ended.err


def test_a_run_and_its_fit_draw_the_same_start_once(tiled: Pipeline) -> None:
    from qinit_cli.plots.panels import read_panels

    [panels], _ = read_panels([tiled.fit, *tiled.runs.values()], ["logqinit-median", "zero"], "start")
    assert list(panels.tables) == ["logqinit-median", "zero", "optimal (privileged), mean of targets"]
    assert all(table.shape == (60, 60) for table in panels.tables.values())
    assert not panels.tables["zero"].any()


def test_one_dimension_left_is_a_curve(tiled: Pipeline) -> None:
    from qinit_cli.plots import PLOTS

    heatmaps: Any = PLOTS["heatmaps"]
    drawn = heatmaps(slice_=["velocity=0"], method=["zero", "mean"]).drawn([tiled.fit])
    [axes] = drawn.figure.axes
    assert [line.get_label() for line in axes.lines] == ["zero", "mean"]
    assert all(len(line.get_xdata()) == 60 for line in axes.lines)
    assert (axes.get_xlabel(), axes.get_xlim()) == ("position", pytest.approx((-1.2, 0.6)))
    assert "at velocity 0, projected from probes onto tiles" in drawn.alt
    whole = heatmaps(method=["mean"]).drawn([tiled.fit]).figure.axes[0]
    assert (whole.get_xlabel(), whole.get_ylabel()) == ("velocity", "position")


def test_show_draws_a_fit_over_its_box(here: Here, tiled: Pipeline) -> None:
    shown = here("show", tiled.fit, "--format", "table").out
    assert "projected from probes onto tiles" in " ".join(shown.split())
    assert "position down, velocity across" in shown
    along = here("show", tiled.fit, "--format", "table", "--slice", "position=-0.5").out
    assert "at position -0.5, projected" in " ".join(along.split())
    assert along.splitlines()[-1].split() == ["-0.0688", "velocity", "0.0688"]


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (("fit", "--format", "table", "--slice", "speed=0"), "mountain-car has no dimension speed"),
        (("fit", "--json", "--slice", "velocity=0"), "is of the picture"),
        (("sources", "--format", "table", "--slice", "velocity=0"), "show draws a histogram of sources"),
    ],
)
def test_show_refuses_a_slice_of_nothing(
    here: Here, tiled: Pipeline, words: tuple[str, ...], told: str
) -> None:
    ended = here("show", getattr(tiled, words[0]), *words[1:])
    assert (ended.code, ended.out) == (2, "")
    assert told in ended.err


def test_a_report_has_the_slice_and_says_what_is_not_drawn(here: Here, tiled: Pipeline) -> None:
    everything = (tiled.sources, tiled.fit, *tiled.runs.values())
    ended = here("report", *everything, "--slice", "velocity=0.01", "-o", "page.html")
    assert ended.code == 0, ended.err
    page = Path("page.html").read_text()
    assert "at velocity 0.01, projected from probes onto tiles" in " ".join(page.split())
    assert "which make no map" in page
    wrong = here("report", tiled.fit, "--slice", "velocity=1", "-o", "other.html")
    assert (wrong.code, Path("other.html").exists()) == (2, False)
    none = here("report", tiled.sources, "--slice", "velocity=0", "-o", "other.html")
    assert none.code == 2
    assert "no fit of these artefacts is over continuous states" in none.err


def test_weights_and_probes_are_long_tables(here: Here, tiled: Pipeline) -> None:
    def rows(artefact: Path, table: str) -> list[dict[str, str]]:
        ended = here("export", artefact, "--what", table, "--to", "csv", "-o", "-", "-q")
        assert ended.code == 0, ended.err
        return list(csv.DictReader(io.StringIO(ended.out)))

    sources = qinit.open(tiled.sources).to_xarray()
    assert dict(sources.sizes)["tile"] == 2 * 5 * 5
    weights = [float(row["weights"]) for row in rows(tiled.sources, "weights")]
    np.testing.assert_array_equal(weights, sources.weights.values.ravel())
    for artefact in (tiled.sources, tiled.fit, tiled.runs["zero"]):
        first = rows(artefact, "probes")[:2]
        assert [(row["dimension"], float(row["probes"])) for row in first] == [
            ("position", -0.5),
            ("velocity", 0.0),
        ]
    assert len(rows(tiled.runs["zero"], "start-weights")) == 50 * 3
    refused = here("export", tiled.runs["optimal"], "--what", "start-weights", "--to", "csv")
    assert refused.code == 4


def test_shares_are_merged_to_what_one_run_makes(here: Here, tiled: Pipeline) -> None:
    shares = [here(*SOURCES, "--shard", f"{share}/2", "-q").path for share in (1, 2)]
    merged = here("merge", *shares, "-o", "merged.h5", "-q").path
    assert qinit.open(merged).digest == qinit.open(tiled.sources).digest


def test_the_tasks_whose_weights_hold_are_salvaged(here: Here, tiled: Pipeline, tmp_path: Path) -> None:
    damaged = tmp_path / "damaged.h5"
    shutil.copy(tiled.sources, damaged)
    with h5py.File(damaged, "r+") as file:
        file["weights"][1, 0, 0] += 1.0
    assert here("verify", damaged).code == 6
    saved = here("salvage", damaged, "-o", "saved.h5", "-q").path
    assert qinit.open(saved).to_xarray().task.values.tolist() == [0, 2, 3]
    assert here("fit", saved, "-q").code == 0


def test_targets_by_tiles_are_shifted(here: Here, tiled: Pipeline) -> None:
    ended = here("transfer", "mean", tiled.fit, "--shift", "noise=0.02", "--tasks", 1, "--episodes", 2)
    assert ended.code == 0, ended.err
    with h5py.File(ended.path) as file:
        assert json.loads(file.attrs["spec_json"])["family"]["noise"] == 0.02
    refused = here("transfer", "mean", tiled.fit, "--shift", "tiles=3", "--tasks", 1)
    assert (refused.code, refused.out) == (2, "")
    assert "mountain-car has no tiles; it is one of bins, hill, noise" in refused.err


@pytest.mark.parametrize("family", ["mountain-car", "acrobot"])
def test_bins_beside_tiles_are_refused(here: Here, family: str) -> None:
    ended = here("train-sources", family, *TILES, "--bins", 5, "--tasks", 1, "--episodes", 1)
    assert (ended.code, ended.out) == (2, "")
    assert "--bins is of a table, and --representation tiles has --tiles in its place" in ended.err


def test_a_fit_that_keeps_no_library_is_transferred(here: Here, tiled: Pipeline) -> None:
    fitted = here("fit", tiled.sources, "--library", 0, "-o", "none.h5")
    assert fitted.code == 0, fitted.err
    with h5py.File(
        "none.h5"
    ) as file:  # 2 tilings of 5 x 5 tiles, one more along each dimension as they are shifted
        assert (file["library_weights"].shape, file["library_q"].shape) == ((0, 50, 3), (0, 64, 3))
    ended = here("transfer", "mean", "none.h5", "--tasks", 1, "--episodes", 2)
    assert ended.code == 0, ended.err
