"""A reward of -1 a step until the goal, which the paper calls equivalent to 1 there; Q_step = (gamma Q - 1) / (1 - gamma)."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from quantecon.markov import DiscreteDP

import qinit_cli as qinit
from qinit_cli.artefacts.settings import StoredFamily
from qinit_cli.environments.family import bounds_of
from qinit_cli.errors import NotAllowed, UsageError
from qinit_cli.rewards import UNIT, ReturnBounds

GAMMA = 0.95
LOW = -1 / (1 - GAMMA)
FAMILIES = {
    "gridworld": lambda reward: qinit.families.gridworld(size=6, variance=1, reward=reward),
    "windy": lambda reward: qinit.families["windy-gridworld"](size=5, reward=reward),
    "mixture": lambda reward: qinit.families["mixture-gridworld"](size=6, variances="1", reward=reward),
}
STARTS = ("mean", "maxqinit", "ucoi", "logqinit-median", "logqinit-mean", "logqinit-quantile", "posterior")


def mapped(returns: Any) -> Any:
    return (GAMMA * np.asarray(returns) - 1) / (1 - GAMMA)


@pytest.fixture(scope="module")
def fits() -> dict[tuple[str, str], qinit.Fit]:
    return {
        (name, reward): qinit.fit(qinit.train_sources(family(reward), tasks=20, learner="exact"))
        for name, family in FAMILIES.items()
        for reward in ("goal", "step")
    }


@pytest.mark.parametrize("method", STARTS)
@pytest.mark.parametrize("family", FAMILIES)
def test_a_start_is_that_of_a_reward_of_1_at_the_goal_mapped(fits: Any, family: str, method: str) -> None:
    start = fits[family, "step"].start(method)
    np.testing.assert_allclose(start, mapped(fits[family, "goal"].start(method)), rtol=0, atol=1e-12)
    assert start.min() >= LOW
    assert start.max() <= 0


def test_zero_is_a_return_of_zero_which_costs_never_exceed(fits: Any) -> None:
    assert not fits["gridworld", "step"].start("zero").any()


def test_the_log_normal_is_that_of_the_share_of_the_attainable_return(fits: Any) -> None:
    goal, step = fits["gridworld", "goal"], fits["gridworld", "step"]
    np.testing.assert_allclose(step["mu"], goal["mu"] + np.log(GAMMA), rtol=0, atol=1e-10)
    np.testing.assert_allclose(step["sigma"], goal["sigma"], rtol=0, atol=1e-10)
    np.testing.assert_array_equal(step["n"], goal["n"])
    np.testing.assert_allclose(step["mean"], mapped(goal["mean"]), rtol=0, atol=1e-12)
    scale = GAMMA / (1 - GAMMA)
    np.testing.assert_allclose(step["std"], scale * goal["std"], rtol=0, atol=1e-12)
    np.testing.assert_allclose(
        step["library_td_var"], scale**2 * goal["library_td_var"], rtol=1e-9, atol=1e-9
    )


def test_exact_tables_of_costs_are_those_of_an_independent_solver() -> None:
    family = FAMILIES["windy"]("step")
    sources = qinit.train_sources(family, tasks=3, learner="exact")
    tasks = np.array(
        list(zip(sources["wind"], sources["direction"], strict=True)), [("wind", "f8"), ("direction", "i4")]
    )
    tables, states = family.tables(tasks), 25
    goal = family.goal_row * 5 + family.goal_col
    for task in range(3):
        chance = np.zeros((states, 4, states))
        for outcome in range(8):
            after = np.where(tables.after[task, ..., outcome] < 0, goal, tables.after[task, ..., outcome])
            np.add.at(chance, (*np.indices((states, 4)), after), tables.probability[task, ..., outcome])
        reward = np.full((states, 4), -1.0)
        chance[goal], reward[goal] = np.eye(states)[goal], 0.0
        value = DiscreteDP(reward, chance, GAMMA).solve(method="policy_iteration").v
        there = np.arange(states) != goal
        q = sources["q"][task].reshape(states, 4)
        np.testing.assert_allclose(q[there], (reward + GAMMA * chance @ value)[there], rtol=0, atol=1e-9)


def test_targets_learn_step_by_step_as_with_a_reward_of_1_at_the_goal(fits: Any) -> None:
    runs = [
        qinit.transfer("logqinit-median", fits["gridworld", reward], tasks=10, episodes=50, evaluate_every=25)
        for reward in ("goal", "step")
    ]
    np.testing.assert_array_equal(runs[0]["steps"], runs[1]["steps"])
    np.testing.assert_array_equal(runs[0]["reached"], runs[1]["reached"])
    np.testing.assert_allclose(runs[1].returns(), mapped(runs[0].returns()), rtol=0, atol=1e-12)
    for name in ("v_star", "v_eps", "eval_return"):
        np.testing.assert_allclose(runs[1][name], mapped(runs[0][name]), rtol=0, atol=1e-11)


def test_hypotheses_are_weighed_as_with_a_reward_of_1_at_the_goal(fits: Any) -> None:
    # shares are gamma times as large, and so is the least deviation of a TD error that counts the same
    floors = {"goal": 0.01, "step": 0.01 * GAMMA}
    runs = [
        qinit.transfer(qinit.methods.posterior(floor=floor), fits["gridworld", reward], tasks=10, episodes=50)
        for reward, floor in floors.items()
    ]
    np.testing.assert_array_equal(runs[0]["steps"], runs[1]["steps"])
    np.testing.assert_allclose(runs[0]["weight"], runs[1]["weight"], rtol=0, atol=1e-6)


def test_learned_sources_come_to_the_exact_table_and_pairs_never_visited_are_unknown() -> None:
    family = qinit.families.gridworld(size=4, variance=1, reward="step")
    settings = {"tasks": 4, "episodes": 4_000, "alpha": "visits:0.7", "epsilon": 1.0}
    learned = qinit.train_sources(family, **settings)
    exact = qinit.train_sources(family, tasks=4, learner="exact")
    known = learned["visits"] > 0
    assert np.abs(learned["q"] - exact["q"])[known].max() < 0.5  # of values from -13 to -1
    assert not known.all()  # nobody acts at a goal
    assert not learned["q"][~known].any()  # the start, which is the largest return
    fit = qinit.fit(learned)
    np.testing.assert_array_equal(fit["n"], known.sum(axis=0))
    assert fit["max"].max() < 0


def test_every_method_transfers_and_what_is_compared_are_returns(fits: Any) -> None:
    fit = fits["gridworld", "step"]
    names = [*STARTS, "zero", "optimal", "ptrs", "drs", "ops-tl"]
    runs = [qinit.transfer(name, fit, tasks=12, episodes=30) for name in names]
    rows = {row["method"]: row for row in qinit.compare(runs).rows}
    assert set(names) == set(rows)
    for run, name in zip(runs, names, strict=True):
        assert rows[name]["return"] == pytest.approx(run.returns().mean(), abs=1e-12)
        assert LOW <= rows[name]["return"] < 0
    assert rows["optimal"]["regret"] < rows["logqinit-median"]["regret"]
    lived = qinit.lifelong("logqinit-median", fit, tasks=3, episodes=30, update=True, min_visits=5)
    assert (lived["added"] > 0).any()
    tuned = qinit.tune(
        "logqinit-quantile", qinit.train_sources(FAMILIES["gridworld"]("step"), tasks=12, learner="exact")
    )
    assert tuned["average"].min() >= LOW
    assert tuned["average"].max() < 0


def test_an_episode_without_the_goal_counts_as_if_the_goal_never_came(fits: Any) -> None:
    run = qinit.transfer("zero", fits["gridworld", "step"], tasks=4, episodes=5, horizon=3)
    assert not run["reached"].any()
    np.testing.assert_allclose(run.returns(), LOW)


def test_half_of_the_way_is_counted_from_the_least_return(fits: Any) -> None:
    run = qinit.transfer("optimal", fits["gridworld", "step"], tasks=4, episodes=60)
    [row] = qinit.compare([run]).rows
    assert row["time_to_threshold"] == 50  # the first window there is
    assert row["censored"] == 0


def test_the_reward_is_stored_only_where_it_is_not_the_usual_one() -> None:
    stored = {reward: StoredFamily.of(FAMILIES["gridworld"](reward)).spec() for reward in ("goal", "step")}
    assert "reward" not in stored["goal"]
    assert stored["step"]["reward"] == "step"
    assert FAMILIES["gridworld"]("step").label.endswith("-reward-step")
    assert bounds_of(FAMILIES["gridworld"]("goal"), GAMMA) == UNIT
    assert bounds_of(FAMILIES["gridworld"]("step"), 0.5) == ReturnBounds(-2.0, 0.0)


def test_returns_without_bounds_are_refused() -> None:
    with pytest.raises(UsageError, match="--gamma is 1, and returns of costs have no bounds"):
        qinit.train_sources(FAMILIES["gridworld"]("step"), tasks=2, gamma=1.0, episodes=2)


def test_theory_of_a_reward_at_the_goal_is_not_checked_on_costs() -> None:
    sources = qinit.train_sources(FAMILIES["gridworld"]("step"), tasks=4, learner="exact")
    with pytest.raises(NotAllowed, match="--check-theory is of a reward of 1 at the goal"):
        qinit.fit(sources, check_theory=True)
