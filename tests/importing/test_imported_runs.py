"""Learning curves of other agents are compared as they are, and labelled imported."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
from running import Ended

import qinit_cli as qinit

TASKS, EPISODES, GAMMA = 5, 12, 0.9


@pytest.fixture
def curves() -> pd.DataFrame:
    """Steps and goals of two agents, the second one faster."""
    rng = np.random.default_rng(3)
    rows = [
        (task, episode, method, int(rng.integers(1, longest)), int(rng.random() < 0.9))
        for method, longest in (("zero", 20), ("my own agent", 8))
        for task in range(TASKS)
        for episode in range(EPISODES)
    ]
    return pd.DataFrame(rows, columns=["task", "episode", "method", "steps", "reached"])


def earned(curves: pd.DataFrame) -> Any:
    """gamma^(steps - 1) where the goal was reached."""
    return np.where(curves["reached"] == 1, GAMMA ** (curves["steps"] - 1.0), 0.0)


def test_steps_and_goals_are_compared_by_their_discounted_returns(
    here: Callable[..., Ended], curves: pd.DataFrame
) -> None:
    curves.sample(frac=1, random_state=1).to_csv("curves.csv", index=False)
    ended = here("import", "--runs", "curves.csv", "--gamma", GAMMA)
    assert ended.code == 0, ended.err
    paths = ended.out.splitlines()
    assert len(paths) == 2
    rows = {row["method"]: row for row in here("compare", *paths, "--json").json["rows"]}
    by_method = curves.assign(earned=earned(curves)).groupby("method")
    for method, own in by_method:
        assert rows[method]["return"] == pytest.approx(own["earned"].mean(), rel=1e-12)
        assert rows[method]["success"] == pytest.approx(own["reached"].mean())
        assert rows[method]["restricted_steps"] == pytest.approx(own["steps"].mean())
        assert rows[method]["remark"] == "imported"
    tasks = curves.assign(earned=earned(curves)).pivot_table("earned", "task", "method")
    difference = (tasks["my own agent"] - tasks["zero"]).mean()
    assert rows["my own agent"]["difference"] == pytest.approx(difference, rel=1e-12)


def test_returns_alone_leave_steps_and_goals_unknown(
    here: Callable[..., Ended], curves: pd.DataFrame
) -> None:
    returns = curves.assign(**{"return": -curves["steps"] / 4})[["task", "episode", "method", "return"]]
    returns.to_parquet("returns.parquet")
    paths = here("import", "--runs", "returns.parquet", "--returns=-5:0", "--name", "costs").out.splitlines()
    rows = {row["method"]: row for row in here("compare", *paths, "--json").json["rows"]}
    for method, own in returns.groupby("method"):
        assert rows[method]["return"] == pytest.approx(own["return"].mean(), rel=1e-12)
        assert rows[method]["success"] is None
        assert rows[method]["restricted_steps"] is None
    refused = here("compare", *paths, "--metric", "steps")
    assert refused.code == 4
    assert "is unknown: it was imported without" in refused.err
    shown = here("show", paths[0], "--json").json
    assert "success" not in shown["numbers"]
    assert "horizon" not in shown["spec"]["learning"]
    table = here("export", paths[0], "--what", "targets", "-o", "t.csv")
    assert table.code == 0, table.err
    exported = pd.read_csv("t.csv")
    own = returns[returns["method"] == exported["method"][0]]
    assert exported["average_return"].to_numpy() == pytest.approx(
        own.groupby("task")["return"].mean().to_numpy()
    )
    assert exported["success"].isna().all()


def test_truths_of_pandas_are_goals_and_files_of_one_name_are_pairs(
    here: Callable[..., Ended], curves: pd.DataFrame
) -> None:
    paths = []
    for method, own in curves.groupby("method"):
        own.assign(reached=own["reached"].astype(bool)).to_csv(f"{method}.csv", index=False)
        ended = here("import", "--runs", f"{method}.csv", "--gamma", GAMMA, "--horizon", 20)
        assert ended.code == 0, ended.err
        paths += ended.out.splitlines()
    rows = {row["method"]: row for row in here("compare", *paths, "--json").json["rows"]}
    assert rows["my own agent"]["difference"] is not None
    assert rows["zero"]["success"] == pytest.approx(curves.query("method == 'zero'")["reached"].mean())


def test_a_return_outside_its_bounds_is_refused(here: Callable[..., Ended], curves: pd.DataFrame) -> None:
    curves.assign(**{"return": -1.0 * curves["steps"]}).drop(columns=["steps", "reached"]).to_csv("r.csv")
    ended = here("import", "--runs", "r.csv", "--returns=-2:0")
    assert ended.code == 4
    assert "and returns are from -2 to 0; give wider --returns" in ended.err


def test_imported_runs_are_drawn_reported_and_verified(
    here: Callable[..., Ended], curves: pd.DataFrame
) -> None:
    curves.to_csv("curves.csv", index=False)
    paths = here("import", "--runs", "curves.csv", "--gamma", GAMMA).out.splitlines()
    for words in (
        ("plot", "curves", *paths, "-o", "c.svg"),
        ("plot", "bars", *paths, "-o", "b.svg"),
        ("report", *paths, "-o", "r.html"),
        ("verify", *paths),
        ("show", paths[0]),
        ("list",),
    ):
        ended = here(*words)
        assert ended.code == 0, ended.err
    assert "imported" in Path("r.html").read_text()
    assert here("plot", "heatmaps", paths[0], "-o", "h.png").code == 4
    exported = here("export", *paths, "-o", "again.csv")
    assert exported.code == 0, exported.err
    again = qinit.import_runs("again.csv", gamma=GAMMA)
    first = [qinit.open(path) for path in paths]
    assert all((one["steps"] == two["steps"]).all() for one, two in zip(first, again, strict=True))


REFUSED = {
    "hole": (lambda c: c.drop(index=17), "no row for task 1, episode 5 of zero"),
    "twice": (lambda c: pd.concat([c, c.iloc[[3]]]), "two rows for task 0, episode 3 of zero"),
    "uneven": (lambda c: c[~((c["method"] == "zero") & (c["episode"] > 5))], "have 6 and 12 episodes"),
    "goals": (lambda c: c.assign(reached=2), "reached has the value 2"),
    "steps": (lambda c: c.assign(steps=0), "steps has the value 0"),
    "columns": (lambda c: c.drop(columns="reached"), "neither a column return nor steps and reached"),
    "tasks": (lambda c: c.drop(columns="task"), "has no column 'task'"),
    "words": (lambda c: c.assign(steps="many"), "a value that is no number"),
}


@pytest.mark.parametrize("fault", REFUSED)
def test_rows_that_are_no_curves_are_refused(
    here: Callable[..., Ended], curves: pd.DataFrame, fault: str
) -> None:
    change, words = REFUSED[fault]
    change(curves).to_csv("curves.csv", index=False)
    ended = here("import", "--runs", "curves.csv", "--gamma", GAMMA)
    assert ended.code in (2, 4)
    assert words in ended.err
    assert not Path("qinit-store").exists() or not list(Path("qinit-store").rglob("*.h5"))


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (("--runs",), "give --gamma, which makes returns of them"),
        (
            ("--runs", "--gamma", GAMMA, "-o", "r.h5"),
            "2 methods (zero, my own agent), a run each; leave out -o",
        ),
        (("--runs", "--gamma", GAMMA, "--axes", "x=3"), "--axes is no option of curves; leave it out"),
        (
            ("--gamma", GAMMA, "--horizon", 3),
            "--horizon is no option of tables; leave it out, or give --runs",
        ),
        (("--runs", "--gamma", GAMMA, "--dry-run"), "--dry-run estimates imports of tables only"),
        (("--runs", "--gamma", GAMMA, "--returns=-1:0"), "--returns is of a column return"),
        (
            ("curves.csv", "--runs", "--gamma", GAMMA, "-o", "r.h5"),
            "-o names one file, and 2 files make a run each",
        ),
    ],
)
def test_what_an_import_of_curves_cannot_be_asked(
    here: Callable[..., Ended], curves: pd.DataFrame, options: tuple[Any, ...], words: str
) -> None:
    curves.to_csv("curves.csv", index=False)
    ended = here("import", "curves.csv", *options)
    assert ended.code == 2
    assert words in ended.err
