from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from scipy import stats

from qinit_cli.analysis.alternatives import DENSITIES, akaike, held_out_scores

CELLS = 40
FITS: dict[str, tuple[stats.rv_continuous, dict[str, float]]] = {
    "lognormal": (stats.lognorm, {"floc": 0}),
    "normal": (stats.norm, {}),
    "gamma": (stats.gamma, {"floc": 0}),
    "weibull": (stats.weibull_min, {"floc": 0}),
    "beta": (stats.beta, {"floc": 0, "fscale": 1}),
}


def positive(seed: int = 0) -> np.ndarray:
    """(100, CELLS) values below 1, of every size and spread."""
    rng = np.random.default_rng(seed)
    q = np.exp(rng.normal(rng.uniform(-9, -3, CELLS), rng.uniform(0.05, 1.2, CELLS), (100, CELLS)))
    return np.minimum(q, 0.999)


@pytest.mark.parametrize("name", sorted(FITS))
def test_akaike_equals_that_of_scipys_fits(name: str) -> None:
    q = positive()
    found = akaike(q)
    row = found.scores[found.names.index(name)]
    distribution, fixed = FITS[name]
    for cell in range(CELLS):
        fitted = distribution.fit(q[:, cell], **fixed)
        assert row[cell] == pytest.approx(4 - 2 * distribution.logpdf(q[:, cell], *fitted).sum(), abs=1e-4)


@pytest.mark.parametrize("name", sorted(FITS))
def test_held_out_scores_equal_those_of_scipys_fits_of_the_other_folds(name: str) -> None:
    q = positive(1)[:, :6]
    folds = np.arange(100) % 4
    found = held_out_scores(q, folds)
    distribution, fixed = FITS[name]
    for cell in range(6):
        scores = [
            distribution.logpdf(q[folds == fold, cell], *distribution.fit(q[folds != fold, cell], **fixed))
            for fold in range(4)
        ]
        assert found.scores[found.names.index(name), cell] == pytest.approx(np.mean(scores), abs=1e-5)


def test_the_empirical_score_is_that_of_scipys_kernel_density_of_the_logarithm() -> None:
    q = positive(2)[:, :3]
    folds = np.where(np.arange(100) < 70, -1, 0)  # learned from, never scored
    row = held_out_scores(q, folds).scores[-1]
    for cell in range(3):
        train, held = np.log(q[:70, cell]), np.log(q[70:, cell])
        width = (
            0.9 * min(train.std(ddof=1), np.subtract(*np.quantile(train, [0.75, 0.25])) / 1.349) * 70**-0.2
        )
        known = stats.gaussian_kde(train, bw_method=width / train.std(ddof=1)).logpdf(held) - held
        assert row[cell] == pytest.approx(known.mean(), abs=1e-9)


DRAWS: dict[str, Callable[[np.random.Generator], np.ndarray]] = {
    "lognormal": lambda rng: np.exp(rng.normal(-5, 0.8, (400, 60))),
    "normal": lambda rng: rng.normal(5.0, 1.0, (400, 60)),
    "gamma": lambda rng: rng.gamma(1.0, 1e-4, (400, 60)),
    "weibull": lambda rng: 0.5 * rng.weibull(6.0, (400, 60)),
    "beta": lambda rng: rng.beta(0.5, 0.5, (400, 60)),
    "empirical": lambda rng: np.exp(rng.choice([-9.0, -2.0], (400, 60)) + rng.normal(0, 0.1, (400, 60))),
}


@pytest.mark.parametrize("name", sorted(DRAWS))
def test_the_distribution_that_the_values_come_from_wins_most_cells(name: str) -> None:
    q = np.maximum(DRAWS[name](np.random.default_rng(3)), 1e-300)
    shares = held_out_scores(q, np.arange(400) % 5).shares(larger_wins=True)
    # an exponential is both a gamma and a Weibull, and nearly the beta of small values
    kin = {"gamma": ("gamma", "weibull", "beta")}.get(name, (name,))
    assert sum(shares[winner] for winner in kin) > 0.6
    assert sum(shares.values()) == pytest.approx(1)
    if name not in ("empirical", "gamma"):
        assert max(akaike(q).shares(larger_wins=False).items(), key=lambda share: share[1])[0] == name


def test_masked_values_have_no_say() -> None:
    q = positive(4)
    known = akaike(q[:60]).scores
    q[60:] = -1.0
    np.testing.assert_allclose(akaike(q).scores, known, rtol=1e-9)


def test_values_of_one_have_no_beta_and_the_others_go_on() -> None:
    q = positive(5)[:, :4]
    q[7] = 1.0
    learned_from = held_out_scores(q, np.where(np.arange(100) < 50, -1, 0))
    scored = held_out_scores(q, np.where(np.arange(100) < 50, 0, -1))
    for found, larger_wins in ((akaike(q), False), (learned_from, True), (scored, True)):
        beta = found.names.index("beta")
        assert np.isinf(found.scores[beta]).all()
        assert np.isfinite(np.delete(found.scores, beta, axis=0)).all()
        assert found.shares(larger_wins)["beta"] == 0


def test_constant_or_scarce_cells_are_not_testable_and_win_nothing() -> None:
    q = np.full((20, 2), 0.5)
    q[:, 1] = 0.0
    q[:7, 1] = np.linspace(0.1, 0.7, 7)
    for found in (akaike(q), held_out_scores(q, np.arange(20) % 2)):
        assert np.isnan(found.scores).all()
        assert sum(found.shares(larger_wins=True).values()) == 0


def test_every_density_integrates_to_one() -> None:
    train = positive(6)[:, :1]
    at = np.exp(np.linspace(-30, 5, 20_001))[:, None]
    for name, density in DENSITIES.items():
        values = np.exp(density(train, np.ones(train.shape, dtype=bool), at))[:, 0]
        above = 1.0 if name != "normal" else stats.norm.sf(0, train.mean(), train.std())
        assert np.trapezoid(values, at[:, 0]) == pytest.approx(above, abs=1e-3), name
