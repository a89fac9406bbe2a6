"""What tasks draw: distributions as scipy has them, listed values, and the rows of files."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import scipy.stats

from qinit_cli.environments.family import draw_tasks
from qinit_cli.environments.gym import Gym
from qinit_cli.environments.variation import Variation
from qinit_cli.errors import NotAllowed, UsageError
from qinit_cli.seeding import Stream, generator


def drawn(text: str, count: int) -> list[float | int]:
    variation = Variation.read(text)
    return [
        variation.draw(generator(0, Stream.SOURCE_TASK, index), index, "source") for index in range(count)
    ]


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("x=truncnorm:1,2,0,2.5", scipy.stats.truncnorm(-0.5, 0.75, 1, 2)),
        ("x=loguniform:0.01,10", scipy.stats.loguniform(0.01, 10)),
        ("x=uniform:-1,3", scipy.stats.uniform(-1, 4)),
        ("x=normal:-1,3", scipy.stats.norm(-1, 3)),
    ],
)
def test_numbers_are_distributed_as_scipy_has_it(text: str, expected: Any) -> None:
    found = drawn(text, 2000)
    low, high = Variation.read(text).values.bounds
    assert scipy.stats.kstest(found, expected.cdf).pvalue > 0.01
    if low is not None and high is not None:
        assert (low, high) == tuple(expected.support())
        assert low <= min(found) < max(found) <= high


def test_whole_numbers_include_both_ends_and_listed_values_are_as_likely_as_each_other() -> None:
    whole = drawn("x=integer:-1,2", 400)
    assert set(whole) == {-1, 0, 1, 2}
    listed = drawn("x=choice:0.5|2|7", 300)
    counts = np.unique(listed, return_counts=True)
    assert counts[0].tolist() == [0.5, 2, 7]
    assert scipy.stats.chisquare(counts[1]).pvalue > 0.01


@pytest.mark.parametrize(
    ("text", "dtype", "number", "given"),
    [
        ("x=integer:3,3", "<i8", 3, 3),
        ("x=choice:1|2", "<i8", 2, 2),
        ("x=choice:1|2.0", "<f8", 1, 1.0),
        ("x=choice:4x4|8x8", "<i8", 1, "8x8"),
        ("x=choice:True|False", "<i8", 1, False),
        ("x=choice:['SF']|['FG']", "<i8", 0, ["SF"]),
    ],
)
def test_what_is_drawn_becomes_what_was_written(text: str, dtype: str, number: float, given: Any) -> None:
    variation = Variation.read(text)
    assert variation.values.dtype == dtype
    value = variation.value(number)
    assert (value, type(value)) == (given, type(given))


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("x=integer:1.5,2", "LOW and HIGH are whole numbers"),
        ("x=integer:2,1", "LOW is above HIGH"),
        ("x=loguniform:0,1", "LOW must be above 0"),
        ("x=truncnorm:0,1,9,10", "less than one draw in 100"),
        ("x=truncnorm:0,1,2", "write NAME=truncnorm:MEAN,STD,LOW,HIGH"),
        ("x=choice:1|2|1", "a value is given twice"),
        ("x=choice:1", r"write NAME=choice:A\|B\|..."),
        ("x=file:", "write NAME=file:PATH"),
        ("x=normal:nan,1", "the numbers must be finite"),
        ("x=poisson:1", r"write NAME=normal:MEAN,STD or .* or NAME=choice:A\|B\|... or .* or NAME=file:PATH"),
    ],
)
def test_what_cannot_be_drawn_is_refused_in_a_sentence(text: str, told: str) -> None:
    with pytest.raises(ValueError, match=told):
        Variation.read(text)


TABLE = "success_rate,map_name,split\n0.5,4x4,source\n0.6,4x4,target\n0.75,4x4,source\n0.9,4x4,target\n"


def rows(family: Gym, stream: Stream, count: int) -> list[tuple[Any, ...]]:
    drawn: list[tuple[Any, ...]] = draw_tasks(family, 0, stream, np.arange(count)).tolist()
    return drawn


def test_a_file_gives_each_task_a_row_and_sources_others_than_targets(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("told.csv").write_text(TABLE)
    lines = [{"success_rate": 0.1 * row, "map_name": "4x4" if row < 4 else None} for row in range(5)]
    Path("turns.jsonl").write_text("\n".join(map(json.dumps, lines)))
    both = ["success_rate=file:{}", "map_name=file:{}"]
    told = Gym(env_id="FrozenLake-v1", vary=[each.format("told.csv") for each in both])
    assert rows(told, Stream.SOURCE_TASK, 2) == [(0.5, 0), (0.75, 2)]
    assert rows(told, Stream.TARGET_TASK, 2) == [(0.6, 1), (0.9, 3)]
    turns = Gym(env_id="FrozenLake-v1", vary=[each.format("./turns.jsonl") for each in both])
    assert rows(turns, Stream.SOURCE_TASK, 3) == [(0.0, 0), (0.2, 2), (0.4, 4)]
    assert rows(turns, Stream.TARGET_TASK, 2) == [(0.1, 1), (pytest.approx(0.3), 3)]
    assert [Variation.read(turns.vary[1]).value(row) for row in (2, 4)] == ["4x4", None]  # type: ignore[index]  # given
    with pytest.raises(NotAllowed, match=r"turns\.jsonl has 2 rows for targets, and task 3 was asked for"):
        rows(turns, Stream.TARGET_TASK, 3)
    stored = told.opened().vary
    digest = hashlib.sha256(TABLE.encode()).hexdigest()
    assert stored == (
        f"success_rate=file:told.csv@float:sha256:{digest}",
        f"map_name=file:told.csv@row:sha256:{digest}",
    )


def test_contexts_as_carl_keeps_them_are_rows(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    contexts = {"0": {"success_rate": 0.5}, "1": {"success_rate": 0.6}, "2": {"success_rate": 0.75}}
    Path("contexts.json").write_text(json.dumps(contexts))
    each = Gym(env_id="FrozenLake-v1", vary=["success_rate=file:contexts.json"])
    assert rows(each, Stream.SOURCE_TASK, 2) == [(0.5,), (0.75,)]
    assert rows(each, Stream.TARGET_TASK, 1) == [(0.6,)]
    whole = Variation.read("contexts=file:contexts.json")
    assert whole.value(2) == {"2": {"success_rate": 0.75}}
    Path("contexts.json").write_text("[1]")
    with pytest.raises(UsageError, match="it is no object of objects"):
        Gym(env_id="FrozenLake-v1", vary=["success_rate=file:contexts.json"]).opened()


@pytest.mark.parametrize(
    ("content", "told"),
    [
        ("a,b\n1,2\n", "there is no column x; its columns are a, b"),
        ("x,b\n1\n", "a row has more or fewer fields than the header"),
        ("x,split\n1,train\n", "row 0 of tasks.csv has the split 'train'; write source or target"),
        ("x\n", "tasks.csv has no rows"),
        ("\xff", "tasks.csv is no CSV with a header"),
        (None, "tasks.csv cannot be read"),
    ],
)
def test_a_file_that_lists_no_tasks_is_refused_in_a_sentence(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, content: str | None, told: str
) -> None:
    monkeypatch.chdir(tmp_path)
    if content is not None:
        Path("tasks.csv").write_bytes(content.encode("latin-1"))
    with pytest.raises(UsageError, match=told):
        Gym(env_id="FrozenLake-v1", vary=["x=file:tasks.csv"]).opened()


def test_a_file_is_known_by_its_digest_and_its_rows_by_their_number(
    here: Callable[..., Any], tmp_path: Path
) -> None:
    table = tmp_path / "told.csv"
    table.write_text(TABLE)
    learn = (
        "train-sources",
        "gym",
        "FrozenLake-v1",
        "--vary",
        "success_rate=file:told.csv",
        "--learner",
        "exact",
    )
    beyond = here(*learn, "--tasks", 3)
    assert (beyond.code, beyond.out) == (2, "")
    assert "--tasks is 3, and " in beyond.err
    assert "has 2 sources; ask for fewer" in beyond.err
    assert beyond.err.count("\n") == 1
    fit = here("fit", here(*learn, "-q").path, "-q").path
    transfer = ("transfer", "zero", fit, "--tasks", 2, "--episodes", 5, "-q")
    run = here(*transfer)
    assert run.code == 0, run.err
    table.write_text(TABLE + "0.3,4x4,source\n")
    changed = here(*transfer, "--seed", 1)
    assert (changed.code, changed.out) == (4, "")
    assert "told.csv is not the file any more from which tasks were drawn" in changed.err
    table.unlink()
    assert here("verify", run.path).code == here("compare", run.path).code == 0  # no task is drawn again
