"""`qinit bench`: that it runs and tells all, and that what is raced does the same work; no test looks at a time."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from qinit_cli.analysis.intervals import over_targets
from qinit_cli.benchmarks import learner_races, learning_races, plain_c, plain_loops, table_races
from qinit_cli.benchmarks.race import Race, Runner, results
from qinit_cli.environments.gridworld import Gridworld
from qinit_cli.fitted import FitOptions
from qinit_cli.learners import LEARNERS
from qinit_cli.pipeline import fit as stage

Run = Callable[..., Any]

NUMBERS = ("ours_figure", "other_figure", "ratio", "ratio_low", "ratio_high")
EPISODES, HORIZON = 20_000, 100


@pytest.fixture(autouse=True, scope="module")
def kept() -> None:
    """The plain loops are compiled once for all test runs, not in every process as they are raced."""
    for loop in (plain_loops.gridworld, plain_loops.mountain_car):
        loop.enable_caching()


@pytest.mark.parametrize("what", ["exact", "fit", "compare", "start-up"])
def test_bench_tells_both_figures_and_their_ratio(what: str, here: Run) -> None:
    ended = here("bench", "--what", what, "--repeat", "1", "--quick", "--json")
    assert ended.code == 0, ended.err
    told = ended.json
    assert told["schema"] == "qinit.bench/1"
    assert {"processor", "cores", "load", "python", "numba", "c_compiler"} <= told["machine"].keys()
    assert told["rows"]
    for row in told["rows"]:
        assert row["what"] == what
        assert row["case"]
        assert row["other"]
        assert row["unit"] in ("ms", "M steps/s")
        assert row["turns"] == 1
        assert all(row[name] > 0 for name in NUMBERS)
        assert row["ratio_low"] <= row["ratio"] <= row["ratio_high"]


def test_every_learner_and_a_table_are_raced_with_q_learning() -> None:
    *learners, table = learner_races.races(learning_races.QUICK)
    assert [race.case.partition(", ")[2] for race in learners] == [
        name for name in LEARNERS.own if name != "q-learning"
    ]
    told = results(table, 1)
    assert [row.other for row in told] == ["Q-learning"]
    assert min(told[0].ours_figure, told[0].other_figure) > 0


def test_kernels_of_both_families_are_raced_and_without_a_c_compiler_bench_says_so(
    here: Run, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("CC", "no-such-compiler")
    ended = here("bench", "--what", "kernels", "--repeat", "1", "--quick", "--json")
    assert ended.code == 0
    assert "nothing is compared with C" in ended.err
    told = ended.json
    assert told["machine"]["c_compiler"] is None
    assert {row["other"] for row in told["rows"]} == {"plain Numba"}
    assert {row["case"] for row in told["rows"]} == {
        f"{family} {role}, {when}"
        for family in ("gridworld", "mountain-car")
        for role in ("sources", "targets")
        for when in ("early", "converged")
    }
    assert all(row[name] > 0 for row in told["rows"] for name in NUMBERS)


def test_runners_take_turns_and_the_first_turn_does_not_count() -> None:
    order: list[str] = []

    def runner(name: str) -> Runner:
        def run() -> float:
            order.append(name)
            return 1.0

        return Runner(name, run)

    [one, other] = results(Race("x", "y", "ms", runner("a"), [runner("b"), runner("c")]), 2)
    assert order == ["a", "b", "c"] * 3
    assert (one.other, other.other) == ("b", "c")
    assert one.turns == 2


def _deterministic() -> tuple[np.ndarray[Any, Any], np.ndarray[Any, Any]]:
    """Q* of a gridworld whose moves never slip, and zeros to learn it from."""
    family = Gridworld(size=4, p_low=1.0, p_high=1.0)
    tasks = np.array([(2, 3, 1.0)], dtype=[("goal_row", "i4"), ("goal_col", "i4"), ("p", "f8")])
    exact = family.solve(tasks, 0.9)[0][0]
    return exact, np.zeros_like(exact)


def test_the_plain_numba_loop_learns_the_exact_table() -> None:
    exact, q = _deterministic()
    steps = plain_loops.gridworld(
        np.random.default_rng(0), q, 4, 11, 1.0, True, 1.0, 0.9, 0.5, EPISODES, HORIZON
    )
    np.testing.assert_allclose(q, exact, atol=1e-9)
    assert EPISODES <= steps <= EPISODES * HORIZON


@pytest.mark.skipif(plain_c.compiler() is None, reason="no C compiler")
def test_the_plain_c_loop_learns_the_exact_table(tmp_path: Path) -> None:
    loops = plain_c.library(str(plain_c.compiler()), tmp_path)
    assert loops is not None
    exact, q = _deterministic()
    state = np.arange(1, 5, dtype=np.uint64)
    loops.gridworld(state.ctypes.data, q.ctypes.data, 4, 11, 1.0, True, 1.0, 0.9, 0.5, EPISODES, HORIZON)
    np.testing.assert_allclose(q, exact, atol=1e-9)


@pytest.mark.skipif(plain_c.compiler() is None, reason="no C compiler")
def test_the_plain_loops_agree_about_mountain_car(tmp_path: Path) -> None:
    loops = plain_c.library(str(plain_c.compiler()), tmp_path)
    assert loops is not None
    # without a push: with one the steps differ by half from seed to seed
    settings = (30, 0.0, 0.0, True, 0.05, 0.99, 0.5, 2_000, 1_000)
    in_numba = plain_loops.mountain_car(np.random.default_rng(0), np.zeros((900, 3)), *settings)
    state, q = np.arange(1, 5, dtype=np.uint64), np.zeros((900, 3))
    assert loops.mountain_car(state.ctypes.data, q.ctypes.data, *settings) == pytest.approx(in_numba, rel=0.1)


def test_policy_iteration_agrees_with_the_exact_solver() -> None:
    family = Gridworld(size=7)
    tasks = np.array([(4, 5, 0.7)], dtype=[("goal_row", "i4"), ("goal_col", "i4"), ("p", "f8")])
    theirs = table_races.policy_iteration(7, 4 * 7 + 5, 0.7, 0.95)
    np.testing.assert_allclose(theirs, family.solve(tasks, 0.95)[0][0], atol=1e-9)


def test_two_passes_of_numpy_agree_with_the_fit() -> None:
    rng = np.random.default_rng(0)
    q = rng.uniform(-0.2, 1.0, (30, 6, 4))
    eopl = rng.integers(-1, 9, q.shape).astype(np.int32)
    block = {"task": np.arange(30), "q": q, "td_var": q, "eopl": eopl}
    ours = stage.fit([block], stage.Selection(np.ones(30, np.bool_), 0, 0), FitOptions())
    theirs = table_races.two_passes(q, eopl)
    for name in ("mu", "sigma", "n", "eopl_mean", "eopl_std", "value_mean"):
        np.testing.assert_allclose(ours[name], theirs[name], atol=1e-12, err_msg=name)


def test_the_loop_of_resamples_agrees_with_the_intervals() -> None:
    values = np.random.default_rng(1).normal(size=(50, 2))
    low, high = table_races.bootstrap(values, np.random.default_rng(2))
    ours = over_targets(values, np.random.default_rng(2))
    np.testing.assert_allclose([low, high], [ours.low, ours.high], atol=1e-12)
