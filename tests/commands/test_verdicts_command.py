"""What `qinit verdicts` prints: a row a claim, or a row a setting."""

from __future__ import annotations

import csv
import io
import json
from collections.abc import Callable
from typing import Any

import pytest

Run = Callable[..., Any]
ANSWERS = {"holds", "does not hold", "depends", "not judged"}


def test_json_has_a_verdict_on_every_claim_with_its_rows(here: Run, pipeline: Any) -> None:
    ended = here("verdicts", pipeline.sources, pipeline.fit, *pipeline.runs.values(), "--json")
    assert ended.code == 0, ended.err
    told = json.loads(ended.out, parse_constant=pytest.fail)
    assert told["schema"] == "qinit.verdicts/1"
    assert [row["claim"] for row in told["rows"]] == [f"C{number}" for number in range(1, 14)]
    assert {row["verdict"] for row in told["rows"]} <= ANSWERS
    [best] = [row for row in told["rows"] if row["claim"] == "C4"]
    assert {
        "statement",
        "source",
        "statistic",
        "value",
        "low",
        "high",
        "sets",
        "depends_on",
        "sentence",
    } <= best.keys()
    assert {"label", "value", "low", "high", "sets", "holds"} == best["details"][0].keys()


def test_a_pipe_gets_one_row_a_claim_and_details_one_row_a_setting(here: Run, pipeline: Any) -> None:
    ended = here("verdicts", *pipeline.runs.values())
    rows = list(csv.DictReader(io.StringIO(ended.out), delimiter="\t"))
    assert len(rows) == 13
    assert rows[12]["verdict"] == "does not hold"
    detailed = here("verdicts", *pipeline.runs.values(), "--details", "--claim", "C4", "--format", "csv")
    settings = list(csv.DictReader(io.StringIO(detailed.out)))
    assert {row["claim"] for row in settings} == {"C4"}
    assert any(row["label"].endswith("logqinit-median minus zero") for row in settings)


def test_markdown_is_a_table_of_claims_and_findings(here: Run, pipeline: Any) -> None:
    lines = here("verdicts", pipeline.sources, "--format", "markdown").out.splitlines()
    assert lines[0] == "| claim | the paper's claim | verdict | number | source sets | what was found |"
    assert len(lines) == 15


def test_people_read_the_sentence(here: Run, pipeline: Any) -> None:
    out = here("verdicts", pipeline.sources, "--format", "table", "--claim", "C13").out
    assert "does not hold" in out
    assert "0.00507" in out


def test_references_come_on_stdin(here: Run, pipeline: Any) -> None:
    assert here("verdicts", "-", stdin=f"{pipeline.sources}\n{pipeline.fit}\n").code == 0


def test_an_unknown_claim_is_refused_with_those_there_are(here: Run, pipeline: Any) -> None:
    ended = here("verdicts", pipeline.sources, "--claim", "C14")
    assert ended.code == 2
    assert "C14" in ended.err
    assert "C13" in ended.err
