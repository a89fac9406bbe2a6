"""Tables in every format, read back."""

from __future__ import annotations

import csv
import io
import json
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from qinit_cli.comparison.runs import ComparedRun
from qinit_store.reading import open_artefact

Here = Callable[..., Any]


@pytest.fixture
def compared(here: Here, pipeline: Any) -> Callable[..., Any]:
    """`qinit compare` of zero, maxqinit and logqinit-median."""
    runs = [pipeline.runs[name] for name in ("zero", "maxqinit", "logqinit-median")]

    def call(*words: str) -> Any:
        ended = here("compare", *runs, *words)
        assert ended.code == 0, ended.err
        return ended

    return call


def _rows(text: str, delimiter: str) -> list[dict[str, str]]:
    return list(csv.DictReader(io.StringIO(text), delimiter=delimiter))


def test_tsv_csv_json_and_jsonl_hold_the_same_rows(compared: Callable[..., Any]) -> None:
    told = compared("--format", "json").json
    assert told["schema"].startswith("qinit.compare/")
    [interval] = [group["over"] for group in told["intervals"]]
    assert "conditional on this source set" in interval
    rows = told["rows"]
    lines = [json.loads(line) for line in compared("--format", "jsonl").out.splitlines()]
    assert [{**row, "schema": told["schema"]} for row in rows] == lines
    for delimiter, words in (("\t", ("--format", "tsv")), (",", ("--format", "csv")), ("\t", ())):
        read = _rows(compared(*words).out, delimiter)
        assert len(read) == len(rows) == 3
        for found, row in zip(read, rows, strict=True):
            assert list(found) == list(row)
            for name, value in row.items():
                assert found[name] == ("" if value is None else str(value)), name


def test_p_that_cannot_be_small_is_nowhere_and_one_line_says_why(compared: Callable[..., Any]) -> None:
    why = (
        "p: at least 7 targets are needed for the sign-flip test over 2 methods to reach 0.05"  # there are 4
    )
    ended = compared("--format", "json")
    told = ended.json
    assert [row["p"] for row in told["rows"]] == [None] * 3
    assert [one["untested"] for one in told["intervals"]] == [why]
    assert ended.err.count(why) == 1
    assert [row["p"] for row in _rows(compared("--format", "csv").out, ",")] == [""] * 3
    shown = compared("--format", "table", "--columns", "p")
    assert why in " ".join((shown.out + shown.err).split())
    assert "1.0000" not in shown.out


def test_json_is_the_same_as_format_json(compared: Callable[..., Any]) -> None:
    assert compared("--json").out == compared("--format", "json").out


def test_markdown_is_a_table_of_equal_rows(compared: Callable[..., Any]) -> None:
    heading, rule, *rows = compared("--format", "markdown").out.splitlines()
    assert set(rule) <= set("|- :")
    assert {line.count("|") for line in (heading, rule, *rows)} == {heading.count("|")}
    assert [row.split("|")[1 + _place(heading, "method")].strip() for row in rows] == [
        "zero",
        "maxqinit",
        "logqinit-median",
    ]


def _place(heading: str, name: str) -> int:
    return [each.strip() for each in heading.split("|")[1:]].index(name)


def test_the_average_return_is_that_of_the_stored_episodes(
    compared: Callable[..., Any], pipeline: Any
) -> None:
    rows = compared("--json").json["rows"]
    averages = {}
    for row in rows:
        with open_artefact(pipeline.runs[row["method"]], "run") as artefact:
            run = ComparedRun.from_artefact(artefact)
        returns = np.where(run.reached, 0.95 ** (run.steps - 1.0), 0)
        averages[row["method"]] = returns.mean()
        assert row["return"] == pytest.approx(returns.mean())
        assert row["jumpstart"] == pytest.approx(returns[:, :10].mean())
        assert row["asymptotic"] == pytest.approx(returns[:, -6:].mean())
        assert row["success"] == pytest.approx(run.reached.mean())
        assert row["restricted_steps"] == pytest.approx(run.steps.mean())
        assert row["return_low"] <= row["return"] <= row["return_high"]
    for row in rows[1:]:
        assert row["difference"] == pytest.approx(averages[row["method"]] - averages["zero"])
    assert rows[0]["difference"] is None


@pytest.mark.parametrize("metric", ["return", "success", "steps"])
def test_the_metric_names_its_column(metric: str, compared: Callable[..., Any]) -> None:
    [zero, *_] = compared("--metric", metric, "--json").json["rows"]
    assert zero[metric] == pytest.approx(
        zero[{"return": "return", "success": "success"}.get(metric, "restricted_steps")]
    )


def test_another_baseline_turns_the_difference_round(compared: Callable[..., Any]) -> None:
    to_zero = compared("--json").json["rows"]
    to_max = compared("--baseline", "maxqinit", "--json").json["rows"]
    assert to_max[0]["difference"] == pytest.approx(-to_zero[1]["difference"])
    assert to_max[1]["difference"] is None


METRICS = (
    "transfer_ratio",
    "time_to_threshold",
    "restricted_mean_time_to_threshold",
    "iqm",
    "probability_of_improvement",
    "regret",
)


def test_every_metric_and_its_interval_stands_in_every_format_for_programs(
    compared: Callable[..., Any],
) -> None:
    names = [f"{metric}{end}" for metric in METRICS for end in ("", "_low", "_high")]
    names += ["censored", "negative_transfer"]
    heads = {style: compared("--format", style).out.splitlines()[0] for style in ("tsv", "csv", "jsonl")}
    assert set(names) <= set(heads["tsv"].split("\t"))
    assert set(names) <= set(heads["csv"].split(","))
    assert set(names) <= json.loads(heads["jsonl"]).keys()
    rows = compared("--json").json["rows"]
    assert rows[0]["transfer_ratio"] is rows[0]["probability_of_improvement"] is None
    for row in rows[1:]:
        assert 0 <= row["probability_of_improvement"] <= 1
        assert row["negative_transfer"] == (row["difference_high"] < 0)


def test_chosen_columns_stand_alone_and_in_that_order(compared: Callable[..., Any]) -> None:
    [zero, *_] = compared("--columns", "iqm, p", "--json").json["rows"]
    assert list(zero) == ["targets", "sets", "method", "iqm", "iqm_low", "iqm_high", "p"]
    heading = next(
        line
        for line in compared("--columns", "iqm,p", "--format", "table").out.splitlines()
        if "method" in line
    )
    assert heading.split() == ["method", "IQM", "p"]


def test_a_column_that_is_not_there_is_refused_with_the_nearest(here: Here, pipeline: Any) -> None:
    ended = here("compare", pipeline.runs["zero"], "--columns", "sucess")
    assert (ended.code, ended.out) == (2, "")
    assert "did you mean success?" in ended.err


def test_negative_transfer_is_said_beneath_the_table(compared: Callable[..., Any]) -> None:
    rows = compared("--json").json["rows"]
    text = " ".join(compared("--format", "table").out.split())
    [sentence] = re.findall(r"negative transfer: (.*?) worse than learning from zero", text) or [""]
    for row in rows:
        assert (row["method"] in sentence) == bool(row["negative_transfer"])
    other = compared("--format", "table", "--baseline", "maxqinit").out
    assert "negative transfer" not in other


def test_without_a_run_of_the_baseline_a_note_names_the_command_that_makes_one(
    here: Here, pipeline: Any
) -> None:
    ended = here("compare", pipeline.runs["maxqinit"], "--json")
    assert "qinit transfer zero" in ended.err
    assert ended.json["rows"][0]["difference"] is None


def test_privileged_methods_are_marked(here: Here, pipeline: Any) -> None:
    made = here("transfer", "optimal", pipeline.fit, "--tasks", 4, "--episodes", 60, "-q").path
    for style in ("tsv", "table", "markdown", "json"):
        lines = here("compare", made, pipeline.runs["zero"], "--format", style, "-q").out
        assert "privileged" in lines, style


def test_runs_of_one_file_name_in_two_folders_are_both_compared(
    here: Here, pipeline: Any, tmp_path: Path
) -> None:
    for folder, method in (("a", "zero"), ("b", "maxqinit")):
        (tmp_path / folder).mkdir()
        (tmp_path / folder / "run.h5").write_bytes(pipeline.runs[method].read_bytes())
    rows = here("compare", "a/run.h5", "b/run.h5", "--baseline", "a/run", "--json").json["rows"]
    assert [row["method"] for row in rows] == ["zero", "maxqinit"]
    assert rows[0]["difference"] is None
    assert rows[1]["difference"] is not None


def test_one_run_under_two_names_counts_once(here: Here, pipeline: Any, tmp_path: Path) -> None:
    (tmp_path / "copy.h5").write_bytes(pipeline.runs["zero"].read_bytes())
    rows = here("compare", pipeline.runs["zero"], "copy.h5", "--json").json["rows"]
    assert [row["method"] for row in rows] == ["zero"]


@pytest.mark.parametrize("gamma", [1, 1e-9])
def test_greedy_evaluations_are_counted_where_their_returns_do_not_tell_the_steps(
    gamma: float, here: Here, pipeline: Any
) -> None:
    words = ("--tasks", 4, "--episodes", 60, "--evaluate-every", 20, "--gamma", gamma, "-q")
    made = here("transfer", "maxqinit", pipeline.fit, *words).path
    with open_artefact(made, "run") as artefact:
        steps, reached = artefact.read("eval_steps"), artefact.read("eval_reached")
    [row] = here("compare", made, "--greedy", "--metric", "steps", "-q", "--json").json["rows"]
    assert row["steps"] == steps.mean()
    assert row["success"] == reached.mean() > 0


def test_runs_without_greedy_evaluations_are_refused_with_the_option_that_makes_them(
    here: Here, pipeline: Any
) -> None:
    ended = here("compare", pipeline.runs["zero"], "--greedy")
    assert (ended.code, ended.out) == (4, "")
    assert "--evaluate-every" in ended.err


def test_runs_of_other_targets_stand_in_tables_of_their_own(here: Here, pipeline: Any) -> None:
    other = here("transfer", "zero", pipeline.fit, "--tasks", 3, "--episodes", 60, "--seed", 1, "-q").path
    ended = here("compare", pipeline.runs["zero"], other, pipeline.runs["maxqinit"], "--json")
    rows = ended.json["rows"]
    assert [row["targets"].split(", ", 1)[1] for row in rows] == [
        "4 targets of seed 0, 60 episodes",
        "4 targets of seed 0, 60 episodes",
        "3 targets of seed 1, 60 episodes",
    ]


def test_the_list_names_every_artefact_with_its_kind_and_tasks(here: Here, pipeline: Any) -> None:
    rows = here("list", "--store", pipeline.store, "--format", "json").json["rows"]
    named = {row["name"]: row for row in rows}
    assert named[pipeline.sources.stem]["kind"] == "sources"
    assert named[pipeline.fit.stem]["kind"] == "fit"
    assert {row["kind"] for row in rows} == {"sources", "fit", "run"}
    assert {row["family"] for row in rows} == {"gridworld"}
    assert {row["tasks"] for row in rows} == {4}
    assert {row["state"] for row in rows} == {"done"}
    assert len(rows) == 2 + len(pipeline.runs)


def test_an_empty_store_is_an_empty_table_and_a_hint(here: Here) -> None:
    ended = here("list", "--format", "json")
    assert (ended.code, ended.json["rows"]) == (0, [])
    assert "qinit train-sources" in ended.err


def test_a_file_that_is_no_artefact_is_listed_as_such(here: Here, tmp_path: Any) -> None:
    (tmp_path / "qinit-store" / "fits").mkdir(parents=True)
    (tmp_path / "qinit-store" / "fits" / "odd.h5").write_text("no artefact")
    [row] = here("list", "--json").json["rows"]
    assert row["state"] == "foreign"
