"""What holds for every picture: same bytes, sizes, legible letters, sensible names, refusals."""

from __future__ import annotations

import struct
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from ready import Ready

SMALLEST = 6.5  # points
Draw = Callable[..., Any]


def _given(picture: str, pipeline: Any) -> list[Path]:
    runs = [pipeline.runs[name] for name in ("zero", "ucoi", "logqinit-median")]
    return {"heatmaps": [pipeline.fit], "histograms": [pipeline.sources], "curves": runs, "bars": runs}[
        picture
    ]


PICTURES = ("heatmaps", "histograms", "curves", "bars")
every_picture = pytest.mark.parametrize("picture", PICTURES)


KINDS = ("png", "svg", "pdf")
# each argument is a picture and what it is given, a line each
DRAWING = f"""import sys
from qinit_cli.app import run
for lines in sys.argv[1:]:
    picture, *given = lines.splitlines()
    for kind in {KINDS}:
        assert run(["plot", picture, *given, "-o", f"{{picture}}.{{kind}}"]) == 0
"""


@pytest.fixture(scope="module")
def drawn_there(pipeline: Any, ready: Ready, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder where another process drew every picture."""
    folder = tmp_path_factory.mktemp("there")
    (folder / "draw.py").write_text(DRAWING)
    words = ["\n".join([picture, *map(str, _given(picture, pipeline))]) for picture in PICTURES]
    with ready.process(folder, *words, command="draw.py") as process:
        assert process.wait(300) == 0, process.err
    return folder


@every_picture
def test_another_process_draws_the_same_bytes(
    here: Draw, tmp_path: Path, pipeline: Any, picture: str, drawn_there: Path
) -> None:
    for kind in KINDS:
        name = f"{picture}.{kind}"
        assert here("plot", picture, *_given(picture, pipeline), "-o", tmp_path / name).code == 0
        assert (tmp_path / name).read_bytes() == (drawn_there / name).read_bytes()


@every_picture
def test_a_picture_is_named_for_what_it_is_unless_told_otherwise(
    here: Draw, tmp_path: Path, pipeline: Any, picture: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    assert here("plot", picture, *_given(picture, pipeline)).out == f"{picture}.png\n"
    assert [path.name for path in tmp_path.iterdir()] == [f"{picture}.png"]


@every_picture
@pytest.mark.parametrize(("width", "inches"), [("column", 3.5), ("text", 7.0)])
def test_a_picture_is_as_wide_as_asked_and_no_letter_is_too_small(
    drawn: Draw, tmp_path: Path, pipeline: Any, picture: str, width: str, inches: float
) -> None:
    from matplotlib.text import Text

    states = ("--state", "0,0", "--state", "5,5") if picture == "histograms" else ()
    figure = drawn(picture, *_given(picture, pipeline), "--width", width, *states)
    header = (tmp_path / "picture.png").read_bytes()[16:24]
    assert struct.unpack(">I", header[:4])[0] == inches * 300
    letters = [text for text in figure.findobj(Text) if text.get_visible() and text.get_text()]
    assert min(text.get_fontsize() for text in letters) >= SMALLEST
    assert not any("$" in text.get_text() for text in letters)  # whose exponents would be smaller


@every_picture
def test_the_title_is_as_asked(drawn: Draw, pipeline: Any, picture: str) -> None:
    figure = drawn(picture, *_given(picture, pipeline), "--title", "A title of mine")
    titles = [figure.get_suptitle(), *(axes.get_title() for axes in figure.axes)]
    assert "A title of mine" in titles


def test_a_picture_of_another_format_or_in_place_of_a_folder_is_a_usage_error(
    here: Draw, tmp_path: Path, pipeline: Any
) -> None:
    (tmp_path / "folder.png").mkdir()
    for output, words in (("picture.gif", "ends in .png, .svg or .pdf"), ("folder.png", "that is a folder")):
        ended = here("plot", "histograms", pipeline.sources, "-o", tmp_path / output)
        assert (ended.code, ended.out) == (2, "")
        assert words in ended.err


def test_a_picture_makes_its_folder_and_takes_the_place_of_an_older_one(
    here: Draw, tmp_path: Path, pipeline: Any
) -> None:
    picture = tmp_path / "new" / "folder" / "picture.svg"
    for title in ("older", "newer"):
        ended = here("plot", "histograms", pipeline.sources, "-o", picture, "--title", title)
        assert (ended.code, ended.out) == (0, f"{picture}\n"), ended.err
        assert f"<title>{title}</title>" in picture.read_text()
    assert [path.name for path in picture.parent.iterdir()] == ["picture.svg"]


def test_curves_of_several_source_sets_are_their_mean(
    drawn: Draw, here: Draw, pipeline: Any, tmp_path: Path
) -> None:
    import h5py
    import numpy as np

    store = ("--store", tmp_path / "store", "-q")
    family = ("gridworld", "--size", 6, "--variance", 2, "--tasks", 4, "--seed", 1, "--learner", "exact")
    fit = here("fit", here("train-sources", *family, *store).path, *store).path
    other = here("transfer", "zero", fit, "--tasks", 4, "--episodes", 60, *store).path
    axes = drawn("curves", pipeline.runs["zero"], other, "--metric", "steps", "--smooth", 1).axes[0]
    [line] = axes.lines
    means = []
    for path in (pipeline.runs["zero"], other):
        with h5py.File(path) as run:
            means.append(run["steps"][...].mean(axis=0))
    np.testing.assert_allclose(line.get_ydata(), np.mean(means, axis=0))
    assert "2 source sets" in axes.get_xlabel()
