from __future__ import annotations

import numpy as np
import pytest

from qinit_cli.analysis.returns import (
    asymptotic,
    average,
    discounted_returns,
    jumpstart,
    restricted_steps,
    smoothed,
)

STEPS = np.array([[1, 3, 1000], [1000, 2, 5]], dtype=np.int32)
REACHED = np.array([[True, True, False], [True, True, True]])


def test_the_return_is_discounted_once_less_than_the_steps_and_nought_without_the_goal() -> None:
    found = discounted_returns(STEPS, REACHED, 0.95)
    np.testing.assert_allclose(found, [[1, 0.95**2, 0], [0.95**999, 0.95, 0.95**4]], rtol=1e-12)


def test_stored_flags_count_as_such() -> None:
    flags = REACHED.astype(np.uint8)
    np.testing.assert_array_equal(
        discounted_returns(STEPS, flags, 0.9), discounted_returns(STEPS, REACHED, 0.9)
    )


def test_an_undiscounted_return_is_success() -> None:
    np.testing.assert_array_equal(discounted_returns(STEPS, REACHED, 1.0), REACHED)


def test_steps_are_restricted_to_the_horizon() -> None:
    np.testing.assert_array_equal(restricted_steps(STEPS, 500), [[1, 3, 500], [500, 2, 5]])


def test_summaries_of_a_straight_line() -> None:
    curves = np.arange(1000.0)[None, :] + np.array([[0.0], [5.0]])
    np.testing.assert_allclose(average(curves), [499.5, 504.5])
    np.testing.assert_allclose(jumpstart(curves), [4.5, 9.5])
    np.testing.assert_allclose(asymptotic(curves), [949.5, 954.5])


@pytest.mark.parametrize(
    ("episodes", "last"), [(1, 1), (9, 1), (10, 1), (11, 2), (30, 3), (70, 7), (1000, 100)]
)
def test_the_last_tenth_is_whole_episodes_and_never_empty(episodes: int, last: int) -> None:
    assert asymptotic(np.arange(float(episodes))) == pytest.approx(np.arange(episodes)[-last:].mean())


def test_a_short_run_has_a_jumpstart_all_the_same() -> None:
    assert jumpstart(np.array([1.0, 2.0, 3.0])) == 2.0


def test_smoothing_looks_back_over_the_window_and_leaves_constants_alone() -> None:
    curve = np.array([[1.0, 2.0, 4.0, 8.0, 16.0]])
    np.testing.assert_allclose(smoothed(curve, 2), [[1, 1.5, 3, 6, 12]])
    np.testing.assert_allclose(smoothed(curve, 1), curve)
    np.testing.assert_allclose(smoothed(curve, 99)[:, -1], curve.mean())
    np.testing.assert_array_equal(smoothed(np.full((1, 50), 0.1), 7), np.full((1, 50), 0.1))


def test_smoothing_equals_a_plain_loop() -> None:
    curves = np.random.default_rng(0).random((3, 200))
    plain = np.stack([curves[:, max(0, e - 49) : e + 1].mean(axis=1) for e in range(200)], axis=1)
    np.testing.assert_allclose(smoothed(curves, 50), plain, rtol=1e-12)
