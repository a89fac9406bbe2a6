"""C3 on maps of known width and roughness, and C13's arithmetic."""

from __future__ import annotations

from collections.abc import Callable
from math import ceil, log

import numpy as np
import pytest
from scipy import stats

from qinit_cli.claims import heatmaps, sample_bound
from qinit_cli.claims.evidence import Evidence, Maps
from qinit_cli.claims.setting import VARIANCES, Setting
from qinit_cli.environments.gridworld import Gridworld

At = Callable[..., Setting]
SIZE, SETS = 30, 5
ROW, COLUMN = np.mgrid[:SIZE, :SIZE]


def _bump(width: float, row: int = 20, column: int = 20) -> np.ndarray:  # type: ignore[type-arg]
    return np.exp(-((ROW - row) ** 2 + (COLUMN - column) ** 2) / (2 * width**2))


def _maps(variance: float, *, wider: float = 1.5, peaks: int | None = None) -> Maps:
    """LogQInit a bump about the goals, UCOI a wider one, MaxQInit one with as many peaks as the variance."""
    rough = _bump(6.0)
    for number in range(int(variance if peaks is None else peaks)):
        rough[5 + 2 * (number // 5), 5 + 2 * (number % 5)] += 2.0
    return Maps(
        probabilities=Gridworld(variance=variance).goal_chances().reshape(SIZE, SIZE),
        starts={"logqinit-median": _bump(5.0), "ucoi": _bump(5.0 * wider), "maxqinit": rough},
    )


def _evidence(setting: At, made: Callable[[float], Maps]) -> Evidence:
    by_level = {setting(name): tuple(made(float(name.split()[1])) for _ in range(SETS)) for name in VARIANCES}
    return Evidence(maps=by_level)


def test_maps_as_the_paper_describes_them_hold(setting: At) -> None:
    verdict = heatmaps.CLAIM.judge(_evidence(setting, _maps))
    assert verdict.verdict == "holds", verdict.sentence
    assert verdict.value == pytest.approx(1.0, abs=0.01)


def test_a_map_that_is_no_wider_makes_it_depend_on_what_is_asked(setting: At) -> None:
    verdict = heatmaps.CLAIM.judge(_evidence(setting, lambda variance: _maps(variance, wider=0.7)))
    assert (verdict.verdict, verdict.depends_on) == ("depends", "which of the three is asked")
    assert f"not for {heatmaps.WIDER} (everywhere)" in verdict.sentence


def test_maps_the_other_way_round_do_not_hold(setting: At) -> None:
    def reversed_maps(variance: float) -> Maps:
        maps = _maps(variance)
        away = np.exp(-_bump(8.0)) + 0.01 * np.sin(2.5 * ROW) * np.sin(2.5 * COLUMN)
        return Maps(maps.probabilities, {"logqinit-median": away, "ucoi": _bump(3.0), "maxqinit": _bump(5.0)})

    assert heatmaps.CLAIM.judge(_evidence(setting, reversed_maps)).verdict == "does not hold"


def test_rank_correlation_is_scipys_with_ties() -> None:
    probability = np.random.default_rng(4)
    first, second = probability.integers(0, 5, 50).astype(float), probability.normal(size=50)
    known = stats.spearmanr(first, second).statistic
    assert heatmaps.rank_correlation(first, second) == pytest.approx(known)
    assert np.isnan(heatmaps.rank_correlation(np.ones(50), second))


def test_a_bump_has_one_local_maximum_and_two_apart_have_two() -> None:
    assert heatmaps.local_maxima(_bump(4.0)) == 1
    assert heatmaps.local_maxima(np.maximum(_bump(3.0, 5, 5), _bump(3.0, 22, 22))) == 2
    assert heatmaps.local_maxima(np.ones((4, 4))) == 0


def test_half_the_peak_of_a_cone_is_counted_by_hand() -> None:
    assert heatmaps.half_peak(np.array([[4.0, 2.0, 1.0], [1.9, 2.1, 0.0]])) == pytest.approx(3 / 6)


def test_4754_samples_follow_from_no_usual_chance_of_failure() -> None:
    verdict = sample_bound.CLAIM.judge(Evidence())
    assert (verdict.verdict, verdict.sets) == ("does not hold", 0)
    assert verdict.value == pytest.approx((1 - 1 / 900) ** 4754)
    assert ceil(log(0.005) / log(1 - 1 / 900)) != 4754
    rows = {row.label: row.value for row in verdict.details}
    assert rows["uniform goals: samples for probability of failure 0.005"] == ceil(
        log(0.005) / log(1 - 1 / 900)
    )
    tasks = rows[
        "uniform goals: equally likely tasks that probability of failure 0.05 takes 4754 samples for"
    ]
    assert tasks is not None
    assert log(0.05) / log(1 - 1 / tasks) == pytest.approx(4754)


def test_a_bound_that_does_follow_would_be_found(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sample_bound, "STATED", ceil(log(0.005) / log(1 - 1 / 900)))
    assert sample_bound.CLAIM.judge(Evidence()).verdict == "depends"
