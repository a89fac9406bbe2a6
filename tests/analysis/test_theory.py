from __future__ import annotations

import numpy as np
import pytest
from scipy import stats

from qinit_cli.analysis.theory import theory

GAMMA = 0.9


def lengths(seed: int = 0) -> np.ndarray:
    return np.random.default_rng(seed).integers(1, 40, (60, 3, 2))


def test_certain_tasks_are_worth_gamma_to_one_step_less_than_the_paper_says() -> None:
    eopl = lengths()
    found = theory(GAMMA ** (eopl - 1.0), eopl, GAMMA, np.zeros(1))
    np.testing.assert_allclose(found.length.bias, 0, atol=1e-12)
    np.testing.assert_allclose(found.length.spread, 0, atol=1e-12)
    np.testing.assert_allclose(found.length.mean_ratio, 1, rtol=1e-12)
    np.testing.assert_allclose(found.product.bias, np.log(GAMMA), rtol=1e-12)
    np.testing.assert_allclose(found.product.mean_ratio, GAMMA, rtol=1e-12)
    np.testing.assert_allclose(found.explained, 1, rtol=1e-12)
    np.testing.assert_allclose(found.explained_by_gamma, 1, rtol=1e-12)
    assert found.pooled == pytest.approx(1)


def test_the_product_form_is_right_where_every_slip_ends_the_task() -> None:
    eopl = lengths()
    probability = np.random.default_rng(1).uniform(0.6, 0.9, (60, 1, 1))
    log_path = eopl * np.log(probability)
    found = theory(GAMMA**eopl * np.exp(log_path), eopl, GAMMA, log_path)
    np.testing.assert_allclose(found.product.spread, 0, atol=1e-12)
    assert (found.length.bias > 1).all()
    assert (found.explained < 1).all()


def test_the_explained_share_is_the_squared_correlation() -> None:
    rng = np.random.default_rng(2)
    eopl = lengths()
    logs = -0.3 * eopl + rng.normal(0, 2, eopl.shape) - 5
    found = theory(np.exp(logs), eopl, GAMMA, np.zeros(1))
    residual = total = 0.0
    for cell in np.ndindex(3, 2):
        at = (slice(None), *cell)
        line = stats.linregress(eopl[at], logs[at])
        assert found.explained[cell] == pytest.approx(line.rvalue**2, rel=1e-9)
        fixed = np.var(logs[at] - eopl[at] * np.log(GAMMA)) / np.var(logs[at])
        assert found.explained_by_gamma[cell] == pytest.approx(1 - fixed, rel=1e-9)
        total += 60 * np.var(logs[at])
        residual += 60 * np.var(logs[at]) * (1 - line.rvalue**2)
    assert found.pooled == pytest.approx(1 - residual / total, rel=1e-9)


def test_masked_values_goals_and_endless_paths_have_no_say() -> None:
    eopl = lengths()
    q = GAMMA ** (eopl - 1.0)
    q[0], eopl[1], eopl[2] = 0.0, 0, -1
    found = theory(q, eopl, GAMMA, np.zeros(1))
    assert (found.n == 57).all()
    np.testing.assert_allclose(found.length.spread, 0, atol=1e-12)


def test_without_variance_or_tasks_nothing_is_explained() -> None:
    eopl = np.full((9, 1, 3), 5)
    q = np.full((9, 1, 3), 0.5)
    q[2:, 0, 1] = 0.0
    q[0, 0, 1] = 0.9  # two tasks always lie on a line
    q[:, 0, 2] = 0.0
    found = theory(q, eopl, GAMMA, np.zeros(1))
    assert np.isnan(found.explained).all()
    np.testing.assert_array_equal(np.isnan(found.length.bias), [[False, False, True]])
    assert np.isnan(found.pooled)


def test_lengths_that_never_differ_explain_nothing_of_values_that_do() -> None:
    q = np.linspace(0.1, 0.9, 9).reshape(9, 1, 1)
    found = theory(q, np.full(q.shape, 4), GAMMA, np.zeros(1))
    assert found.explained[0, 0] == 0
    assert found.pooled == 0
