"""`qinit tune`: a choice that is kept, printed, and taken by transfer."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import h5py
import numpy as np
import pytest
from running import run_here

from qinit_store.reading import open_artefact

if TYPE_CHECKING:
    from running import Ended, Pipeline

Here = Callable[..., "Ended"]
SHORT = ("--episodes", "40", "--quantile", "0.1,0.9")


@pytest.fixture(scope="module")
def sources(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("tune") / "sources.h5"
    ended = run_here(
        [
            "train-sources",
            "gridworld",
            "--size",
            "6",
            "--variance",
            "2",
            "--tasks",
            "12",
            "--learner",
            "exact",
            "-o",
            str(path),
        ]
    )
    assert ended.code == 0, ended.err
    return path


def test_the_curve_is_printed_and_the_choice_is_taken_by_transfer(here: Here, sources: Path) -> None:
    told = here("tune", "logqinit-quantile", sources, *SHORT, "--json").json
    assert [row["quantile"] for row in told["rows"]] == sorted([0.1, 0.15865525393145707, 0.9])
    [best] = [row for row in told["rows"] if row["chosen"]]
    assert best["average"] == max(row["average"] for row in told["rows"])
    assert told["choice"] == {"quantile": best["quantile"]}
    fit = here("fit", sources).path
    tuned = here(
        "transfer", "logqinit-quantile", fit, "--tasks", "3", "--episodes", "30", "--tuned", told["path"]
    )
    given = here(
        "transfer",
        "logqinit-quantile",
        fit,
        "--tasks",
        "3",
        "--episodes",
        "30",
        "--quantile",
        best["quantile"],
    )
    assert tuned.code == given.code == 0, tuned.err
    assert tuned.out == given.out


def test_the_same_choice_again_is_complete(here: Here, sources: Path) -> None:
    first = here("tune", "logqinit-quantile", sources, *SHORT, "--json", "--jobs", "1").json
    again = here("tune", "logqinit-quantile", sources, *SHORT, "--json", "--jobs", "2")
    assert again.json == first
    other = here("tune", "logqinit-quantile", sources, *SHORT, "--json", "-o", "other.h5", "--jobs", "2").json
    assert other["digest"] == first["digest"]


def test_the_artefact_is_shown_listed_exported_and_verified(here: Here, sources: Path) -> None:
    path = here("tune", "logqinit-quantile", sources, *SHORT, "--json").json["path"]
    numbers = here("show", path, "--json").json["numbers"]
    assert numbers["sources"] == 12
    assert numbers["candidates"] == 3
    assert "tuning" in here("list", "--kind", "tuning").out
    assert here("verify", path).code == 0
    assert here("export", path, "-o", "averages.csv").code == 0
    header, *lines = Path("averages.csv").read_text().splitlines()
    assert {"task", "candidate", "quantile", "average"} <= set(header.split(","))
    assert len(lines) == 12 * 3


@pytest.mark.parametrize(
    ("arguments", "code", "part"),
    [
        (("logqinit-quantile", "--quantile", "0.1;0.2"), 2, "write numbers with commas"),
        (("logqinit-quantile", "--quantile", "2"), 2, "--quantile is 2.0"),
        (("posterior", "--freeze", "1,2.5"), 2, "--freeze is 2.5; it must be a whole number"),
        (("posterior", "--floor", "-1"), 2, "--floor is -1.0"),
        (("posterior", "--threshold", "3,1"), 2, "--threshold is 3.0; it must be from 0 to 2"),
        (("ops-tl", "--c", ",".join(map(str, range(200)))), 2, "these are 4001 combinations"),
        (("ucoi", "--episodes", str(2**63)), 2, "the steps cannot be counted"),
        (("ucoi", "--jobs", "1000000000"), 2, "--jobs is 1000000000; it must be from 1 to 1024"),
        (("maxqinit",), 2, "maxqinit"),
    ],
)
def test_what_cannot_be_meant_is_refused(
    arguments: tuple[str, ...], code: int, part: str, here: Here, sources: Path
) -> None:
    method, *options = arguments
    ended = here("tune", method, sources, *options)
    assert ended.code == code
    assert part in ended.err


def test_too_few_sources_are_refused(here: Here, pipeline: Pipeline) -> None:
    ended = here("tune", "ucoi", pipeline.sources)
    assert ended.code == 4
    assert "tune needs at least 10" in ended.err


def test_a_choice_of_another_method_or_distribution_is_refused(
    here: Here, sources: Path, pipeline: Pipeline
) -> None:
    path = here("tune", "ucoi", sources, "--episodes", "20", "--kappa", "1", "--json").json["path"]
    fit = here("fit", sources).path
    wrong = here("transfer", "logqinit-quantile", fit, "--tuned", path)
    assert (wrong.code, "of ucoi, not of logqinit-quantile" in wrong.err) == (4, True)
    both = here("transfer", "ucoi", fit, "--kappa", "3", "--tuned", path)
    assert (both.code, "leave one of them out" in both.err) == (2, True)
    elsewhere = here(
        "train-sources", "gridworld", "--size", "6", "--variance", "1", "--tasks", "4", "--learner", "exact"
    )
    other = here("transfer", "ucoi", here("fit", elsewhere.path).path, "--tuned", path)
    assert (other.code, "tune its own sources" in other.err) == (4, True)


def _spec(path: str | Path) -> dict[str, Any]:
    with open_artefact(Path(path), "tuning") as artefact:
        return dict(artefact.spec)


def test_what_is_asked_to_vary_does_and_all_else_has_one_value(here: Here, sources: Path) -> None:
    plain = here("tune", "posterior", sources, "--episodes", "5", "--json").json
    grid = _spec(plain["path"])["grid"]
    assert grid == {"temperature": [0, 0.0005, 0.002, 0.01, 0.05, 0.2], "freeze": [1, 3, 30, 300]}
    assert _spec(plain["path"])["method"]["floor"] == 0.01
    asked = here(
        "tune", "posterior", sources, "--episodes", "5", "--temperature", "0.1", "--freeze", "1,2",
        "--floor", "0.02", "--json",
    )  # fmt: skip
    told = asked.json
    spec = _spec(told["path"])
    assert spec["grid"] == {"temperature": [0.1], "freeze": [1, 2]}
    assert (spec["method"]["floor"], spec["method"]["freeze"]) == (0.02, 3)
    rows = [(row["temperature"], row["freeze"], row["default"]) for row in told["rows"]]
    assert rows == [(0.05, 3, True), (0.1, 1, False), (0.1, 2, False)]


def test_all_that_a_choice_was_made_with_is_taken_by_transfer(here: Here, sources: Path) -> None:
    options = ("--mixing", "geometric", "--floor", "0.02")
    told = here("tune", "posterior", sources, "--episodes", "40", "--temperature", "1", "--freeze", "1,9", *options,
             "--json").json  # fmt: skip
    fit = here("fit", sources).path
    targets = ("transfer", "posterior", fit, "--tasks", "3", "--episodes", "30")
    tuned = here(*targets, "--tuned", told["path"])
    chosen = [word for name, value in told["choice"].items() for word in (f"--{name}", f"{value:g}")]
    typed = here(*targets, *options, *chosen)
    assert tuned.code == 0, tuned.err
    assert tuned.out == typed.out
    other = here(*targets, "--floor", "0.3", "--tuned", told["path"])
    assert (other.code, "--floor and --tuned both say what floor is" in other.err) == (2, True)


def test_what_a_method_starts_from_is_part_of_the_choice(here: Here, sources: Path) -> None:
    plus = ("--init", "logqinit-median")
    told = here(
        "tune", "ops-tl", sources, "--episodes", "20", "--rho", "0.9", "--nu", "0.5", *plus, "--json"
    ).json
    run = here(
        "transfer",
        "ops-tl",
        here("fit", sources).path,
        "--tasks",
        "2",
        "--episodes",
        "9",
        "--tuned",
        told["path"],
    )
    with open_artefact(run.path, "run") as artefact:
        assert artefact.spec["method"]["init"]["name"] == "logqinit-median"


def test_the_best_at_an_end_of_what_was_tried_is_told(here: Here, sources: Path) -> None:
    arguments = ("tune", "logqinit-quantile", sources, "--episodes", "30", "--json")
    ended = here(
        *arguments, "--quantile", "0.9999,0.99999"
    )  # bad starts: the default is the smallest, and the best
    assert ended.json["edges"] == {"quantile": "smallest"}
    assert "--quantile 0.158655 is the smallest value tried; try smaller ones" in ended.err
    assert "the default, --quantile 0.158655, is the best of 3" in ended.err


def test_a_trial_tells_what_tuning_would_take_and_makes_nothing(here: Here, sources: Path) -> None:
    arguments = ("tune", "ucoi", sources, "--episodes", "50", "--store", "nothing-yet")
    told = here(*arguments, "--dry-run", "--json").json
    assert (told["tasks"], told["missing"]) == (12, 12)
    assert not Path("nothing-yet").exists()
    made = here(*arguments, "--json").json["path"]
    with h5py.File(made) as file:
        taken = int(np.sum(file["steps"]))
    assert 0.3 * taken < told["steps"] < 3 * taken
    assert here(*arguments, "--dry-run", "--json").json["missing"] == 0


def test_a_table_at_eighty_columns_is_whole_and_marks_default_and_choice(
    here: Here, sources: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("COLUMNS", "80")
    ended = here("tune", "posterior", sources, "--episodes", "20", "--freeze", "1,3", "--format", "table")
    lines = ended.out.splitlines()
    assert max(map(len, lines)) <= 80
    assert all(
        heading in lines[1] for heading in ("--temperature", "--freeze", "minus default", "default", "chosen")
    )
    assert sum(line.rstrip().endswith("yes") for line in lines) in (1, 2)  # the default may be the choice
