from __future__ import annotations

import pytest

from qinit_cli.analysis.sample_size import tasks_for_all_targets, tasks_for_one_target


@pytest.mark.parametrize(("p_min", "delta"), [(0.01, 0.05), (0.5, 0.25), (1 / 876, 0.05), (0.3, 0.001)])
def test_the_bound_is_the_first_number_of_draws_that_misses_a_task_rarely_enough(
    p_min: float, delta: float
) -> None:
    m = tasks_for_one_target(p_min, delta)
    assert (1 - p_min) ** m <= delta * (1 + 1e-12) < (1 - p_min) ** (m - 1) * (1 + 1e-9)


def test_all_of_a_hundred_tasks_want_more_draws_than_one() -> None:
    assert tasks_for_one_target(0.01, 0.05) == 299
    assert tasks_for_all_targets(0.01, 0.05, 100) == 757


def test_a_certain_task_needs_one_draw() -> None:
    assert tasks_for_one_target(1.0, 0.05) == 1
    assert tasks_for_one_target(0.999, 0.5) == 1


def test_a_task_that_hardly_ever_comes_wants_its_share_of_draws() -> None:
    assert tasks_for_one_target(1e-17, 0.05) == pytest.approx(2.995732e17, rel=1e-6)


@pytest.mark.parametrize(
    ("p_min", "delta", "tasks"),
    [(0.0, 0.1, 1), (1.1, 0.1, 1), (0.1, 0.0, 1), (0.1, 1.0, 1), (0.1, 0.1, 0), (0.1, 0.1, 11)],
)
def test_impossible_settings_are_refused(p_min: float, delta: float, tasks: int) -> None:
    with pytest.raises(ValueError, match=r"needed|more than 1"):
        tasks_for_all_targets(p_min, delta, tasks)
