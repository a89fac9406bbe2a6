"""C2 and C10 on values that are log-normal, normal or neither."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from scipy import stats

from qinit_cli.claims import log_normality
from qinit_cli.claims.evidence import Evidence, Values
from qinit_cli.claims.log_normality import GRIDWORLD_PLACES, MOUNTAIN_CAR_PLACES
from qinit_cli.claims.setting import NOISES, Setting

At = Callable[..., Setting]
SETS, TASKS = 10, 100


def _lognormal(probability: np.random.Generator) -> object:
    return np.exp(probability.normal(-3, 0.5, TASKS))


def _normal(probability: np.random.Generator) -> object:
    return np.clip(probability.normal(0.5, 0.15, TASKS), 0.01, None)


def _evidence(
    setting: At, names: tuple[str, ...], places: tuple[str, ...], draws: list[Callable[..., object]]
) -> Evidence:
    probability = np.random.default_rng(3)
    return Evidence(
        values={
            setting(name): tuple(
                Values(places, tuple(np.sort(np.asarray(draw(probability), float)) for draw in draws))
                for _ in range(SETS)
            )
            for name in names
        }
    )


def test_log_normal_but_in_the_middle_is_what_the_paper_claims(setting: At) -> None:
    evidence = _evidence(setting, ("variance 7",), GRIDWORLD_PLACES, [_lognormal, _normal, _lognormal])
    verdict = log_normality.GRIDWORLD_CLAIM.judge(evidence)
    assert verdict.verdict == "holds"
    assert verdict.sets == SETS


def test_the_opposite_does_not_hold(setting: At) -> None:
    evidence = _evidence(setting, ("variance 7",), GRIDWORLD_PLACES, [_normal, _lognormal, _normal])
    assert log_normality.GRIDWORLD_CLAIM.judge(evidence).verdict == "does not hold"


def test_log_normal_in_the_middle_too_depends_on_the_state(setting: At) -> None:
    evidence = _evidence(setting, ("variance 7",), GRIDWORLD_PLACES, [_lognormal] * 3)
    verdict = log_normality.GRIDWORLD_CLAIM.judge(evidence)
    assert (verdict.verdict, verdict.depends_on) == ("depends", "the state")
    assert "ln Q at (20, 20)" in verdict.sentence


def test_shares_count_scipys_rejections(setting: At) -> None:
    evidence = _evidence(setting, ("variance 7",), GRIDWORLD_PLACES, [_lognormal, _normal, _lognormal])
    verdict = log_normality.GRIDWORLD_CLAIM.judge(evidence)
    [sets] = evidence.values.values()
    for at, place in enumerate(GRIDWORLD_PLACES):
        samples = [np.log(one.positive[at]) for one in sets]
        known = np.mean([stats.shapiro(sample).pvalue <= 0.05 for sample in samples])
        values = {row.label: row.value for row in verdict.details}
        assert values[f"variance 7: {log_normality.aspect('ln Q', place)}"] == pytest.approx(known)
        pooled = stats.shapiro(np.concatenate(samples)).pvalue
        assert values[f"variance 7: p of ln Q at {place}, all tasks pooled"] == pytest.approx(
            pooled, rel=1e-3
        )


def test_mountain_car_is_asked_at_a_low_and_a_high_noise(setting: At) -> None:
    draws = [_lognormal, _lognormal, _normal]
    claim = log_normality.MOUNTAIN_CAR_CLAIM
    some = claim.judge(_evidence(setting, NOISES[:3], MOUNTAIN_CAR_PLACES, draws))
    assert some.verdict == "not judged"
    assert some.sentence.startswith("Lacking: noise 0.015.")
    assert claim.judge(_evidence(setting, NOISES, MOUNTAIN_CAR_PLACES, draws)).verdict == "holds"
