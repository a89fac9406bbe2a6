"""What tells artefacts apart: the settings in which they differ, in few words, and no hash where a setting does it."""

from __future__ import annotations

import csv
import io
import json
import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from qinit_cli.artefacts.settings import FitSettings, RunSettings, SourcesSettings
from qinit_cli.comparison import distinctions
from qinit_cli.comparison.rows import compare
from qinit_cli.comparison.runs import ComparedRun
from qinit_cli.comparison.source_sets import grouped, told_of_groups
from qinit_cli.environments.gridworld import Gridworld
from qinit_cli.environments.mountain_car import MountainCar
from qinit_cli.fitted import FitOptions
from qinit_cli.learners.exploration import Boltzmann, Ucb
from qinit_cli.learners.one_step import Sarsa
from qinit_cli.learners.optimistic import RMax
from qinit_cli.learners.traces import SarsaLambda
from qinit_cli.methods import METHODS
from qinit_cli.schedules import ByVisits, Linear
from qinit_cli.tasks import SourceTasks, TargetTasks

HASH = re.compile(r"[0-9a-f]{8}")
WORLD = Gridworld(size=6, variance=2)


def _sources(family: Any = WORLD, learner: Any = None, seed: int = 0, tasks: int = 4, **learning: Any) -> Any:
    how = replace(family.source_learning, **learning)
    if learner == "exact":
        return SourcesSettings.of(SourceTasks(family, "exact", how, seed=seed), tasks)
    how = replace(how, learner=learner or how.learner)
    return SourcesSettings.of(SourceTasks(family, how.learner.name, how, seed=seed), tasks)


def _run(
    method: str = "mean",
    sources: Any = None,
    family: Any = WORLD,
    seed: int = 0,
    tasks: int = 4,
    fit: Any = None,
    targets: str = "t",
    options: Any = None,
    **learning: Any,
) -> ComparedRun:
    sources = sources or _sources()
    fitted = FitSettings.of(sources, json.dumps(sources.spec(), sort_keys=True), fit or FitOptions())
    how = replace(family.target_learning, episodes=20, **learning)
    wanted = TargetTasks(family, how, seed=seed, keep_q=False)
    settings = RunSettings.of(METHODS[method](**(options or {})), wanted, tasks, "fit", fitted)
    steps = np.full((tasks, 20), 3, np.int32)
    return ComparedRun(
        name=f"{method}-{abs(hash(json.dumps(settings.spec(), sort_keys=True))):016x}",
        method=method,
        label=settings.method.label,
        settings=settings,
        steps=steps,
        reached=np.ones(steps.shape, bool),
        attainable=None,
        v_star=None,
        evaluation_steps=None,
        evaluation_reached=None,
        drawn=(),
        target_digest=targets + json.dumps([settings.family.spec(), seed, tasks, how.gamma]),
    )


@pytest.mark.parametrize(
    ("one", "other", "words"),
    [
        (_sources(gamma=0.9), _sources(gamma=0.99), ["gamma 0.9", "gamma 0.99"]),
        (_sources(), _sources(learner="exact"), ["q-learning", "exact"]),
        (_sources(seed=3), _sources(seed=4), ["seed 3", "seed 4"]),
        (_sources(tasks=10), _sources(tasks=20), ["10 sources", "20 sources"]),
        (_sources(epsilon=0.1), _sources(epsilon=0.2), ["epsilon 0.1", "epsilon 0.2"]),
        (_sources(), _sources(learner=Sarsa()), ["q-learning", "sarsa"]),
        (_sources(learner=Sarsa()), _sources(learner="exact"), ["sarsa", "exact"]),
        (_sources(learner=SarsaLambda(0.5)), _sources(learner=SarsaLambda(0.8)), ["lambda 0.5", "lambda 0.8"]),
        (_sources(alpha=ByVisits(1.0)), _sources(), ["alpha visits:1.0", "alpha 0.1"]),
        (_run(learner=Sarsa()).settings, _run().settings, ["sarsa", "q-learning"]),
        (_run(learner=RMax(), alpha=0.3).settings, _run().settings, ["r-max", "q-learning"]),
        (_run(explore=Ucb(), epsilon=0.0).settings, _run().settings, ["ucb", "epsilon-greedy"]),
        (_run(explore=Ucb(0.5)).settings, _run(explore=Ucb(0.2)).settings, ["c 0.5", "c 0.2"]),
        (_run(sources=_sources(learner=Sarsa())).settings, _run().settings, ["sources' sarsa", "sources' q-learning"]),
        (_sources(), _sources(), ["", ""]),
        (_sources(), _sources(MountainCar()), ["", ""]),  # of two families nothing is compared: their names differ
        (_sources(Gridworld(p_low=0.4)), _sources(Gridworld(p_low=0.6)), ["", ""]),  # their labels tell it
        (_run(epsilon=0.2).settings, _run().settings, ["epsilon 0.2", "epsilon 0.1"]),
        (_run(fit=FitOptions(estimator="umvue")).settings, _run().settings, ["umvue", "mle"]),
        (_run(sources=_sources(tasks=50)).settings, _run().settings, ["50 sources", "4 sources"]),
        (_run(sources=_sources(episodes=9)).settings, _run(sources=_sources(episodes=7)).settings,
         ["sources' episodes 9", "sources' episodes 7"]),
        (_run(sources=_sources(Gridworld(size=6, variance=9))).settings, _run().settings,
         ["sources of gridworld-6-variance-9", "unshifted"]),
        # what sources and targets share is told once
        (_run(sources=_sources(gamma=0.9), gamma=0.9).settings, _run(sources=_sources(gamma=0.8), gamma=0.8).settings,
         ["gamma 0.9", "gamma 0.8"]),
    ],
)  # fmt: skip
def test_the_words_are_the_settings_that_differ(one: Any, other: Any, words: list[str]) -> None:
    assert distinctions.distinctions([one, other]) == words


@pytest.mark.parametrize(
    ("one", "other"),
    [
        ({"gamma": 0.9}, {"gamma": 0.99}),
        ({"seed": 3}, {"seed": 4}),
        ({"epsilon": 0.1}, {"epsilon": 0.2}),
        ({"alpha": 0.1}, {"alpha": 0.2}),
        ({"alpha": Linear(0.5, 0.1, 9)}, {"alpha": Linear(0.5, 0.1, 8)}),
        ({"learner": Sarsa()}, {}),
        ({"learner": SarsaLambda(0.5)}, {"learner": SarsaLambda()}),
        ({"explore": Boltzmann(), "epsilon": 0.0}, {"epsilon": 0.0}),
        ({"horizon": 30}, {"horizon": 40}),
        ({"start": "anywhere"}, {"start": "fixed"}),
        ({"tasks": 4}, {"tasks": 5}),
        ({"sources": _sources(learner="exact")}, {"sources": _sources()}),
        ({"sources": _sources(gamma=0.9)}, {"sources": _sources(gamma=0.99)}),
        ({"sources": _sources(tasks=9)}, {"sources": _sources(tasks=8)}),
        ({"fit": FitOptions(estimator="umvue")}, {"fit": FitOptions()}),
        ({"fit": FitOptions(library=7)}, {"fit": FitOptions(library=8)}),
        ({"method": "ops-tl", "options": {"rho": 0.1}}, {"method": "ops-tl", "options": {"rho": 0.9}}),
        ({"family": Gridworld(size=6, p_low=0.4)}, {"family": Gridworld(size=6, p_low=0.6)}),
    ],
)  # fmt: skip
def test_whatever_differs_no_two_rows_of_a_comparison_are_called_the_same(one: Any, other: Any) -> None:
    comparisons = compare([_run(**one), _run(**other)], "", "return")
    named = [(comparison.title, row.label) for comparison in comparisons for row in comparison.rows]
    assert len(set(named)) == 2
    assert not any(HASH.search(name) for both in named for name in both)


def test_what_a_group_shares_is_in_its_title_and_what_varies_within_one_at_its_methods() -> None:
    runs = [_run("zero"), _run(), _run(epsilon=0.2), _run("zero", gamma=0.9), _run(gamma=0.9)]
    first, second = compare(runs, "", "return")
    assert first.title == "gridworld-6-variance-2, gamma 0.95, 4 targets of seed 0, 20 episodes"
    assert second.title == "gridworld-6-variance-2, gamma 0.9, 4 targets of seed 0, 20 episodes"
    assert [row.label for row in first.rows] == [
        "zero, epsilon 0.1",
        "mean, epsilon 0.1",
        "mean, epsilon 0.2",
    ]
    assert [row.label for row in second.rows] == ["zero, epsilon 0.1", "mean, epsilon 0.1"]


def test_a_method_that_reads_no_sources_is_not_told_apart_by_them() -> None:
    exact = _sources(learner="exact")
    [comparison] = compare(
        [_run("zero"), _run("zero", sources=exact), _run(), _run(sources=exact)], "", "return"
    )
    assert [row.label for row in comparison.rows] == ["zero", "mean, sources' q-learning", "mean, exact"]


def test_the_first_targets_of_a_longer_run_are_not_told_by_how_many_it_had() -> None:
    short = _run("zero", tasks=2)
    cut = replace(_run(tasks=4).first(2), target_digest=short.target_digest)
    [comparison] = compare([short, cut], "", "return")
    assert [row.label for row in comparison.rows] == ["zero", "mean"]


def test_replicates_are_one_row_whatever_their_seeds() -> None:
    [comparison] = compare([_run(sources=_sources(seed=seed)) for seed in range(3)], "", "return")
    assert [row.label for row in comparison.rows] == ["mean"]


def test_groups_of_two_families_are_told_apart_by_their_names_alone() -> None:
    car = MountainCar()
    groups = grouped([_run(), _run(family=car, sources=_sources(car))])
    assert told_of_groups(groups) == [{}, {}]


def test_list_tells_what_differs(here: Callable[..., Any], tmp_path: Path) -> None:
    small = ("gridworld", "--size", "3", "--tasks", "2", "--learner", "exact", "--store", "s", "-q")
    for gamma, low, name in (("0.9", "0.5", "a"), ("0.8", "0.6", "b")):
        here("train-sources", *small, "--gamma", gamma, "--p-low", low, "-o", f"s/sources/{name}.h5")
    rows = list(csv.DictReader(io.StringIO(here("list", "--store", "s").out), delimiter="\t"))
    assert {row["name"]: row["differs"] for row in rows} == {
        "a": "p-low 0.5, gamma 0.9",
        "b": "p-low 0.6, gamma 0.8",
    }
    shown = here("list", "--store", "s", "--format", "table").out
    assert "differs in" in shown
    alone = here("list", "--store", "s", "--name", "a", "--format", "table").out
    assert "differs in" not in alone


def test_list_tells_the_method_that_a_name_does_not(
    here: Callable[..., Any], tmp_path: Path, pipeline: Any
) -> None:
    (tmp_path / "s" / "runs").mkdir(parents=True)
    for name, run in (("a", "zero"), ("b", "mean"), ("by-ucoi", "ucoi")):
        (tmp_path / "s" / "runs" / f"{name}.h5").write_bytes(pipeline.runs[run].read_bytes())
    rows = list(csv.DictReader(io.StringIO(here("list", "--store", "s").out), delimiter="\t"))
    assert {row["name"]: row["differs"] for row in rows} == {"a": "zero", "b": "mean", "by-ucoi": ""}


@pytest.mark.parametrize("format", ["table", "tsv", "csv", "json", "jsonl", "markdown"])
@pytest.mark.parametrize("metric", ["return", "success", "steps"])
def test_no_two_columns_of_a_comparison_have_one_name(
    here: Callable[..., Any], pipeline: Any, monkeypatch: pytest.MonkeyPatch, metric: str, format: str
) -> None:
    monkeypatch.setenv("COLUMNS", "400")
    out = here(
        "compare", *(pipeline.runs[name] for name in ("zero", "mean")), "--metric", metric, "--format", format
    ).out
    match format:
        case "table":
            [heading] = [
                re.split(r"\s{2,}", line.strip()) for line in out.splitlines() if line.startswith(" method")
            ]
        case "markdown":
            heading = out.splitlines()[0].strip("| ").split(" | ")
        case "json" | "jsonl":
            pairs: list[list[str]] = []
            json.loads(
                out.splitlines()[0], object_pairs_hook=lambda found: pairs.append([key for key, _ in found])
            )
            heading = max(pairs, key=len)
        case _:
            heading = out.splitlines()[0].split("\t" if format == "tsv" else ",")
    assert len(heading) > 5
    assert len(set(heading)) == len(heading)
    assert metric in " ".join(heading)


def test_a_column_without_a_value_is_not_shown_unless_it_is_asked_for(
    here: Callable[..., Any], pipeline: Any
) -> None:
    one = pipeline.runs["mean"]
    assert "minus zero" not in here("compare", one, "--format", "table").out
    assert "minus zero" in here("compare", one, "--format", "table", "--columns", "difference").out
    assert "difference" in here("compare", one, "--format", "tsv").out.splitlines()[0].split("\t")


@pytest.mark.parametrize(
    ("values", "digits", "shown"),
    [
        ([57528.0123], 2, ["57528"]),
        ([123.456], 1, ["123.5"]),
        ([123.456], 4, ["123.46"]),
        ([0.123456], 4, ["0.1235"]),
        ([-9.87654], 4, ["-9.8765"]),
        ([0.0], 4, ["0.0000"]),
        ([0.00002], 4, ["2e-05"]),
        ([0.00002, -0.3, 0.3], 4, ["0.0000", "-0.3000", "0.3000"]),
        ([99.5, 10.25, 1200.0], 4, ["99.5", "10.2", "1200.0"]),
    ],
)
def test_large_numbers_need_no_decimals(values: list[float], digits: int, shown: list[str]) -> None:
    from qinit_cli.commands.tables import TableColumn

    column = TableColumn("x", digits=digits, interval=len(values) > 1)
    assert column._numbers(dict(zip(column.keys, values, strict=True))) == shown


def test_bounds_lose_their_needless_zero_and_no_other() -> None:
    from qinit_cli.commands.tables import TableColumn

    column = TableColumn("x", digits=2, interval=True)
    assert column.lines({"x": 15.0, "x_low": 10.25, "x_high": 20.5}) == "15.00\n10.25–20.50"
    assert column.lines({"x": 0.1, "x_low": -0.25, "x_high": 0.5}) == "0.10\n-.25–.50"
