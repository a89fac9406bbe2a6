"""Each fold of a file left out in turn: one command writes all sources, the next ones carry all of them on."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from running import Ended, run_here

import qinit_cli as qinit
from qinit_cli.environments.folds import each_fold
from qinit_cli.errors import UsageError

TASKS, FOLDS = 7, 3
HELD = ([0, 3, 6], [1, 4], [2, 5])


@pytest.fixture
def file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> str:
    """Tables of transitions in the current folder."""
    monkeypatch.chdir(tmp_path)
    chance = np.random.default_rng(3)
    np.savez("mdps.npz", P=chance.dirichlet(np.ones(4), (TASKS, 4, 2)), R=chance.random((TASKS, 4, 2)))
    return "mdps.npz"


def paths(ended: Ended) -> list[str]:
    assert ended.code == 0, ended.err
    return ended.out.splitlines()


def test_a_pipeline_carries_every_fold_to_the_tasks_that_it_left_out(
    file: str, here: Callable[..., Ended]
) -> None:
    learn = ("train-sources", "tasks", file, "--episodes", 20)
    sources = here(*learn, "--folds", FOLDS)
    assert [f"fold-{fold}-{FOLDS}" in path for fold, path in enumerate(paths(sources), 1)] == [True] * FOLDS
    fits = here("fit", "-", stdin=sources.out)
    runs = here("transfer", "logqinit-median", "-", "--episodes", 5, stdin=fits.out)
    for source, run, held in zip(paths(sources), paths(runs), HELD, strict=True):
        others = [task for task in range(TASKS) if task not in held]
        assert qinit.open(source)["file_task"].tolist() == others
        assert qinit.open(run)["file_task"].tolist() == held
    again = here(*learn, "--folds", FOLDS)
    assert (again.out, again.err.count("already complete")) == (sources.out, FOLDS)


def test_a_fold_is_the_artefact_that_use_makes(file: str, here: Callable[..., Ended]) -> None:
    learn = ("train-sources", "tasks", file, "--episodes", 20)
    together = paths(here(*learn, f"--folds={FOLDS}"))
    alone = [here(*learn, "--use", f"fold:{fold}/{FOLDS}", "--store", f"{fold}").path for fold in (1, 2, 3)]
    assert [Path(path).name for path in together] == [path.name for path in alone]
    assert [qinit.open(path).digest for path in together] == [qinit.open(path).digest for path in alone]
    family = qinit.families.tasks(file=file)
    held = [qinit.train_sources(one, episodes=20) for one in qinit.folds(family, FOLDS)]
    assert [one.digest for one in held] == [qinit.open(path).digest for path in alone]
    command = json.loads(here("show", together[1], "--json").out)["provenance"]["command"]
    assert command.endswith(f"--use fold:2/{FOLDS}")


@pytest.mark.parametrize(
    ("options", "taken"),
    [
        (("--learner", "exact"), [0, 2, 5]),  # each task is solved once
        (
            ("--episodes", 20),
            [0, 2, 3],
        ),  # by its streams: 1 and 3 of the first fold, 0, 2 and 4 of the second
        (("--episodes", 20, "--alpha", 0.2, "--use", "6:7,0:1"), [0]),
    ],
)
def test_a_task_that_another_fold_has_is_not_learned_again(
    file: str, here: Callable[..., Ended], options: tuple[Any, ...], taken: list[int]
) -> None:
    here("train-sources", "tasks", file, "--use", "6:7", "--episodes", 20)  # at another place than in folds
    cut = () if "--use" in options else ("--folds", FOLDS)
    together = here("train-sources", "tasks", file, *cut, *options, "--json")
    made = [json.loads(line) for line in together.out.splitlines()]
    assert [one["skipped"] for one in made] == taken
    for fold, one in enumerate(made, 1):
        use = () if "--use" in options else ("--use", f"fold:{fold}/{FOLDS}")
        alone = here("train-sources", "tasks", file, *use, *options, "--store", f"alone-{fold}", "--json")
        assert (alone.json["skipped"], alone.json["digest"]) == (0, one["digest"])


def test_folds_of_rows_are_those_of_the_family_gym(file: str, here: Callable[..., Ended]) -> None:
    Path("ice.csv").write_text("success_rate\n0.5\n0.6\n0.7\n0.8\n")
    rows = here(
        "train-sources", "tasks", "ice.csv", "--env", "FrozenLake-v1", "--folds", 2, "--learner", "exact"
    )
    assert [qinit.open(path)["file_task"].tolist() for path in paths(rows)] == [[1, 3], [0, 2]]
    vary = ("--vary", "success_rate=file:ice.csv")
    same = here("train-sources", "gym", "FrozenLake-v1", *vary, "--folds", 2, "--learner", "exact")
    assert (same.out, same.err.count("already complete")) == (rows.out, 2)


def test_shares_and_estimates_are_of_each_fold(file: str, here: Callable[..., Ended]) -> None:
    learn = ("train-sources", "tasks", file, "--folds", 2, "--episodes", 20)
    assert [Path(path).name.count("share-1-of-2") for path in paths(here(*learn, "--shard", "1/2"))] == [1, 1]
    trial = here(*learn, "--dry-run", "--json")
    assert [json.loads(line)["tasks"] for line in trial.out.splitlines()] == [3, 4]


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (
            ("tasks", "mdps.npz", "--folds", 3, "-o", "a.h5"),
            "-o a.h5 names one artefact, and 3 are to be made",
        ),
        (("tasks", "mdps.npz", "--folds", 3, "--use", "0:4"), "and --use 0:4 does too"),
        (
            ("tasks", "mdps.npz", "--folds", 8),
            "of 7 tasks write fold:K/N with K from 1 to N and N from 2 to 7",
        ),
        (("tasks", "mdps.npz", "--folds", 1), "--folds is 1; it must be at least 2"),
        (("gym", "FrozenLake-v1", "--folds", 2), "nothing is varied by one"),
    ],
)
def test_folds_that_cannot_be_are_refused_in_a_sentence(
    file: str, here: Callable[..., Ended], words: tuple[Any, ...], told: str
) -> None:
    ended = here("train-sources", *words)
    assert (ended.code, ended.out) == (2, "")
    assert told in " ".join(ended.err.split())


def test_one_file_for_several_fits_or_runs_is_refused(file: str, here: Callable[..., Ended]) -> None:
    sources = here("train-sources", "tasks", file, "--folds", 2, "--learner", "exact")
    refused = here("fit", "-", "-o", "fit.h5", stdin=sources.out)
    assert (refused.code, "names one artefact, and 2 are to be made" in refused.err) == (2, True)
    fits = here("fit", "-", stdin=sources.out)
    refused = here("transfer", "zero", "-", "-o", "run.h5", stdin=fits.out)
    assert (refused.code, "names one artefact, and 2 are to be made" in refused.err) == (2, True)


def test_what_draws_its_tasks_has_no_folds() -> None:
    with pytest.raises(UsageError, match="gridworld draws its tasks"):
        each_fold(qinit.families.gridworld(), 2)


def test_failed_tasks_of_one_fold_leave_the_others_to_be_learned(
    file: str, here: Callable[..., Ended], monkeypatch: pytest.MonkeyPatch
) -> None:
    from qinit_cli.environments.own_tasks import OwnTasks

    solve = OwnTasks.solve

    def failing(self: OwnTasks, tasks: Any, gamma: float) -> Any:
        if 1 in tasks["file_task"]:
            raise FloatingPointError("as asked")
        return solve(self, tasks, gamma)

    monkeypatch.setattr(OwnTasks, "solve", failing)
    ended = run_here(["train-sources", "tasks", file, "--folds", "3", "--learner", "exact", "--jobs", "1"])
    assert ended.code == 3
    assert any("fold-2-3" in line for line in ended.out.splitlines())


def test_folds_of_one_size_are_compared_as_source_sets_and_others_by_themselves(
    file: str, here: Callable[..., Ended]
) -> None:
    sources = here("train-sources", "tasks", file, "--folds", FOLDS, "--learner", "exact")
    fits = here("fit", "-", stdin=sources.out)
    runs = {
        name: here("transfer", name, "-", "--episodes", 5, stdin=fits.out)
        for name in ("zero", "ucoi", "mean")
    }
    told = here("compare", "-", "--json", stdin="".join(ended.out for ended in runs.values())).json
    sets = {row["method"]: row for row in told["rows"] if row["sets"] == 2}
    assert "tasks-mdps-3-folds-reward-native, 2 source sets, 2 targets of each" in {
        row["targets"].replace("4 sources, ", "").replace("5 sources, ", "").rpartition(", ")[0]
        for row in sets.values()
    }
    means = {
        name: np.mean([qinit.open(path).returns() for path in paths(ended)[1:]])  # type: ignore[attr-defined]
        for name, ended in runs.items()
    }
    for name, mean in means.items():
        assert sets[name]["return"] == pytest.approx(mean)
        assert sets[name]["difference"] == (None if name == "zero" else pytest.approx(mean - means["zero"]))
    assert "folds have sources in common" in " ".join(each["over"] for each in told["intervals"])
    assert {row["sets"] for row in told["rows"] if "fold-1-3" in row["targets"]} == {1}
