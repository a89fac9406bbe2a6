"""Path lengths at the target start: histograms, densities and the noise floor."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
from scipy import stats

from qinit_cli.analysis.length_sample import LengthSample
from qinit_cli.plots.eopl import FLOOR_COLOUR, DrawnLengths, eopl
from qinit_cli.plots.style import house_style

Draw = Callable[..., Any]
GRID = ("gridworld", "--size", 6, "--learner", "exact", "-q")


@pytest.fixture
def sources(here: Draw) -> Callable[..., Path]:
    """Exact sources of a small grid: `sources("--variance", 2, "--tasks", 30)`."""

    def make(*options: object) -> Path:
        path: Path = here("train-sources", *GRID, *options).path
        return path

    return make


def _lengths(path: Path) -> np.ndarray[Any, Any]:
    """The greedy path of every task from (0, 0)."""
    with h5py.File(path) as file:
        q, lengths = file["q"][:, 0, 0], file["eopl"][:, 0, 0]
    return lengths[np.arange(len(q)), q.argmax(axis=1)]


def _counts(axes: Any) -> dict[int, int]:
    """How often each length is counted, for bins of one step."""
    bars = [bar for bar in axes.patches if bar.get_height()]
    return {round(bar.get_x() + bar.get_width() / 2): int(bar.get_height()) for bar in bars}


def test_bars_count_the_greedy_paths_of_each_distribution(drawn: Draw, sources: Draw) -> None:
    paths = [sources("--tasks", 30, *options) for options in (("--variance", 2), ("--goals", "uniform"))]
    figure = drawn("eopl", *paths)
    assert len(figure.axes) == 3
    for axes, path in zip(figure.axes, paths, strict=False):
        values, counts = np.unique(_lengths(path), return_counts=True)
        assert _counts(axes) == dict(zip(values.tolist(), counts.tolist(), strict=True))
    first = figure.axes[0].get_title(loc="left").replace("\n", " ")
    lengths = _lengths(paths[0])
    assert first.startswith(f"6 variance 2: n = 30 mean {lengths.mean():.1f}, sd {lengths.std():.1f}")
    assert f"W = {stats.shapiro(lengths).statistic:.3f}" in first


def test_source_sets_of_one_distribution_are_one_and_no_task_counts_twice(drawn: Draw, sources: Draw) -> None:
    few, more = sources("--tasks", 12), sources("--tasks", 20)
    other = sources("--tasks", 15, "--seed", 1)
    figure = drawn("eopl", few, more, other, more)
    assert len(figure.axes) == 2
    expected = np.concatenate([_lengths(more), _lengths(other)])
    assert sum(_counts(figure.axes[0]).values()) == len(expected) == 35
    assert "n = 35" in figure.axes[0].get_title(loc="left")


def test_tasks_that_are_all_alike_are_the_noise_floor_and_come_last(drawn: Draw, sources: Draw) -> None:
    alike = sources("--variance", 0, "--p-low", 0.8, "--p-high", 0.8, "--tasks", 10)
    figure = drawn("eopl", alike, sources("--tasks", 10))
    titles = [axes.get_title(loc="left") for axes in figure.axes[:2]]
    assert "noise floor" in titles[1]
    assert "noise floor" not in titles[0]
    assert "not testable" in titles[1]
    [area] = figure.axes[2].collections
    assert "noise floor" in area.get_label()
    assert len(figure.axes[2].lines) == 1


def test_a_floor_of_several_source_sets_is_one_and_says_how_many(drawn: Draw, sources: Draw) -> None:
    alike = ("--variance", 0, "--p-low", 0.8, "--p-high", 0.8, "--tasks", 5)
    figure = drawn("eopl", sources("--tasks", 10), *(sources(*alike, "--seed", seed) for seed in range(3)))
    assert len(figure.axes) == 3
    assert "noise floor: n = 15 in 3 source sets" in figure.axes[1].get_title(loc="left").replace("\n", " ")


@pytest.mark.parametrize("picture", ["eopl", "occupancy"])
def test_sources_that_were_learned_in_another_way_are_told(
    here: Draw, sources: Draw, picture: str, tmp_path: Path
) -> None:
    learned = ("train-sources", "gridworld", "--size", 6, "--tasks", 3, "--episodes", 300, "-q")
    short = here(*learned, "-o", "short.h5").path
    long = here(*learned, "--variance", 2, "--horizon", 700, "-o", "long.h5").path
    ended = here("plot", picture, short, long, "-o", "picture.png")
    assert ended.code == 0
    assert ended.err.endswith("6 variance 2 was learned otherwise than 6 variance 7: horizon 700, not 1000\n")


def test_the_floor_stands_behind_and_does_not_flatten_the_densities() -> None:
    rng = np.random.default_rng(0)
    wide = LengthSample.of(np.rint(rng.normal(150, 15, 300)).astype(int))
    narrow = LengthSample.of(np.full(20, 150))
    with house_style():
        figure = eopl([DrawnLengths("a", "", wide, False), DrawnLengths("floor", "", narrow, True)], "")
        figure.canvas.draw()
    densities = figure.axes[-1]
    assert densities.get_ylim()[1] < 0.05
    assert densities.collections[0].get_facecolor()[0][:3] == pytest.approx(
        [int(FLOOR_COLOUR[at : at + 2], 16) / 255 for at in (1, 3, 5)]
    )


def test_densities_hold_one_task_in_all_and_the_normal_is_scipys() -> None:
    sample = LengthSample.of(np.random.default_rng(1).poisson(40, 200))
    at = np.arange(0.0, 100.0, 0.05)
    assert np.trapezoid(sample.smooth_density(at), at) == pytest.approx(1, abs=1e-6)
    known = stats.norm.pdf(at, sample.lengths.mean(), sample.lengths.std())
    np.testing.assert_allclose(sample.normal_density(at), known, rtol=1e-9)
    bandwidth = 0.9 * min(sample.deviation, stats.iqr(sample.lengths) / 1.349) * 200**-0.2
    kernel = stats.gaussian_kde(sample.lengths, bandwidth / sample.lengths.std(ddof=1))
    np.testing.assert_allclose(sample.smooth_density(at), kernel(at), atol=1e-9)


def test_paths_that_never_arrive_are_counted_and_not_drawn() -> None:
    sample = LengthSample.of(np.array([7, -1, 9, -1, 8]))
    assert sample.lengths.tolist() == [7, 8, 9]
    assert sample.never == 2


@pytest.mark.parametrize("lengths", [[], [5], [5] * 30, list(range(7))])
def test_few_or_equal_lengths_are_not_testable_and_yet_drawn(lengths: list[int]) -> None:
    sample = LengthSample.of(np.array(lengths, int))
    assert np.isnan(sample.rounded_normal(np.random.default_rng(0))).all()
    with house_style():
        eopl([DrawnLengths("a", "", sample, False)], "").canvas.draw()


def test_rounded_normals_are_not_rejected_and_skewed_lengths_are() -> None:
    rng = np.random.default_rng(4)
    fair = LengthSample.of(np.rint(rng.normal(40, 1.4, 100)).astype(int))
    skewed = LengthSample.of(np.rint(rng.lognormal(3, 0.6, 100)).astype(int))
    assert fair.rounded_normal(np.random.default_rng(0))[1] > 0.05
    assert skewed.rounded_normal(np.random.default_rng(0))[1] < 0.01


def test_bins_are_whole_steps_whatever_the_range() -> None:
    sample = LengthSample.of(np.random.default_rng(1).integers(80, 400, 90))
    with house_style():
        figure = eopl([DrawnLengths("a", "", sample, False)], "")
    bars = figure.axes[0].patches
    assert {bar.get_width() for bar in bars} == {7.0}
    assert sum(bar.get_height() for bar in bars) == 90


def test_what_cannot_be_drawn_is_refused_in_one_sentence(
    refused: Draw, pipeline: Any, sources: Draw, here: Draw
) -> None:
    bigger = here("train-sources", "gridworld", "--size", 7, "--tasks", 2, "--learner", "exact", "-q").path
    many = [sources("--tasks", 2, "--variance", variance) for variance in range(1, 9)]
    for code, words, *given in (
        (4, "sources is needed", pipeline.fit),
        (4, "start in the same state", pipeline.sources, bigger),
        (2, "8 distributions do not fit", *many),
    ):
        ended, sentence = refused("eopl", *given)
        assert words in sentence
        assert ended == code, sentence


def test_no_letter_is_too_small_at_either_width(drawn: Draw, pipeline: Any) -> None:
    from matplotlib.text import Text

    for width, inches in (("column", 3.5), ("text", 7.0)):
        figure = drawn("eopl", pipeline.sources, "--width", width, "--title", "mine")
        assert figure.get_size_inches()[0] == inches
        assert figure.get_suptitle() == "mine"
        letters = [text for text in figure.findobj(Text) if text.get_visible() and text.get_text()]
        assert min(text.get_fontsize() for text in letters) >= 6.5
