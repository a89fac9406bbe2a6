from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from qinit_cli.environments.family import draw_tasks
from qinit_cli.environments.gridworld import Gridworld
from qinit_cli.kernels.batch import LaneStreams, Records, Start, learn
from qinit_cli.kernels.policies import Policies
from qinit_cli.kernels.random_streams import lane_seeds, seeds
from qinit_cli.methods import Initial
from qinit_cli.pipeline.sources import sequences
from qinit_cli.pipeline.transfer import learn_targets, statics
from qinit_cli.seeding import Stream
from qinit_cli.tasks import TargetTasks
from qinit_cli.watch import Watch

FAMILY = Gridworld(size=6, variance=2)
TARGETS = TargetTasks(FAMILY, replace(FAMILY.target_learning, episodes=80), 5, True)
INDICES = np.arange(6)


def _initial(start: Any, potential: Any = None) -> Initial:
    nothing = np.zeros(36) if potential is None else potential
    return Initial(start, nothing, Policies(np.empty((0, 36), np.int64)), 0, 0)


ZERO = _initial(np.zeros((36, 4)))


def _rows(initial: Initial, indices: Any = INDICES, targets: TargetTasks = TARGETS) -> dict[str, Any]:
    ids, rows = learn_targets(targets, initial, indices, Watch())
    np.testing.assert_array_equal(ids, indices)
    return rows


def test_a_zero_start_is_plain_q_learning() -> None:
    rows = _rows(ZERO)
    tasks = draw_tasks(FAMILY, 5, Stream.TARGET_TASK, INDICES)
    plain = learn(
        FAMILY.worlds(tasks, []),
        TARGETS.learning,
        Start(np.zeros((36, 4))),
        LaneStreams(
            lane_seeds(sequences(5, Stream.TARGET_DICE, INDICES)),
            seeds(sequences(5, Stream.TARGET_START, INDICES)),
        ),
        Records(bins=80),
        Watch(),
    )
    np.testing.assert_array_equal(rows["steps"], plain.steps)
    np.testing.assert_array_equal(rows["reached"], plain.reached)
    np.testing.assert_array_equal(rows["q"].reshape(plain.q.shape), plain.q)


def test_a_target_does_not_depend_on_its_batch() -> None:
    start = _initial(np.random.default_rng(0).random((36, 4)))
    together = _rows(start)
    for indices in (np.array([3]), np.array([5, 3, 0])):
        alone = _rows(start, indices)
        for name in together.keys() - {"seconds"}:
            np.testing.assert_array_equal(alone[name], together[name][indices], err_msg=name)


def test_every_start_meets_the_same_targets_with_the_same_values() -> None:
    one, other = _rows(ZERO), _rows(_initial(np.full((36, 4), 0.5)))
    for name in ("goal_row", "goal_col", "p", "v_star", "v_eps"):
        np.testing.assert_array_equal(one[name], other[name])
    assert not np.array_equal(one["steps"], other["steps"])


def test_starts_that_differ_by_target_are_each_their_own() -> None:
    tasks = draw_tasks(FAMILY, 5, Stream.TARGET_TASK, INDICES)
    exact, _ = FAMILY.solve(tasks, TARGETS.learning.gamma)
    together = _rows(_initial(exact))
    for index in INDICES:
        alone = _rows(_initial(exact[index]), np.array([index]))
        np.testing.assert_array_equal(together["steps"][index], alone["steps"][0])
        np.testing.assert_array_equal(together["start"][index], exact[index].reshape(6, 6, 4))
    some = _rows(_initial(exact), np.array([4, 1]))
    np.testing.assert_array_equal(some["steps"], together["steps"][[4, 1]])


def test_targets_keep_their_exact_values() -> None:
    rows = _rows(ZERO)
    tasks = draw_tasks(FAMILY, 5, Stream.TARGET_TASK, INDICES)
    exact, _ = FAMILY.solve(tasks, TARGETS.learning.gamma)
    np.testing.assert_array_equal(rows["v_star"], exact[:, 0].max(axis=1))
    np.testing.assert_array_equal(rows["v_eps"], FAMILY.exploring_value(tasks, exact, TARGETS.learning))
    assert (rows["v_eps"] < rows["v_star"]).all()


def test_with_the_optimum_as_start_and_little_learning_returns_come_near_the_exploring_value() -> None:
    # alpha tiny: the table stays exact, so each episode is a draw whose mean is v_eps
    learning = replace(FAMILY.target_learning, episodes=3_000, alpha=1e-9)
    targets = replace(TARGETS, learning=learning, keep_q=False)
    tasks = draw_tasks(FAMILY, 5, Stream.TARGET_TASK, np.array([0]))
    exact, _ = FAMILY.solve(tasks, learning.gamma)
    rows = _rows(_initial(exact[0]), np.array([0]), targets)
    returns = np.where(rows["reached"], learning.gamma ** (rows["steps"] - 1.0), 0)[0]
    error = returns.std() / np.sqrt(len(returns))
    assert abs(returns.mean() - rows["v_eps"][0]) < 4 * error


def test_steps_stay_within_the_horizon_and_what_did_not_reach_the_goal_used_it_up() -> None:
    short = replace(TARGETS, learning=replace(TARGETS.learning, horizon=15))
    rows = _rows(ZERO, targets=short)
    assert rows["steps"].min() >= 1
    assert rows["steps"].max() == 15
    assert (rows["steps"][rows["reached"] == 0] == 15).all()
    assert 0 < rows["reached"].mean() < 1


def test_tables_are_kept_only_where_asked() -> None:
    assert "q" not in _rows(ZERO, targets=replace(TARGETS, keep_q=False))


def test_what_is_the_same_for_every_target_is_kept_once_along_the_state_axes() -> None:
    probability = np.random.default_rng(0)
    start, potential = probability.random((36, 4)), probability.random(36)
    kept = statics(_initial(start, potential), FAMILY)
    np.testing.assert_array_equal(kept["start"], start.reshape(6, 6, 4))
    np.testing.assert_array_equal(kept["potential"], potential.reshape(6, 6))
    rows = _rows(_initial(start, potential))
    assert not {"start", "potential"} & rows.keys()


def test_what_depends_on_the_target_is_kept_with_it() -> None:
    probability = np.random.default_rng(0)
    start, potential = probability.random((6, 36, 4)), probability.random((6, 36))
    assert statics(_initial(start, potential), FAMILY) == {}
    rows = _rows(_initial(start, potential), np.array([3, 1]))
    np.testing.assert_array_equal(rows["start"], start[[3, 1]].reshape(2, 6, 6, 4))
    np.testing.assert_array_equal(rows["potential"], potential[[3, 1]].reshape(2, 6, 6))
