from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from qinit_cli.environments.family import draw_tasks, relative_error
from qinit_cli.environments.gridworld import Gridworld
from qinit_cli.pipeline.sources import bin_sizes, learn_sources
from qinit_cli.seeding import Stream
from qinit_cli.tasks import SourceTasks
from qinit_cli.watch import Watch

FAMILY = Gridworld(size=6, variance=2)
LEARNING = replace(FAMILY.source_learning, episodes=250)
LEARNED = SourceTasks(FAMILY, "q-learning", LEARNING, 3)
EXACT = replace(LEARNED, learner="exact")


def _rows(sources: SourceTasks, *indices: int) -> dict[str, Any]:
    ids, rows = learn_sources(sources, np.array(indices), Watch())
    assert ids.tolist() == list(indices)
    return rows


@pytest.mark.parametrize("sources", [LEARNED, EXACT], ids=["learned", "exact"])
def test_a_task_does_not_depend_on_its_batch(sources: SourceTasks) -> None:
    together = _rows(sources, *range(9))
    for indices in ((4,), (7, 4), (8, 1, 4, 0, 2)):
        alone = _rows(sources, *indices)
        for name in together.keys() - {"seconds"}:
            np.testing.assert_array_equal(alone[name], together[name][list(indices)], err_msg=name)


def test_what_is_kept_of_a_task_is_its_own_draw() -> None:
    rows = _rows(LEARNED, 5, 2)
    drawn = draw_tasks(FAMILY, 3, Stream.SOURCE_TASK, np.array([5, 2]))
    for name in ("goal_row", "goal_col", "p"):
        np.testing.assert_array_equal(rows[name], drawn[name])


def test_exact_sources_hold_the_solved_tables_and_no_learning() -> None:
    rows = _rows(EXACT, 0, 1)
    q, td_var = FAMILY.solve(draw_tasks(FAMILY, 3, Stream.SOURCE_TASK, np.arange(2)), LEARNING.gamma)
    np.testing.assert_array_equal(rows["q"], q.reshape(2, 6, 6, 4))
    np.testing.assert_array_equal(rows["td_var"], td_var.reshape(2, 6, 6, 4))
    assert not rows["visits"].any()
    assert not rows["steps"].any()
    assert rows["solved"].all()
    assert "curve_steps" not in rows


def test_visits_add_up_to_the_steps_and_the_curve_to_the_episodes() -> None:
    rows = _rows(LEARNED, *range(4))
    np.testing.assert_array_equal(rows["visits"].sum(axis=(1, 2, 3)), rows["steps"])
    sizes = bin_sizes(LEARNING.episodes, LEARNED.bins)
    assert sizes.sum() == LEARNING.episodes
    np.testing.assert_allclose(rows["curve_steps"] @ sizes, rows["steps"], rtol=1e-5)
    assert ((rows["curve_reached"] >= 0) & (rows["curve_reached"] <= 1)).all()


def test_path_lengths_are_those_of_the_learned_table() -> None:
    rows = _rows(LEARNED, *range(4))
    tasks = draw_tasks(FAMILY, 3, Stream.SOURCE_TASK, np.arange(4))
    expected = FAMILY.path_lengths(tasks, rows["q"].reshape(4, 36, 4), LEARNING.horizon)
    np.testing.assert_array_equal(rows["eopl"].reshape(4, 36, 4), expected)
    np.testing.assert_array_equal(
        rows["solved"], FAMILY.solved(tasks, rows["q"].reshape(4, 36, 4), LEARNING.horizon)
    )


def test_the_goal_is_never_updated() -> None:
    rows = _rows(LEARNED, *range(4))
    for task in range(4):
        goal = rows["goal_row"][task], rows["goal_col"][task]
        assert not rows["q"][task][goal].any()
        assert not rows["visits"][task][goal].any()


def test_sources_that_start_anywhere_start_everywhere_but_at_the_goal() -> None:
    # with an epsilon of 0 and a horizon of 1 each episode visits the cell that it starts in
    learning = replace(LEARNING, episodes=4_000, horizon=1)
    rows = _rows(SourceTasks(FAMILY, "q-learning", learning, 0), 0)
    visits = rows["visits"][0].sum(axis=2)
    goal = int(rows["goal_row"][0]), int(rows["goal_col"][0])
    assert visits[goal] == 0
    elsewhere = np.ones((6, 6), bool)
    elsewhere[goal] = False
    expected = 4_000 / 35
    assert abs(visits[elsewhere] - expected).max() < 5 * np.sqrt(expected)


def test_sources_that_start_at_the_target_start_do_so() -> None:
    learning = replace(LEARNING, episodes=50, horizon=1, start="fixed")
    rows = _rows(SourceTasks(FAMILY, "q-learning", learning, 0), 0)
    assert rows["visits"][0, 0, 0].sum() == rows["visits"].sum() == 50


def test_a_stopped_watch_leaves_nothing_half_done() -> None:
    watch = Watch()
    watch.stop()
    ids, rows = learn_sources(LEARNED, np.arange(3), watch)
    assert len(ids) == 0
    assert {len(values) for values in rows.values()} == {0}


def test_seeds_give_other_tasks() -> None:
    one, other = _rows(LEARNED, 0), _rows(replace(LEARNED, seed=4), 0)
    assert one["p"][0] != other["p"][0]
    assert not np.array_equal(one["q"], other["q"])


def test_relative_error_is_of_what_can_be_known() -> None:
    tasks = draw_tasks(FAMILY, 0, Stream.SOURCE_TASK, np.arange(2))
    exact, _ = FAMILY.solve(tasks, 0.95)
    error = relative_error(FAMILY, 0.95, tasks, exact * 1.25)
    goals = tasks["goal_row"] * 6 + tasks["goal_col"]
    assert np.isnan(error[[0, 1], goals]).all()
    assert np.isnan(error).sum() == 2 * 4
    np.testing.assert_allclose(error[~np.isnan(error)], 0.25, rtol=1e-12)


def _pooled_error(family: Gridworld, tasks: int, episodes: int) -> float:
    learning = replace(family.source_learning, episodes=episodes)
    rows = _rows(SourceTasks(family, "q-learning", learning, 0), *range(tasks))
    drawn = draw_tasks(family, 0, Stream.SOURCE_TASK, np.arange(tasks))
    q = rows["q"].reshape(tasks, family.size**2, 4)
    return float(np.nanmedian(relative_error(family, learning.gamma, drawn, q)))


def test_learned_tables_come_within_three_percent_of_exact_ones_on_a_small_grid() -> None:
    assert _pooled_error(Gridworld(size=10), tasks=8, episodes=20_000) < 0.03


def test_more_episodes_come_closer() -> None:
    assert _pooled_error(FAMILY, 4, 500) > 5 * _pooled_error(FAMILY, 4, 20_000)


@pytest.mark.soak
def test_learned_tables_come_within_three_percent_of_exact_ones_at_the_papers_size() -> None:
    assert _pooled_error(Gridworld(), tasks=100, episodes=100_000) < 0.03
