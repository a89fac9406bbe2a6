"""`qinit study init`: every example is a valid study, and that of the gridworld runs to its report."""

from __future__ import annotations

import json
import re
import tomllib
from collections.abc import Callable
from pathlib import Path
from typing import Any, get_args

import pytest

from qinit_cli.environments import FAMILIES
from qinit_cli.study.example import FILL_IN, example
from qinit_cli.study.planned import PlannedRun, PlannedShares, PlannedSources, PlannedTuning, ordered
from qinit_cli.study.questions import Question
from qinit_cli.study.reading import Study

QUESTIONS = get_args(Question)
MAPS = str(Path(__file__).parents[1] / "environments" / "maps")
OF = {"gym": "FrozenLake-v1", "tasks": MAPS}
Here = Callable[..., Any]


def _study(text: str, scale: str | None = None) -> Study:
    return Study.of(text, Path("s.toml"), scale)


def _shrunk(text: str) -> str:
    """The study with few and short tasks; every key of the file stays."""
    small = {"size": 5, "sets": 1, "episodes": 60}
    for key, value in small.items():
        text = re.sub(rf"^{key} = \S+", f"{key} = {value}", text, flags=re.MULTILINE)
    return re.sub(r"^tasks = \d+", "tasks = 10", text, flags=re.MULTILINE)


@pytest.mark.parametrize("family", FAMILIES)
@pytest.mark.parametrize("question", QUESTIONS)
def test_every_example_is_a_valid_study_of_every_family(question: Question, family: str) -> None:
    text = example(question, family, OF.get(family), "s.toml")
    told = tomllib.loads(text)
    whole, full = _study(text), _study(text, "full")
    for study in (whole, full):
        assert {type(one).__name__ for one in study.artefacts} >= {
            "PlannedSources",
            "PlannedFit",
            "PlannedRun",
        }
        assert "compare" in {one.name for one in study.shown} or question == "settings"
    methods = {one.method.label for one in whole.artefacts if isinstance(one, PlannedRun)}
    assert {"zero", "maxqinit", "logqinit-median"} <= methods
    assert any(isinstance(one, PlannedTuning) for one in ordered(whole.artefacts)) == (question == "methods")
    assert any(isinstance(one, PlannedShares) for one in whole.shown) == (question != "methods")
    assert told["distribution"][0]["family"] == family
    assert max(map(len, text.splitlines())) <= 132


def test_an_example_asks_what_its_question_says() -> None:
    def learned(question: Question) -> list[PlannedSources]:
        study = _study(example(question, "gridworld", None, "s.toml"))
        return [one for one in ordered(study.artefacts) if isinstance(one, PlannedSources)]

    assert {one.learning.tasks for one in learned("sources")} == {3, 10, 30}
    assert {one.learning.seed for one in learned("sources")} == {0, 1, 2, 3, 4}
    settings = {(one.family.variance, one.learning.epsilon) for one in learned("settings")}  # type: ignore[attr-defined]  # gridworld's
    assert settings == {(variance, epsilon) for variance in (1, 4, 10) for epsilon in (0.3, 0.7)}
    assert {one.learning.tasks for one in learned("methods")} == {30}


@pytest.mark.parametrize("question", QUESTIONS)
def test_what_stands_in_comments_is_valid_too(question: Question) -> None:
    text = example(question, "gridworld", None, "s.toml")
    shown = re.sub(r"^# (\[\[(?:plot|table|fit|method)\]\]|\w+ = )", r"\1", text, flags=re.MULTILINE)
    shown = shown.replace("# [verdicts]", "[verdicts]")
    assert shown.count("\n#") < text.count("\n#") - 5
    study = _study(shown)
    names = [one.name for one in study.shown]
    assert "compare" in names
    assert "verdicts" in names
    assert len(names) == 3


@pytest.mark.parametrize(("family", "key"), [("gym", "env-id"), ("tasks", "file")])
def test_a_family_that_needs_more_has_a_line_to_fill_in(
    family: str, key: str, here: Here, tmp_path: Path
) -> None:
    ended = here("study", "init", "--family", family)
    assert (ended.code, ended.out) == (0, "study.toml\n")
    lines = (tmp_path / "study.toml").read_text().splitlines()
    [number] = [at for at, line in enumerate(lines, 1) if FILL_IN in line]
    assert lines[number - 1].startswith(f"# {key} = ")
    assert f"study.toml, line {number} is to be filled in" in ended.err
    refused = here("study", "check", "study.toml")
    assert refused.code == 2
    assert key in refused.err

    filled = here("study", "init", "--family", family, "--of", OF[family], "--force", "-q")
    assert filled.err == ""
    told = tomllib.loads((tmp_path / "study.toml").read_text())
    assert told["distribution"][0][key] == OF[family]


def test_a_file_of_other_content_is_kept_without_force(here: Here, tmp_path: Path) -> None:
    file = tmp_path / "a study.toml"
    assert here("study", "init", "-o", file.name).out == "a study.toml\n"
    assert "qinit study run 'a study.toml'" in file.read_text()
    assert here("study", "init", "-o", file.name).code == 0  # the same content
    before = file.read_text()
    refused = here("study", "init", "sources", "-o", file.name)
    assert (refused.code, refused.out) == (4, "")
    assert "--force" in refused.err
    assert file.read_text() == before
    assert here("study", "init", "sources", "-o", file.name, "--force").code == 0
    assert file.read_text() == example("sources", "gridworld", None, file.name)


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("--family", "gridwrld"), "did you mean gridworld?"),
        (("--family", "imported"), "there is no family imported to draw tasks from"),
        (("--of", "FrozenLake-v1"), "gridworld needs no file and no id"),
        (("--family", "gym", "--of", "a\nb"), "characters that cannot be printed"),
        (("method",), "methods"),
    ],
)
def test_what_cannot_be_meant_is_refused(
    words: tuple[str, ...], said: str, here: Here, tmp_path: Path
) -> None:
    ended = here("study", "init", *words)
    assert ended.code == 2
    assert said in ended.err
    assert not (tmp_path / "study.toml").exists()


def test_an_unusual_id_is_quoted() -> None:
    for of in ('a"b', "a\\b", "größe $x", "'"):
        text = example("methods", "gym", of, "s.toml")
        assert tomllib.loads(text)["distribution"][0]["env-id"] == of


def test_the_first_example_runs_to_its_report(here: Here, tmp_path: Path) -> None:
    here("study", "init")
    file = tmp_path / "study.toml"
    file.write_text(_shrunk(file.read_text()))
    ended = here("study", "run", file, "-q")
    assert (ended.code, ended.out, ended.err) == (0, "study-results\n", "")
    told = json.loads((tmp_path / "study-results" / "study.json").read_text())
    assert told["complete"]
    [table] = told["tables"]
    rows = json.loads((tmp_path / "study-results" / table["file"]).read_text())["rows"]
    assert [row["method"] for row in rows] == [
        "zero",
        "mean",
        "maxqinit",
        "logqinit-median",
        "ptrs",
        "ops-tl",
        "posterior",
        "logqinit-quantile tuned",
    ]
    assert (tmp_path / "study-results" / "report.html").stat().st_size > 5_000
