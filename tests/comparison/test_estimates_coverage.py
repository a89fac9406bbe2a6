"""Coverage by simulation of every interval that `qinit compare` prints, made as it makes them."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable

import numpy as np
import pytest
from scipy import stats

from qinit_cli.analysis.aggregate import probability_of_improvement
from qinit_cli.analysis.intervals import Estimate, Resampling
from qinit_cli.comparison.estimates import Estimates, estimates
from qinit_cli.comparison.scores import Arrival, Scores

EXPERIMENTS = 1000
Draw = Callable[[np.random.Generator, int, int], tuple[np.ndarray, np.ndarray]]


def baseline_that_reads_no_sources(
    rng: np.random.Generator, sets: int, targets: int
) -> tuple[np.ndarray, np.ndarray]:
    """(R, T) of a method and of its baseline: effects of sets, of targets (skewed) and of both."""
    target = rng.exponential(0.3, (1, targets))
    method = 0.7 + target + rng.normal(0, 0.2, (sets, 1)) + rng.normal(0, 0.2, (sets, targets))
    return method, np.repeat(0.5 + target + rng.normal(0, 0.2, (1, targets)), sets, axis=0)


def baseline_that_reads_them(
    rng: np.random.Generator, sets: int, targets: int
) -> tuple[np.ndarray, np.ndarray]:
    """Both feel how good a source set is."""
    common = rng.exponential(0.3, (1, targets)) + rng.normal(0, 0.1, (sets, 1))
    method = 0.7 + common + rng.normal(0, 0.1, (sets, 1)) + rng.normal(0, 0.2, (sets, targets))
    return method, 0.6 + common + rng.normal(0, 0.1, (sets, 1)) + rng.normal(0, 0.2, (sets, targets))


def targets_of_their_own(rng: np.random.Generator, sets: int, targets: int) -> tuple[np.ndarray, np.ndarray]:
    target = rng.exponential(0.3, (sets, targets))
    method = 0.7 + target + rng.normal(0, 0.2, (sets, 1)) + rng.normal(0, 0.2, (sets, targets))
    return method, 0.5 + target + rng.normal(0, 0.2, (sets, targets))


def one_set(rng: np.random.Generator, sets: int, targets: int) -> tuple[np.ndarray, np.ndarray]:
    """The targets alone are drawn: the interval is conditional on the set."""
    target, own, other = rng.exponential(0.3, (sets, targets)), *rng.normal(0, 0.2, (2, sets, targets))
    return 0.7 + target + own, 0.5 + target + other


def _scores(average: np.ndarray) -> Scores:
    """The better a target's average, the sooner it arrives."""
    arrival = _arrival(average)
    return Scores(average, average, average, average, average, 2 - average, arrival)


def _arrival(average: np.ndarray) -> Arrival:
    times = np.clip(np.ceil(1000 / np.maximum(average, 0.01)), 1, 2000).astype(np.int64)
    return Arrival(times, times < 2000)


def _told(found: Estimates) -> dict[str, Estimate]:
    told = {"average": found.average, "iqm": found.iqm, "difference": found.difference}
    told |= {"ratio": found.ratio, "improvement": found.improvement, "regret": found.regret}
    assert found.threshold is not None
    told |= {"median": found.threshold.median, "restricted mean": found.threshold.restricted_mean}
    return {name: estimate for name, estimate in told.items() if estimate is not None}


def _truth(draw: Draw, *, paired: bool) -> dict[str, float]:
    """Of endless source sets and targets: many draws of 50 sets and 200 targets."""
    rng = np.random.default_rng(1)
    drawn = [draw(rng, 50, 200) for _ in range(400)]
    method, zero = (np.stack(each) for each in zip(*drawn, strict=True))
    times = np.asarray(_arrival(method).times)
    pairs = [probability_of_improvement(own, other) for own, other in drawn[:150]]
    return {
        "average": method.mean(),
        "iqm": float(stats.trim_mean(method, 0.25, axis=None)),
        "difference": method.mean() - zero.mean(),
        "ratio": method.mean() / zero.mean(),
        "improvement": float((method > zero).mean() if paired else np.mean(pairs)),
        "regret": 2 - method.mean(),
        "median": float(np.median(times)),
        "restricted mean": times.mean(),
    }


@pytest.mark.soak
@pytest.mark.parametrize(
    ("draw", "sets", "targets", "shared"),
    [
        (baseline_that_reads_no_sources, 20, 50, True),
        (baseline_that_reads_them, 20, 50, True),
        (targets_of_their_own, 20, 50, False),
        (one_set, 1, 100, True),
    ],
)
def test_every_interval_covers_as_it_says(draw: Draw, sets: int, targets: int, shared: bool) -> None:
    rng = np.random.default_rng(11)
    truth = _truth(draw, paired=sets == 1 or not shared)
    covered: Counter[str] = Counter()
    for number in range(EXPERIMENTS):
        method, zero = draw(rng, sets, targets)
        found = estimates(
            [_scores(row) for row in method],
            [_scores(row) for row in zero],
            "return",
            Resampling(shared, resamples=1000),
            number,
        )
        for name, estimate in _told(found).items():
            covered[name] += estimate.low <= truth[name] <= estimate.high
    share = {name: covered[name] / EXPERIMENTS for name in truth}
    print(draw.__name__, share)
    # 93 to 97 %, and two standard errors of so many experiments
    assert {name: value for name, value in share.items() if not 0.915 <= value <= 0.985} == {}
