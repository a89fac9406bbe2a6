"""`qinit report`: what a page is made of, where it goes, and what it refuses."""

from __future__ import annotations

import re
import subprocess
from collections.abc import Callable
from html import escape
from pathlib import Path
from typing import Any

import pytest
from ready import Ready

from qinit_cli.artefacts.kinds import KINDS
from qinit_store.reading import describe

Run = Callable[..., Any]


@pytest.fixture
def one(pipeline: Any) -> Path:
    """A single run, for what a page is made of does not matter everywhere."""
    path: Path = pipeline.runs["zero"]
    return path


@pytest.fixture
def given(pipeline: Any) -> list[Path]:
    """Sources, their fit and three runs."""
    return [pipeline.sources, pipeline.fit, *(pipeline.runs[name] for name in ("zero", "ucoi", "mean"))]


def test_a_page_tells_of_sources_fits_and_runs(here: Run, given: list[Path], tmp_path: Path) -> None:
    ended = here("report", *given)
    assert (ended.code, ended.out) == (0, "report.html\n")
    page = (tmp_path / "report.html").read_text()
    headings = re.findall(r"<h2[^>]*>([^<]*)</h2>", page)
    assert headings == ["In short", "Comparisons", "Figures", "Settings", "Provenance and hashes"]
    assert page.count("<figure ") == 6  # path lengths, values; starts, normality; curves, bars
    for path in given:
        assert path.stem in page
        told = describe(path)
        assert told.content_sha256 in page
        assert escape(told.provenance["command"]) in page


def test_the_numbers_are_those_of_compare(here: Run, given: list[Path], tmp_path: Path) -> None:
    assert here("report", *given[2:]).code == 0
    page = (tmp_path / "report.html").read_text()
    compared = here("compare", *given[2:], "--json").json
    for row in compared["rows"]:
        assert f"{row['return']:.4f}" in page
    assert compared["intervals"][0]["over"][3:] in page.replace("\N{NO-BREAK SPACE}", " ")


@pytest.mark.parametrize("kind", KINDS)
def test_each_kind_alone_makes_a_page_that_shows_it(
    here: Run, pipeline: Any, tuning: Path, tmp_path: Path, kind: str
) -> None:
    given = {"sources": pipeline.sources, "fit": pipeline.fit, "run": pipeline.runs["zero"], "tuning": tuning}
    assert here("report", given[kind]).code == 0
    page = (tmp_path / "report.html").read_text()
    assert page.count("<figure ") == {"tuning": 1}.get(kind, 2)
    assert (">Comparisons<" in page) == (kind == "run")
    assert (">Tuning<" in page) == (kind == "tuning")
    assert re.search(
        rf"All of it rests on 1 ({'set of sources|' if kind == 'sources' else ''}{kind})\.", page
    )
    assert describe(given[kind]).content_sha256 in page


def test_a_tuning_is_told_with_its_candidates_and_their_curve(
    here: Run, tuning: Path, tmp_path: Path
) -> None:
    assert here("report", tuning).code == 0
    page = (tmp_path / "report.html").read_text()
    assert "--kappa" in page
    assert "a choice is worth" in page
    assert page.count("chosen</td>") == 1
    assert re.findall(r'<th scope="row" class="number">(\d+)</th>', page) == [
        "1",
        "3",
        "10",
    ]  # the default is 10


def test_a_page_of_runs_begins_with_what_was_compared_then_the_curves(
    here: Run, given: list[Path], tmp_path: Path
) -> None:
    assert here("report", *given).code == 0
    page = (tmp_path / "report.html").read_text()
    assert "paper's" not in page.partition("<h2")[2].partition("</ul>")[0]
    assert "claims" not in page
    first = re.findall(r"<figcaption><b>Figure 1. ([^,]*),", page)
    assert first == ["Learning curves"]
    assert page.index("<table>") < page.index("<figure ")


def test_figures_of_one_title_are_told_apart(here: Run, pipeline: Any, tmp_path: Path) -> None:
    other = here("transfer", "zero", pipeline.fit, "--tasks", 4, "--episodes", 60, "--gamma", 0.9, "-q").path
    assert here("report", pipeline.runs["zero"], other).code == 0
    page = (tmp_path / "report.html").read_text()
    titles = re.findall(r"<figcaption><b>Figure \d+. (.*?)\.</b>", page)
    assert len(set(titles)) == len(titles)
    assert any(title.endswith("gamma 0.9") for title in titles)


def test_references_come_from_stdin_and_one_that_comes_twice_counts_once(
    here: Run, one: Path, tmp_path: Path
) -> None:
    here("report", one)
    before = (tmp_path / "report.html").read_bytes()
    assert here("report", "-", "-o", "again.html", stdin=f"{one}\n{one}\n").code == 0
    assert (tmp_path / "again.html").read_bytes() == before


def test_another_process_writes_the_same_bytes(
    here: Run, given: list[Path], tmp_path: Path, ready: Ready
) -> None:
    here("report", *given)
    command = ["report", *map(str, given), "-o", "there.html"]
    subprocess.run([ready.qinit, *command], cwd=tmp_path, check=True, capture_output=True)
    assert (tmp_path / "there.html").read_bytes() == (tmp_path / "report.html").read_bytes()


def test_title_question_and_baseline_are_as_asked(here: Run, pipeline: Any, tmp_path: Path) -> None:
    given = [pipeline.runs["mean"], pipeline.runs["ucoi"]]
    asked = ("--title", "A title", "--question", "Does it <help>?", "--baseline", "mean")
    assert here("report", *given, *asked).code == 0
    page = (tmp_path / "report.html").read_text()
    assert "<h1>A title</h1>" in page
    assert "<title>A title</title>" in page
    assert "Does it &lt;help&gt;?" in page
    assert ">minus mean</th>" in page


def test_a_page_of_ours_is_made_anew_and_one_that_is_the_same_left_alone(
    here: Run, one: Path, tmp_path: Path
) -> None:
    page = tmp_path / "report.html"
    here("report", one)
    first = page.stat()
    again = here("report", one)
    assert (again.code, again.out) == (0, "report.html\n")
    assert "up to date" in again.err
    assert page.stat().st_ino == first.st_ino
    assert here("report", one, "--title", "Another").code == 0
    assert "<h1>Another</h1>" in page.read_text()
    assert [path.name for path in tmp_path.iterdir()] == ["report.html"]


def test_what_another_program_made_is_replaced_only_by_force(here: Run, one: Path, tmp_path: Path) -> None:
    page = tmp_path / "report.html"
    page.write_text("<!DOCTYPE html><title>mine</title>")
    refused = here("report", one)
    assert (refused.code, refused.out) == (4, "")
    assert "--force" in refused.err
    assert page.read_text() == "<!DOCTYPE html><title>mine</title>"
    assert here("report", one, "--force").code == 0
    assert "qinit report" in page.read_text()[:200]


def test_a_link_is_replaced_and_not_followed(here: Run, one: Path, tmp_path: Path) -> None:
    here("report", one, "-o", "there.html")
    (tmp_path / "report.html").symlink_to("there.html")
    before = (tmp_path / "there.html").read_bytes()
    assert here("report", one, "--title", "Another").code == 0
    assert not (tmp_path / "report.html").is_symlink()
    assert (tmp_path / "there.html").read_bytes() == before


@pytest.mark.parametrize(
    ("output", "words"), [("report.pdf", "ends in .html"), ("nowhere/report.html", "no folder")]
)
def test_a_page_that_cannot_go_there_is_a_usage_error(here: Run, one: Path, output: str, words: str) -> None:
    ended = here("report", one, "-o", output)
    assert (ended.code, ended.out) == (2, "")
    assert words in ended.err


def test_what_cannot_be_drawn_is_told_in_the_page(here: Run, pipeline: Any, tmp_path: Path) -> None:
    store = ("--store", tmp_path / "store", "-q")
    bare = here("fit", pipeline.sources, "--normality", "none", *store).path
    assert here("report", bare, "-o", "page.html").code == 0
    assert (tmp_path / "page.html").read_text().count("<figure ") == 1


def test_a_hostile_run_is_told_and_does_nothing(
    here: Run, pipeline: Any, hostile_run: Path, tmp_path: Path
) -> None:
    assert here("report", pipeline.runs["zero"], hostile_run).code == 0
    page = (tmp_path / "report.html").read_text()
    assert "<script" not in page
    assert "<img" not in page
    assert page.count("&lt;script&gt;alert(1)") > 5
