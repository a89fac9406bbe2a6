"""Sensitivity, grid and ranks: what is drawn are the numbers of `qinit sensitivity`, and too little is told in words."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from varying import METHODS, balanced, fitted, ran

Draw = Callable[..., Any]


@pytest.fixture(scope="module")
def paths(tmp_path_factory: pytest.TempPathFactory) -> list[Path]:
    return [run.path for run in balanced(tmp_path_factory.mktemp("varying"))]


@pytest.fixture(scope="module")
def rows(paths: list[Path]) -> list[dict[str, Any]]:
    import qinit_cli as qinit

    found: list[dict[str, Any]] = qinit.sensitivity(paths, "variance").rows
    return found


def test_lines_and_intervals_are_the_numbers_of_the_command(
    drawn: Draw, here: Draw, paths: list[Path], rows: list[dict[str, Any]]
) -> None:
    figure = drawn("sensitivity", *paths, "--over", "variance")
    assert [axes.get_title() for axes in figure.axes] == ["epsilon 0.1", "epsilon 0.3"]
    for axes in figure.axes:
        own = [row for row in rows if row["where"] == axes.get_title()]
        for container in axes.containers:
            mine = [row for row in own if row["method"] == container.get_label()]
            line, _, (bars,) = container.lines
            assert line.get_xdata().tolist() == [row["value"] for row in mine] == [1, 2, 4]
            assert line.get_ydata().tolist() == [row["return"] for row in mine]
            ends = [(low[1], high[1]) for low, high in bars.get_segments()]
            assert ends == [pytest.approx((row["return_low"], row["return_high"])) for row in mine]
        low, high = axes.get_ylim()
        assert low < min(row["return_low"] for row in rows)
        assert high > max(row["return_high"] for row in rows)
    assert here("sensitivity", *paths, "--over", "variance", "--json").json["rows"] == rows


def test_panels_may_be_of_one_setting_or_none(drawn: Draw, paths: list[Path]) -> None:
    figure = drawn("sensitivity", *paths, "--over", "variance", "--panels", "none")
    [axes] = figure.axes
    assert [container.get_label() for container in axes.containers] == list(METHODS)
    [note] = [legend.get_title().get_text().replace("\n", " ") for legend in figure.legends]
    assert note.endswith("averaged over epsilon")
    assert len(drawn("sensitivity", *paths, "--over", "epsilon", "--panels", "variance").axes) == 3


def test_values_that_span_decades_are_logarithmic_and_categories_stand_evenly(
    drawn: Draw, tmp_path: Path
) -> None:
    runs = [
        ran("zero", fitted(variance, store=tmp_path), store=tmp_path, start=start).path
        for variance in (0.01, 1, 2)
        for start in ("fixed", "anywhere")
    ]
    figure = drawn("sensitivity", *runs, "--over", "variance")
    assert {axes.get_xscale() for axes in figure.axes} == {"log"}
    axes = drawn("sensitivity", *runs, "--over", "start", "--panels", "none").axes[0]
    assert axes.get_xscale() == "linear"
    assert [tick.get_text() for tick in axes.get_xticklabels()] == ["fixed", "anywhere"]


def test_a_grid_has_each_mean_in_its_cell_and_marks_what_was_not_run(drawn: Draw, paths: list[Path]) -> None:
    from qinit_cli.comparison.runs import read_runs

    shown = paths[1:]  # without zero at variance 1 of the first set and epsilon 0.1
    lacking = [path for path in shown if path != paths[2]]  # nor of the second: no cell
    figure = drawn("grid", *lacking, "--over", "variance", "--by", "epsilon")
    panels = {axes.get_title(): axes for axes in figure.axes if axes.get_title()}
    assert list(panels) == list(METHODS)
    runs = read_runs(lacking)
    for method, axes in panels.items():
        for row, epsilon in enumerate((0.1, 0.3)):
            for column, variance in enumerate((1, 2, 4)):
                own = [
                    run.returns().mean()
                    for run in runs
                    if run.label == method
                    and run.settings.learning.epsilon == epsilon
                    and run.settings.family.options["variance"] == variance
                ]
                [text] = [one for one in axes.texts if one.get_position() == (column, row)]
                assert text.get_text() == (f"{np.mean(own):.3f}" if own else "\N{MULTIPLICATION SIGN}")
    assert sum(text.get_text() == "\N{MULTIPLICATION SIGN}" for text in panels["zero"].texts) == 1


def test_ranks_of_few_distributions_make_no_claim(drawn: Draw, paths: list[Path]) -> None:
    figure = drawn("ranks", *paths)
    said = " ".join(text.get_text().replace("\n", " ") for text in figure.texts)
    assert "no pair is tested: with 3 distributions" in said
    assert "with 7 it can" in said
    named = [text.get_text() for text in figure.axes[0].texts]
    assert all(any(method in name for name in named) for method in METHODS)
    assert not [line for line in figure.axes[0].lines if line.get_linewidth() == 3]


def test_bars_join_methods_that_are_alike() -> None:
    from qinit_cli.analysis.ranks import rank_comparison
    from qinit_cli.plots.ranks import rank_words, ranks
    from qinit_cli.plots.style import house_style

    steps = np.arange(1, 11)[:, None] / 100
    noise = steps * np.where(np.arange(10) % 2, 1, -1)[:, None]
    found = rank_comparison(np.concatenate([np.zeros((10, 1)), noise, 10 + 2 * steps], axis=1))
    with house_style():
        figure = ranks(["a", "b", "c"], found, "mean rank", rank_words(found), "")
    [bar] = [line for line in figure.axes[0].lines if line.get_linewidth() == 3]
    joined = {line.get_xdata()[0] for line in figure.axes[0].lines if len(line.get_xdata()) == 1}
    between = {x for x in joined if bar.get_xdata()[0] < x < bar.get_xdata()[1]}
    assert len(joined - between) == 1
    assert "bars join methods" in rank_words(found)


@pytest.mark.parametrize(
    ("words", "code", "said"),
    [
        (("sensitivity", "--over", "gamma"), 2, "does not vary"),
        (("sensitivity", "--over", "variance", "--panels", "method"), 2, "is drawn already"),
        (("grid", "--over", "variance", "--by", "variance"), 2, "are to differ"),
    ],
)
def test_what_cannot_be_drawn_is_refused_in_a_sentence(
    refused: Draw, paths: list[Path], words: tuple[str, ...], code: int, said: str
) -> None:
    kind, *options = words
    ended, sentence = refused(kind, *paths, *options)
    assert ended == code
    assert said in sentence


def test_a_report_has_the_shares_and_a_picture_for_each_setting_of_numbers(
    here: Draw, paths: list[Path], tmp_path: Path
) -> None:
    page = here("report", *paths, "-o", tmp_path / "page.html").path.read_text()
    assert '<section id="sensitivity"' in page
    for title in ("Sensitivity to variance", "Sensitivity to epsilon", "Ranks of methods"):
        assert f"{title}, discounted return.</b>" in page
    assert "No differences: the baseline zero could be any of" in page
    ended = here("report", *paths, "-o", tmp_path / "other.html", "--baseline", "zero")
    assert ended.code == 4


def test_a_report_of_runs_that_differ_in_methods_alone_has_no_such_section(
    here: Draw, paths: list[Path], tmp_path: Path
) -> None:
    page = here("report", paths[0], paths[12], "-o", tmp_path / "page.html").path.read_text()
    assert 'id="sensitivity"' not in page
