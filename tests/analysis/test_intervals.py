from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from scipy import stats

from qinit_cli.analysis import resampling
from qinit_cli.analysis.intervals import Resampling, over_targets, tails

SHARED, OWN = Resampling(shared=True), Resampling(shared=False)


def skewed(targets: int, seed: int = 0) -> np.ndarray:
    """(targets, 3) values whose distributions have nothing in common."""
    rng = np.random.default_rng(seed)
    return np.stack(
        [rng.exponential(1, targets), rng.normal(5, 2, targets), rng.random(targets) ** 8], axis=1
    )


@pytest.mark.parametrize("at_once", [1_000_000, 700])
def test_the_interval_is_scipys_from_the_same_generator(
    monkeypatch: pytest.MonkeyPatch, at_once: int
) -> None:
    monkeypatch.setattr(resampling, "_VALUES_AT_ONCE", at_once)
    values = skewed(40)
    found = over_targets(values, np.random.default_rng(9), resamples=2000)
    for metric in range(3):
        generator = np.random.default_rng(9)
        known = stats.bootstrap(
            (values[:, metric],),
            np.mean,
            n_resamples=2000,
            method="percentile",
            rng=generator,
            confidence_level=1 - 2 * tails(40)[0],
        ).confidence_interval
        np.testing.assert_allclose([found.low[metric], found.high[metric]], known, rtol=1e-12)
    np.testing.assert_allclose(found.estimate, values.mean(axis=0), rtol=1e-14)


def test_a_difference_in_pairs_is_tighter_than_the_difference_of_two_intervals() -> None:
    rng = np.random.default_rng(1)
    baseline = rng.normal(0, 10, (60, 1))
    method = baseline + 1 + rng.normal(0, 0.1, (60, 1))
    paired = over_targets(method - baseline, rng)
    assert 0.9 < paired.low[0] < 1 < paired.high[0] < 1.1


def test_memory_is_bounded_by_the_block(monkeypatch: pytest.MonkeyPatch) -> None:
    sizes = list(resampling._blocks(10_000, 5_000))
    assert sum(sizes) == 10_000
    assert max(sizes) * 5_000 <= 1_000_000
    assert list(resampling._blocks(3, 5_000_000)) == [1, 1, 1]


def test_resampled_means_of_one_value_are_that_value() -> None:
    [sample] = resampling.of_targets(8, np.random.default_rng(0), resamples=50)
    np.testing.assert_array_equal(sample.means(np.full((1, 8, 2), 0.25)), np.full((50, 2), 0.25))


@pytest.mark.parametrize("units", [5, 10, 20, 200])
def test_the_mean_of_a_normal_sample_has_students_interval(units: int) -> None:
    """Samples of n units spread by the standard deviation with ddof 0, over sqrt(n): their tails must undo that."""
    values = stats.norm.ppf((np.arange(units) + 0.5) / units)
    known = stats.ttest_1samp(values, 0).confidence_interval(0.95)
    spread = values.std() / np.sqrt(units)
    np.testing.assert_allclose(stats.norm.ppf(tails(units)) * spread, [known.low, known.high], rtol=1e-9)


def test_of_endless_units_the_tails_are_plain() -> None:
    assert tails() == pytest.approx((0.025, 0.975))
    assert tails(10**9) == pytest.approx((0.025, 0.975))


def test_what_cannot_be_resampled_has_an_estimate_but_no_interval() -> None:
    rng = np.random.default_rng(0)
    unknown = [
        over_targets(np.array([[2.0]]), rng),
        SHARED.interval(np.full((1, 1, 1), 2.0), rng),
        SHARED.interval(np.full((5, 1, 1), 2.0), rng),
        OWN.interval(np.full((1, 1, 1), 2.0), rng),
    ]
    for interval in unknown:
        assert interval.estimate[0] == 2
        assert np.isnan([interval.low[0], interval.high[0]]).all()


def test_of_one_source_set_targets_are_resampled_whoever_shares_them() -> None:
    values = skewed(12)
    alone = over_targets(values, np.random.default_rng(5))
    for rule in (SHARED, OWN):
        found = rule.interval(values[None], np.random.default_rng(5))
        np.testing.assert_array_equal([found.low, found.high], [alone.low, alone.high])


def test_a_plain_loop_over_sets_and_targets_gives_the_same_spread() -> None:
    rng = np.random.default_rng(3)
    values = rng.normal(size=(6, 1, 1)) + rng.normal(size=(1, 9, 1)) + rng.normal(size=(6, 9, 1))
    crossed, within = [], []
    for _ in range(20_000):
        sets = rng.integers(0, 6, 6)
        crossed.append(values[np.ix_(sets, rng.integers(0, 9, 9))].mean())
        within.append(np.mean([values[s, rng.integers(0, 9, 9)].mean() for s in sets]))
    for found, loop in ((SHARED.interval(values, rng), crossed), (OWN.interval(values, rng), within)):
        np.testing.assert_allclose(
            [found.low[0], found.high[0]], np.quantile(loop, tails(6)), atol=0.15 * np.std(loop)
        )


def test_between_source_sets_the_interval_is_wider_than_within_one() -> None:
    rng = np.random.default_rng(4)
    values = rng.normal(0, 3, (10, 1, 1)) + rng.normal(0, 1, (10, 100, 1))
    conditional = over_targets(values.mean(axis=0), rng)
    for several in (SHARED.interval(values, rng), OWN.interval(values, rng)):
        assert several.high[0] - several.low[0] > 5 * (conditional.high[0] - conditional.low[0])


Draw = Callable[[np.random.Generator], np.ndarray]


def crossed_sets(rng: np.random.Generator) -> np.ndarray:
    """20 source sets on 50 shared targets: effects of sets, of targets (skewed) and of both; mean 0."""
    sets = rng.normal(0, 1, (20, 1, 1))
    targets = rng.exponential(1, (1, 50, 1)) - 1
    return sets + targets + rng.normal(0, 1, (20, 50, 1))


def own_targets(rng: np.random.Generator) -> np.ndarray:
    return rng.normal(0, 1, (20, 1, 1)) + rng.exponential(1, (20, 50, 1)) - 1


@pytest.mark.soak
@pytest.mark.parametrize(("shared", "draw"), [(True, crossed_sets), (False, own_targets)])
def test_intervals_over_twenty_source_sets_cover_as_they_say(shared: bool, draw: Draw) -> None:
    rng = np.random.default_rng(11)
    experiments = 4000
    covered = 0
    for _ in range(experiments):
        found = Resampling(shared, 600).interval(draw(rng), rng)
        covered += int(found.low[0] <= 0 <= found.high[0])
    assert 0.93 <= covered / experiments <= 0.97
