from __future__ import annotations

import numpy as np
import pytest
from scipy import stats

from qinit_cli.analysis.moments import SourceMoments, source_moments


def tables(tasks: int, seed: int = 0) -> tuple[np.ndarray, np.ndarray]:
    """Q (tasks, 3, 4, 2) of very different sizes and EOPL of the same shape, nothing masked."""
    rng = np.random.default_rng(seed)
    q = np.exp(rng.normal(rng.uniform(-20, -1, (3, 4, 2)), rng.uniform(1e-6, 2, (3, 4, 2)), (tasks, 3, 4, 2)))
    return q, rng.integers(1, 60, q.shape).astype(np.int32)


def in_blocks(q: np.ndarray, eopl: np.ndarray, cuts: list[int]) -> SourceMoments:
    return source_moments(zip(np.split(q, cuts), np.split(eopl, cuts), strict=True))


@pytest.mark.parametrize("cuts", [[], [1], [16, 32, 48, 64, 80, 96], [1, 2, 3, 50, 99]])
def test_blocks_of_any_size_give_the_two_pass_values(cuts: list[int]) -> None:
    q, eopl = tables(100)
    found = in_blocks(q, eopl, cuts)
    for moments, values in ((found.log_q, np.log(q)), (found.q, q), (found.eopl, eopl.astype(float))):
        np.testing.assert_allclose(moments.mean, values.mean(axis=0), rtol=1e-12, atol=1e-12)
        np.testing.assert_allclose(moments.std, values.std(axis=0), rtol=1e-12, atol=1e-12)
        squares = ((values - values.mean(axis=0)) ** 2).sum(axis=0)
        np.testing.assert_allclose(moments.squares, squares, rtol=1e-12, atol=1e-12)
        np.testing.assert_array_equal(moments.min, values.min(axis=0))
        np.testing.assert_array_equal(moments.max, values.max(axis=0))
        assert (moments.n == 100).all()
    np.testing.assert_allclose(found.value.mean, q.max(axis=-1).mean(axis=0), rtol=1e-13)
    assert (found.n_masked == 0).all()


def test_unmasked_moments_are_scipys_lognormal_fit() -> None:
    q, eopl = tables(100, seed=3)
    found = in_blocks(q, eopl, [16, 32, 48, 64, 80, 96])
    for cell in np.ndindex(3, 4, 2):
        shape, _, scale = stats.lognorm.fit(q[(slice(None), *cell)], floc=0)
        assert found.log_q.mean[cell] == pytest.approx(np.log(scale), abs=1e-12)
        assert found.log_q.std[cell] == pytest.approx(shape, abs=1e-12)


def test_zero_and_negative_values_are_masked_and_counted_but_count_in_the_mean_value() -> None:
    q = np.array([[[0.5, 0.0]], [[0.25, -0.1]], [[0.0, 0.1]], [[0.125, 0.0]]])
    eopl = np.full(q.shape, 3)
    found = in_blocks(q, eopl, [1, 3])
    np.testing.assert_array_equal(found.q.n, [[3, 1]])
    np.testing.assert_array_equal(found.n_masked, [[1, 3]])
    np.testing.assert_allclose(np.exp(found.log_q.mean), [[0.25, 0.1]], rtol=1e-14)
    np.testing.assert_allclose(found.log_q.std, [[np.log(2) * np.sqrt(2 / 3), 0.0]], rtol=1e-14)
    np.testing.assert_array_equal(found.q.min, [[0.125, 0.1]])
    np.testing.assert_array_equal(found.q.max, [[0.5, 0.1]])
    np.testing.assert_allclose(found.value.mean, [(0.5 + 0.25 + 0.1 + 0.125) / 4], rtol=1e-14)


def test_a_path_that_never_arrives_is_no_length_and_the_goal_has_length_nought() -> None:
    eopl = np.array([-1, 0, 4]).reshape(3, 1, 1)
    found = in_blocks(np.full((3, 1, 1), 0.5), eopl, [2])
    assert found.eopl.n[0, 0] == 2
    assert found.eopl.mean[0, 0] == 2
    assert found.eopl.std[0, 0] == 2


def test_cells_that_no_task_knows_are_nan_and_those_of_one_task_have_no_spread() -> None:
    q = np.zeros((5, 1, 2))
    q[3, 0, 1] = 0.3
    found = in_blocks(q, np.full(q.shape, -1), [2])
    for moments in (found.log_q, found.q):
        for statistic in (moments.mean, moments.std, moments.min, moments.max):
            assert np.isnan(statistic[0, 0])
            assert not np.isnan(statistic[0, 1])
        assert moments.std[0, 1] == 0
    assert np.isnan(found.eopl.mean).all()
    assert found.log_q.mean[0, 1] == np.log(0.3)


def test_equal_tasks_have_no_spread_at_all() -> None:
    q = np.full((97, 1, 1), 0.1)
    found = in_blocks(q, np.ones((97, 1, 1), dtype=int), [10, 20])
    assert found.log_q.std[0, 0] < 1e-15


def test_a_large_common_offset_does_not_cancel_the_spread() -> None:
    values = 1e6 + np.random.default_rng(4).normal(size=(1000, 1, 1))
    found = in_blocks(values, np.ones(values.shape, dtype=int), list(range(16, 1000, 16)))
    assert found.q.std[0, 0] == pytest.approx(values.std(), rel=1e-10)  # mean of squares: 1e-4


def test_the_same_partition_gives_the_same_bits() -> None:
    q, eopl = tables(50)
    first, second = in_blocks(q, eopl, [16, 32]), in_blocks(q.copy(), eopl.copy(), [16, 32])
    assert first.log_q.squares.tobytes() == second.log_q.squares.tobytes()
