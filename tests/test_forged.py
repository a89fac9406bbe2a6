"""Files whose digests hold and whose numbers or settings cannot be: refused before anything is made of them."""

from __future__ import annotations

import json
import math
import os
import random
import shutil
import signal
from collections.abc import Callable
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
from forging import LIBVER, forge, give, mend, put, settle
from running import SMALL_SOURCES, Ended, Pipeline, run_here

SOURCES = [
    ("goal_row", 0, 1_000_000),
    ("goal_row", 0, -5),
    ("goal_col", 1, 6),
    ("p", 2, math.nan),
    ("p", 0, -3.0),
    ("q", (0, 0, 0, 0), math.nan),
    ("q", (3, 1, 1, 1), -math.inf),
    ("q", (3, 1, 1, 1), 1e308),
    ("td_var", (0, 0, 0, 0), -1.0),
    ("visits", (0, 0, 0, 0), -5),
    ("eopl", (1, 2, 3, 0), -(2**31)),
    ("eopl", (1, 2, 3, 0), 2**31 - 1),
    ("solved", 0, 7),
    ("steps", 0, -1),
    ("curve_reached", (0, 0), 1.5),
    ("curve_steps", (0, 0), math.inf),
    ("seconds", 0, 1e308),
]


@pytest.mark.parametrize(("name", "where", "value"), SOURCES)
def test_sources_with_a_value_that_cannot_be_are_refused_and_told(
    here: Callable[..., Ended], pipeline: Pipeline, tmp_path: Path, name: str, where: Any, value: Any
) -> None:
    path = put(pipeline.sources, tmp_path / "forged.h5", name, where, value)
    for command in (("show", path), ("fit", path), ("export", path, "--to", "json", "-o", "x.json")):
        ended = here(*command)
        assert (ended.code, ended.out) == (6, "")
        assert f"{name} is " in ended.err


def test_verify_names_such_a_task_and_salvage_leaves_it_out(
    here: Callable[..., Ended], pipeline: Pipeline, tmp_path: Path
) -> None:
    path = put(pipeline.sources, tmp_path / "forged.h5", "q", (2, 0, 0, 0), math.nan)
    verified = here("verify", path, "--format", "json")
    assert verified.code == 6
    [row] = verified.json["rows"]
    assert (row["state"], row["damaged_tasks"]) == ("damaged", "2")
    salvaged = here("salvage", path, "-o", "kept.h5", "--json")
    assert salvaged.json["lost"] == [2]


def test_growing_takes_no_such_task_over(
    here: Callable[..., Ended], pipeline: Pipeline, tmp_path: Path
) -> None:
    (tmp_path / "store" / "sources").mkdir(parents=True)
    put(pipeline.sources, tmp_path / "store" / "sources" / "forged.h5", "q", (2, 0, 0, 0), 1e308)
    more = [word if word != "4" else "5" for word in SMALL_SOURCES]
    grown = here("train-sources", *more, "--store", "store", "--json")
    assert grown.code == 0
    assert "nothing is taken over" in grown.err
    assert grown.json["skipped"] == 0


@pytest.mark.parametrize(
    ("name", "where", "value"),
    [
        ("mu", (0, 0, 0), math.inf),
        ("n", (0, 0, 0), -1),
        ("n", (0, 0, 0), 5),
        ("max", (0, 0, 0), 1e308),
        ("library_q", (0, 0, 0, 0), math.nan),
        ("library_task", 0, 4),
        ("value_mean", (0, 0), -1.0),
    ],
)
def test_a_fit_with_a_value_that_cannot_be_is_refused(
    here: Callable[..., Ended], pipeline: Pipeline, tmp_path: Path, name: str, where: Any, value: Any
) -> None:
    path = put(pipeline.fit, tmp_path / "forged.h5", name, where, value)
    for command in (("transfer", "mean", path), ("show", path), ("plot", "heatmaps", path, "-o", "x.png")):
        ended = here(*command)
        assert ended.code == 6
        assert f"{name} is " in ended.err


def test_a_moment_is_unknown_where_nothing_was_counted_and_nowhere_else(
    here: Callable[..., Ended], pipeline: Pipeline, tmp_path: Path
) -> None:
    with h5py.File(pipeline.fit) as file:
        known = tuple(np.argwhere(file["n"][...] > 0)[0])
    ended = here("transfer", "mean", put(pipeline.fit, tmp_path / "forged.h5", "mu", known, math.nan))
    assert (ended.code, "mu must be NaN where n is 0" in ended.err) == (6, True)


@pytest.mark.parametrize(
    ("name", "where", "value"),
    [
        ("goal_row", 0, 7),
        ("steps", (0, 0), 0),
        ("steps", (0, 0), 1_001),
        ("reached", (0, 0), 2),
        ("v_star", 0, 7.0),
        ("potential", (0, 0), 1e308),
    ],
)
def test_a_run_with_a_value_that_cannot_be_is_refused(
    here: Callable[..., Ended], pipeline: Pipeline, tmp_path: Path, name: str, where: Any, value: Any
) -> None:
    path = put(pipeline.runs["zero"], tmp_path / "forged.h5", name, where, value)
    for command in (("compare", path), ("show", path)):
        ended = here(*command)
        assert (ended.code, f"{name} is " in ended.err) == (6, True)


def test_a_candidate_that_earned_more_than_there_is_is_refused(
    here: Callable[..., Ended], tuning: Path, tmp_path: Path
) -> None:
    ended = here("show", put(tuning, tmp_path / "forged.h5", "average", (0, 0), 2.0))
    assert (ended.code, "average is 2.0" in ended.err) == (6, True)


def test_a_label_that_is_no_text_is_refused(
    here: Callable[..., Ended], pipeline: Pipeline, tmp_path: Path
) -> None:
    ended = here("export", put(pipeline.fit, tmp_path / "forged.h5", "action", 0, b"\xff"), "--to", "csv")
    assert (ended.code, "a label of its axis action is not in ASCII" in ended.err) == (6, True)


def _deleted(*names: str) -> Callable[[dict[str, Any]], Any]:
    def change(spec: dict[str, Any]) -> None:
        for name in names[:-1]:
            spec = spec[name]
        del spec[names[-1]]

    return change


SETTINGS: dict[str, Callable[[dict[str, Any]], Any]] = {
    "size below the axes": lambda spec: spec["family"].update(size=4),
    "size as a text": lambda spec: spec["family"].update(size="6"),
    "size beyond its range": lambda spec: spec["family"].update(size=10**6),
    "an unknown family setting": lambda spec: spec["family"].update(depth=3),
    "a family without a name": _deleted("family", "name"),
    "a family that is a list": lambda spec: spec.update(family=[]),
    "gamma missing": _deleted("learning", "gamma"),
    "gamma as a text": lambda spec: spec["learning"].update(gamma="x"),
    "gamma above 1": lambda spec: spec["learning"].update(gamma=1.5),
    "episodes beside those of the curve": lambda spec: spec["learning"].update(episodes=7),
    "a horizon of true": lambda spec: spec["learning"].update(horizon=True),
    "a negative seed": lambda spec: spec.update(seed=-1),
    "more tasks than an artefact holds": lambda spec: spec.update(tasks=2**63 - 1),
    "no number of tasks": lambda spec: spec.update(tasks="many"),
    "fewer tasks than there are": lambda spec: spec.update(tasks=2),
    "an unknown learner": lambda spec: spec.update(learner="magic"),
    "an unknown setting": lambda spec: spec.update(extra=1),
    "another kind": lambda spec: spec.update(kind="run"),
}


@pytest.mark.parametrize("change", SETTINGS.values(), ids=SETTINGS)
def test_settings_that_cannot_be_are_refused_in_one_sentence(
    here: Callable[..., Ended], pipeline: Pipeline, tmp_path: Path, change: Callable[[dict[str, Any]], Any]
) -> None:
    path = settle(pipeline.sources, tmp_path / "forged.h5", change)
    for command in ("show", "fit"):
        ended = here(command, path)
        assert (ended.code, ended.out, ended.err.count("\n")) == (6, "", 1)


def test_settings_of_a_run_are_checked_before_they_name_it(
    here: Callable[..., Ended], pipeline: Pipeline, tmp_path: Path
) -> None:
    path = settle(
        pipeline.runs["mean"],
        tmp_path / "forged.h5",
        lambda spec: spec["source_set"]["family"].update(size="x"),
    )
    for command in (("plot", "lifetime", path, "-o", "x.png"), ("compare", path), ("show", path)):
        ended = here(*command)
        assert (ended.code, "--size is 'x'" in ended.err) == (6, True)


@pytest.mark.parametrize(
    ("change", "told"),
    [
        (lambda spec: spec.update(holdout=3), "holdout is 3; a fit of 4 sources keeps at least 2"),
        (lambda spec: spec.update(inputs=["x"]), "no list of one content hash"),
        (lambda spec: spec["sources"].update(tasks=2**63 - 1), "tasks is 9223372036854775807"),
    ],
)
def test_settings_of_a_fit_that_cannot_be_are_refused(
    here: Callable[..., Ended], pipeline: Pipeline, tmp_path: Path, change: Callable[[Any], Any], told: str
) -> None:
    path = settle(pipeline.fit, tmp_path / "forged.h5", change)
    for command in (("show", path), ("verify", path, "--format", "json")):
        ended = here(*command)
        assert (ended.code, told in ended.out + ended.err) == (6, True)


@pytest.mark.parametrize("name", ["curve_steps", "curve_reached"])
def test_sources_without_a_column_that_their_settings_make_are_refused(
    here: Callable[..., Ended], pipeline: Pipeline, tmp_path: Path, name: str
) -> None:
    path = Path(shutil.copy(pipeline.sources, tmp_path / "forged.h5"))
    with h5py.File(path, "r+", libver=LIBVER) as file:
        del file[name]
    mend(path)
    ended = here("show", path)
    assert (ended.code, f"it lacks {name}" in ended.err) == (6, True)


def test_a_run_without_the_tables_that_its_settings_keep_is_refused(
    here: Callable[..., Ended], pipeline: Pipeline, tmp_path: Path
) -> None:
    path = settle(pipeline.runs["zero"], tmp_path / "forged.h5", lambda spec: spec.update(keep_q=True))
    ended = here("compare", path)
    assert (ended.code, "it lacks q" in ended.err) == (6, True)


@pytest.mark.parametrize(
    ("name", "raw"),
    [
        ("spec_json", '{"seed":NaN}'),
        ("spec_json", '{"seed":1e999}'),
        ("spec_json", '{"seed":"\\ud800"}'),
        ("spec_json", "[" * 900 + "]" * 900),
        ("spec_json", '{"seed":1,"seed":2}'),
        ("spec_json", '{"tasks":' + "1" * 4000 + "}"),
        ("spec_json", '{"family":[],"sources":3,"tasks":1}'),
        ("provenance_json", '{"time":5}'),
        ("provenance_json", "[]"),
        ("inputs_json", "[1]"),
        ("inputs_json", "null"),
    ],
)
def test_one_odd_file_does_not_stop_a_store(
    here: Callable[..., Ended], pipeline: Pipeline, tmp_path: Path, name: str, raw: str
) -> None:
    store = Path(shutil.copytree(pipeline.store, tmp_path / "store"))
    odd = store / "sources" / "odd.h5"
    shutil.copy(pipeline.sources, odd)
    with h5py.File(odd, "r+", libver=LIBVER) as file:
        give(file, name, raw)
    listed = here("list", "--store", store, "--format", "json")
    assert listed.code == 0
    states = {row["name"]: row["state"] for row in listed.json["rows"]}
    assert states.pop("odd") in ("damaged", "done")
    assert set(states.values()) == {"done"}
    trained = here(
        "train-sources", "gridworld", "--size", "2", "--tasks", "1", "--learner", "exact", "--store", store
    )
    assert trained.code == 0


def _ends(arguments: list[str]) -> tuple[int, str]:
    """How a command ends in a process of its own: whatever is in the file, this one goes on."""
    reading, writing = os.pipe()
    child = os.fork()
    if not child:
        signal.alarm(60)
        ended = run_here(arguments)
        os.write(writing, json.dumps([ended.code, ended.err[-2000:]]).encode())
        os._exit(0)
    os.close(writing)
    with os.fdopen(reading, "rb") as pipe:
        told = pipe.read()
    _, status = os.waitpid(child, 0)
    assert not os.WIFSIGNALED(status), f"ended by signal {os.WTERMSIG(status)}"
    code, err = json.loads(told)
    return code, err


def _commands(kind: str, path: str) -> list[list[str]]:
    """What can be done with one artefact of a kind."""
    here = [
        ["show", path],
        ["export", path, "--to", "json", "-o", "x.json", "--force"],
        ["list", "--store", "."],
    ]
    few = ["--tasks", "2", "--episodes", "5"]
    match kind:
        case "sources":
            more = [
                ["fit", path, "-o", "f.h5", "--force"],
                ["plot", "histograms", path, "-o", "h.png", "--force"],
            ]
            more += [["plot", name, path, "-o", "o.png", "--force"] for name in ("occupancy", "eopl")]
        case "fit":
            more = [
                ["transfer", name, path, *few, "-o", "r.h5", "--force"]
                for name in ("mean", "ops-tl", "posterior")
            ]
        case "run":
            more = [["compare", path], ["plot", "curves", path, "-o", "c.png", "--force"]]
        case _:
            more = [["plot", "tuning", path, "-o", "t.png", "--force"]]
    return [*here, ["salvage", path, "-o", "s.h5", "--force"], ["verdicts", path], *more]


def _try_forgeries(sound: list[tuple[str, Path]], folder: Path, seeds: range) -> None:
    for seed in seeds:
        rng = random.Random(seed)
        kind, artefact = rng.choice(sound)
        told = forge(artefact, folder / "forged.h5", seed)
        arguments = rng.choice(_commands(kind, str(folder / "forged.h5")))
        code, err = _ends(arguments)
        assert code in (0, 2, 4, 6), f"seed {seed}, {told}: {arguments} ended with {code}, {err}"


@pytest.fixture
def sound(pipeline: Pipeline, tuning: Path) -> list[tuple[str, Path]]:
    """An artefact of each kind, and runs of several methods."""
    runs = [("run", pipeline.runs[name]) for name in ("zero", "ops-tl", "posterior", "ptrs")]
    return [("sources", pipeline.sources), ("fit", pipeline.fit), ("tuning", tuning), *runs]


def test_no_forgery_is_a_fault_of_qinit(
    sound: list[tuple[str, Path]], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    _try_forgeries(sound, tmp_path, range(40))


@pytest.mark.soak
def test_no_forgery_of_thousands_is_a_fault_of_qinit(
    sound: list[tuple[str, Path]], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    _try_forgeries(sound, tmp_path, range(40, 2_040))


@pytest.mark.parametrize(
    ("name", "where", "value"),
    [
        ("mu", 0.5, "mu contradicts"),
        ("lognormal_median", 0.5, "lognormal_median contradicts"),
        ("mean", 1.0, "mean contradicts"),
        ("std", 1.0, "std contradicts"),
        ("n", 1, "count the same sources"),
        ("library_task", 0, "ascending tasks"),
    ],
)
def test_statistics_that_contradict_one_another_are_refused(
    here: Callable[..., Ended], pipeline: Pipeline, tmp_path: Path, name: str, where: float, value: str
) -> None:
    with h5py.File(pipeline.fit) as file:
        varied = tuple(np.argwhere((file["std"][...] > 0) & (file["std"][...] < 0.5))[0])
    place = 1 if name == "library_task" else varied
    ended = here("show", put(pipeline.fit, tmp_path / "forged.h5", name, place, where))
    assert (ended.code, value in ended.err) == (6, True)


def test_axes_that_depend_on_a_package_are_scales_at_least(
    here: Callable[..., Ended], lake: tuple[Path, Path], tmp_path: Path
) -> None:
    path = put(lake[0], tmp_path / "forged.h5", "row", 0, 7)
    ended = here("show", path)
    assert (ended.code, "its axis row does not ascend" in ended.err) == (6, True)


def test_settings_that_name_no_maker_are_checked_before_a_kernel_sees_the_tasks(
    here: Callable[..., Ended], pipeline: Pipeline, tmp_path: Path
) -> None:
    def unsigned(spec: dict[str, Any]) -> None:
        del spec["kind"], spec["algorithm_version"]

    path = settle(pipeline.sources, tmp_path / "unsigned.h5", unsigned)
    put(path, tmp_path / "forged.h5", "goal_row", 0, 1_000_000)
    assert here("show", tmp_path / "forged.h5").code == 6


@pytest.mark.parametrize("kind", ["sources", "fit", "run"])
def test_settings_of_another_program_are_refused_by_what_needs_ours(
    here: Callable[..., Ended], pipeline: Pipeline, tmp_path: Path, kind: str
) -> None:
    def others(spec: dict[str, Any]) -> None:
        spec.clear()
        spec["origin"] = "another program"

    sound = {"sources": pipeline.sources, "fit": pipeline.fit, "run": pipeline.runs["zero"]}[kind]
    path = settle(sound, tmp_path / "other.h5", others)
    command = {"sources": ("fit", path), "fit": ("transfer", "mean", path), "run": ("compare", path)}[kind]
    for words in (("show", path), command):
        assert here(*words).code == 6
