"""Every picture says what it shows, in the file itself, with its main numbers."""

from __future__ import annotations

import re
import xml.etree.ElementTree as ElementTree
from collections.abc import Callable
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
from PIL import Image

from qinit_cli.comparison.runs import ComparedRun
from qinit_cli.plots import PLOTS
from qinit_cli.plots.bars import BarsPlot
from qinit_cli.plots.curves import CurvesPlot
from qinit_cli.plots.drawn import Drawn, PictureFile
from qinit_cli.plots.heatmaps import HeatmapsPlot
from qinit_cli.plots.histograms import HistogramsPlot
from qinit_cli.plots.style import house_style
from qinit_store.reading import open_artefact

Draw = Callable[..., Any]
SVG = "{http://www.w3.org/2000/svg}"


def _runs(pipeline: Any, *names: str) -> list[ComparedRun]:
    found = []
    for name in names:
        with open_artefact(pipeline.runs[name], "run") as artefact:
            found.append(ComparedRun.from_artefact(artefact))
    return found


def _figure() -> Any:
    from matplotlib.figure import Figure

    with house_style():
        figure = Figure(figsize=(1, 1))
        figure.add_subplot().plot([0, 1])
    return figure


def test_png_svg_and_pdf_carry_title_and_words(tmp_path: Path) -> None:
    words = "η < 0.5 & W ≤ 1, 95 %"
    picture = Drawn(_figure(), "A title", words)
    for kind in ("png", "svg", "pdf"):
        picture.save(PictureFile(tmp_path / f"picture.{kind}"))
    with Image.open(tmp_path / "picture.png") as png:
        assert (png.info["Title"], png.info["Description"]) == ("A title", words)
    root = ElementTree.parse(tmp_path / "picture.svg").getroot()
    assert root.get("role") == "img"
    assert [root.findtext(f"{SVG}{name}") for name in ("title", "desc")] == ["A title", words]
    assert b"/Title (A title)" in (tmp_path / "picture.pdf").read_bytes()


def test_an_svg_element_stands_in_a_page_by_itself() -> None:
    text = Drawn(_figure(), "A title", "Words.").svg()
    assert text.startswith("<svg ")
    assert ElementTree.fromstring(text).findtext(f"{SVG}desc") == "Words."


@pytest.mark.parametrize(
    "picture", ["heatmaps", "histograms", "curves", "bars", "eopl", "occupancy", "normality", "tuning"]
)
def test_every_picture_describes_itself(here: Draw, pipeline: Any, tuning: Path, picture: str) -> None:
    given = {"curves": pipeline.runs["zero"], "bars": pipeline.runs["zero"]}
    given |= {"heatmaps": pipeline.fit, "normality": pipeline.fit, "tuning": tuning}
    path = here("plot", picture, given.get(picture, pipeline.sources), "-o", "picture.svg").path
    root = ElementTree.parse(path).getroot()
    title, words = (root.findtext(f"{SVG}{name}") or "" for name in ("title", "desc"))
    assert title
    assert words.endswith(".")
    assert re.search(r"\d", words)
    assert "nan" not in words.split()
    assert not re.search(r"\de-\d|\n", words)


def test_the_words_of_bars_are_the_numbers_of_compare(here: Draw, pipeline: Any) -> None:
    said = BarsPlot().of_runs(_runs(pipeline, "zero", "mean")).alt
    rows = here("compare", pipeline.runs["zero"], pipeline.runs["mean"], "--json").json["rows"]
    for row in rows:
        numbers = [f"{row[name]:.4f}" for name in ("return", "return_low", "return_high")]
        assert f"{row['method']} {numbers[0]} ({numbers[1]} to {numbers[2]})" in said


def test_the_words_of_curves_are_their_first_and_last_points(pipeline: Any) -> None:
    said = CurvesPlot(metric="steps", smooth=1).of_runs(_runs(pipeline, "zero")).alt
    with h5py.File(pipeline.runs["zero"]) as run:
        steps = run["steps"][...].mean(axis=0)
    assert f"zero {steps[0]:.1f} to {steps[-1]:.1f}" in said


def test_the_words_of_heatmaps_are_where_each_method_is_largest(pipeline: Any) -> None:
    said = HeatmapsPlot(method=["mean"]).drawn([pipeline.fit]).alt
    with h5py.File(pipeline.fit) as fit:
        table = np.nan_to_num(fit["mean"][...]).max(axis=-1)
    row, column = np.unravel_index(table.argmax(), table.shape)
    assert f"mean {table.max():.4f} at ({row}, {column})" in said


def test_the_words_of_histograms_are_medians_and_tests(pipeline: Any) -> None:
    said = HistogramsPlot(state=["0,0"]).drawn([pipeline.sources]).alt
    with h5py.File(pipeline.sources) as sources, h5py.File(pipeline.fit) as fit:
        values = sources["q"][:, 0, 0, int(np.nanargmax(fit["mean"][0, 0]))]
    assert f"median of Q {np.median(values[values > 0]):.4f}" in said
    assert "W not testable" in said  # four tasks


def test_the_words_of_lengths_and_maps_tell_their_sizes(pipeline: Any) -> None:
    with h5py.File(pipeline.sources) as sources:
        solved = int(sources["solved"][...].sum())
    assert "n = " in PLOTS["eopl"]().drawn([pipeline.sources]).alt
    assert f"{solved} path" in PLOTS["occupancy"]().drawn([pipeline.sources]).alt
    assert "not testable anywhere" in PLOTS["normality"]().drawn([pipeline.fit]).alt
