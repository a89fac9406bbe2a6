from __future__ import annotations

import math

import numpy as np
import pytest
from mpmath import mp

from qinit_cli.analysis.estimators import (
    MEANS,
    MEDIANS,
    confluent_limit,
    lognormal_mean,
    lognormal_median,
    lognormal_quantile,
)


def summary(logs: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """n, mu and SS of the rows of `logs` (cells, n)."""
    mu = logs.mean(axis=1)
    return np.full(len(logs), logs.shape[1]), mu, ((logs - mu[:, None]) ** 2).sum(axis=1)


@pytest.mark.parametrize("z", [-6000.0, -625.0, -99.0, -25.0, -2.5, -1e-3, 0.0, 1e-3, 3.0, 80.0, 9000.0])
@pytest.mark.parametrize("b", [0.5, 1.0, 4.5, 49.5, 4999.5])
def test_confluent_limit_function_equals_fifty_digit_arithmetic(b: float, z: float) -> None:
    with mp.workdps(50):
        exact = float(mp.hyp0f1(b, z))
    # near its zeros an oscillating function has no relative accuracy: there its amplitude is the scale
    scale = max(abs(exact), 1e-3 if z < -b else 0.0)
    assert confluent_limit(np.array([b]), np.array([z]))[0] == pytest.approx(exact, abs=1e-11 * scale)


def test_confluent_limit_function_of_one_half_is_a_cosine() -> None:
    x = np.linspace(0, 60, 500)
    np.testing.assert_allclose(confluent_limit(np.full(500, 0.5), -(x**2) / 4), np.cos(x), atol=1e-12)
    np.testing.assert_allclose(confluent_limit(np.full(500, 0.5), x**2 / 4), np.cosh(x), rtol=1e-12)


def test_two_tasks_by_hand() -> None:
    n, mu, squares = np.array([2]), np.array([-3.0]), np.array([2.0])  # logarithms -2 and -4
    assert lognormal_mean(n, mu, squares, "mle")[0] == pytest.approx(math.exp(-2.5))
    assert lognormal_mean(n, mu, squares, "umvue")[0] == pytest.approx((math.exp(-2) + math.exp(-4)) / 2)
    assert lognormal_mean(n, mu, squares, "zellner")[0] == pytest.approx(math.exp(-3 + 1 - 1.5))
    assert lognormal_mean(n, mu, squares, "shen")[0] == pytest.approx(math.exp(-3 + 2 / 18))
    assert lognormal_median(n, mu, squares, "mle")[0] == pytest.approx(math.exp(-3))
    assert lognormal_median(n, mu, squares, "umvue")[0] == pytest.approx(math.exp(-3) * math.cos(1))
    assert lognormal_median(n, mu, squares, "zellner")[0] == pytest.approx(math.exp(-4.5))


@pytest.mark.parametrize("estimate", [lognormal_mean, lognormal_median])
def test_umvue_is_unbiased_within_simulation_error(estimate) -> None:  # type: ignore[no-untyped-def]
    rng = np.random.default_rng(1)
    mu, sigma = -2.0, 1.2
    exact = math.exp(mu + sigma**2 / 2) if estimate is lognormal_mean else math.exp(mu)
    for n in (2, 5, 30):
        values = estimate(*summary(rng.normal(mu, sigma, (40_000, n))), "umvue")
        error = values.std() / math.sqrt(len(values))
        assert abs(values.mean() - exact) < 4 * error
    biased = estimate(*summary(rng.normal(mu, sigma, (40_000, 5))), "mle")
    assert abs(biased.mean() - exact) > 5 * biased.std() / math.sqrt(len(biased))  # the test can tell


@pytest.mark.parametrize("estimator", ["zellner", "shen"])
def test_shrunken_means_err_less_than_maximum_likelihood(estimator: str) -> None:
    rng = np.random.default_rng(2)
    logs = summary(rng.normal(0.0, 1.0, (40_000, 8)))

    def mean_squared_error(name: str) -> float:
        return float(np.mean((lognormal_mean(*logs, name) - math.exp(0.5)) ** 2))

    assert mean_squared_error(estimator) < 0.9 * mean_squared_error("mle")


@pytest.mark.parametrize("estimator", sorted(MEANS))
def test_below_two_tasks_every_estimator_is_the_likelihood_one_and_without_any_unknown(
    estimator: str,
) -> None:
    n, mu, squares = np.array([[0, 1]]), np.array([[0.0, -1.0]]), np.zeros((1, 2))
    np.testing.assert_array_equal(lognormal_mean(n, mu, squares, estimator), [[np.nan, math.exp(-1)]])
    if estimator in MEDIANS:
        np.testing.assert_array_equal(lognormal_median(n, mu, squares, estimator), [[np.nan, math.exp(-1)]])


@pytest.mark.parametrize("estimator", sorted(MEANS))
def test_estimators_agree_where_the_tasks_agree_or_are_many(estimator: str) -> None:
    certain = lognormal_mean(np.array([7]), np.array([-1.5]), np.array([0.0]), estimator)
    assert certain[0] == pytest.approx(math.exp(-1.5), rel=1e-15)
    many = lognormal_mean(np.array([10**7]), np.array([-1.5]), np.array([0.8e7]), estimator)
    assert many[0] == pytest.approx(math.exp(-1.1), rel=1e-6)


def test_shen_has_no_median() -> None:
    with pytest.raises(ValueError, match=r"shen has no median: choose one of mle, umvue, zellner$"):
        lognormal_median(np.array([3]), np.zeros(1), np.ones(1), "shen")


def test_quantiles_equal_those_of_scipys_lognormal() -> None:
    from scipy import stats

    for quantile in (0.025, 0.1587, 0.5, 0.9):
        value = lognormal_quantile(np.array([-2.0]), np.array([0.6]), quantile)
        assert value[0] == pytest.approx(stats.lognorm.ppf(quantile, 0.6, scale=math.exp(-2)), rel=1e-12)


def test_absurd_spread_overflows_to_infinity_without_a_warning() -> None:
    assert lognormal_mean(np.array([50]), np.array([0.0]), np.array([50 * 372.0**2]), "umvue")[0] == np.inf
