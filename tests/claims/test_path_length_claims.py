"""C1, C8 and C9 on path lengths drawn from what is claimed, and from what is not."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from scipy import stats

from qinit_cli.claims import path_lengths
from qinit_cli.claims.evidence import Evidence, Lengths, LengthTests
from qinit_cli.claims.setting import NOISES, VARIANCES, Setting
from qinit_cli.claims.verdict import Detail, Verdict

At = Callable[..., Setting]
SETS, TASKS, CELLS = 10, 100, 200


def _tested(p_among: object, p_beyond: object) -> LengthTests:
    p = np.concatenate([np.broadcast_to(p_among, CELLS // 2), np.broadcast_to(p_beyond, CELLS // 2)])
    table = np.asarray(p, float).reshape(CELLS, 1)
    among = np.arange(CELLS) < CELLS // 2
    return LengthTests(
        table, np.full_like(table, 0.98), np.full_like(table, -0.2), np.full_like(table, 0.1), among
    )


def _row(verdict: Verdict, label: str) -> Detail:
    [row] = [row for row in verdict.details if row.label == label]
    return row


@pytest.fixture
def everywhere(setting: At) -> Callable[..., Evidence]:
    """p of state-actions among and beyond the goals, at every variance of the paper."""

    def made(among: Callable[[np.random.Generator], object], beyond: object, sets: int = SETS) -> Evidence:
        probability = np.random.default_rng(1)
        return Evidence(
            tested={
                setting(name): tuple(_tested(among(probability), beyond) for _ in range(sets))
                for name in VARIANCES
            }
        )

    return made


def test_p_that_are_uniform_are_what_normal_lengths_would_give(everywhere: Callable[..., Evidence]) -> None:
    verdict = path_lengths.GRIDWORLD_CLAIM.judge(
        everywhere(lambda probability: probability.random(CELLS // 2), 0.5)
    )
    assert verdict.verdict == "holds"
    assert verdict.value == pytest.approx(0.05, abs=0.03)


def test_lengths_rejected_among_the_goals_alone_make_it_depend_on_the_state(
    everywhere: Callable[..., Evidence],
) -> None:
    verdict = path_lengths.GRIDWORLD_CLAIM.judge(everywhere(lambda probability: 0.001, 0.5))
    assert (verdict.verdict, verdict.depends_on) == ("depends", "whether the state lies among the goals")
    assert (verdict.value, verdict.low, verdict.high) == (1.0, 1.0, 1.0)
    overall = _row(verdict, "variance 7: share of state-actions rejected at 5 %")
    assert (overall.value, overall.holds) == (0.5, None)
    assert _row(verdict, "variance 7: median |skewness|").value == pytest.approx(0.2)


def test_lengths_rejected_everywhere_are_not_normal(everywhere: Callable[..., Evidence]) -> None:
    assert (
        path_lengths.GRIDWORLD_CLAIM.judge(everywhere(lambda probability: 0.01, 0.01)).verdict
        == "does not hold"
    )


def test_corrections_stand_beside_the_raw_share(everywhere: Callable[..., Evidence]) -> None:
    verdict = path_lengths.GRIDWORLD_CLAIM.judge(everywhere(lambda probability: 0.04, 0.04))
    assert _row(verdict, "variance 1: share of state-actions rejected at 5 %").value == 1.0
    # equal p are all rejected by Benjamini-Hochberg; Benjamini-Yekutieli multiplies them by the harmonic number
    assert _row(verdict, "variance 1: the same by Benjamini-Hochberg").value == 1.0
    assert _row(verdict, "variance 1: the same by Benjamini-Yekutieli").value == 0.0


def test_four_source_sets_withhold_the_verdict(everywhere: Callable[..., Evidence]) -> None:
    verdict = path_lengths.GRIDWORLD_CLAIM.judge(everywhere(lambda probability: 0.5, 0.5, sets=4))
    assert verdict.verdict == "not judged"


def _lengths(
    setting: At, draw: Callable[[np.random.Generator, float], object], floor: float = 5.0
) -> Evidence:
    """Ten sets at every noise of the paper, and two without noise."""
    probability = np.random.default_rng(2)
    by_level = {
        setting(name): tuple(
            Lengths(np.sort(np.rint(np.asarray(draw(probability, level)))), 0) for _ in range(SETS)
        )
        for level, name in enumerate(NOISES)
    }
    still = tuple(Lengths(np.sort(np.rint(probability.normal(150, floor, TASKS))), 0) for _ in range(2))
    return Evidence(lengths=by_level | {setting("noise 0"): still})


def test_rounded_normal_lengths_are_normal_at_the_start(setting: At) -> None:
    evidence = _lengths(setting, lambda probability, level: probability.normal(150, 5 + 5 * level, TASKS))
    verdict = path_lengths.START_CLAIM.judge(evidence)
    assert verdict.verdict == "holds"
    assert verdict.sets == SETS


def test_lengths_with_two_humps_are_not(setting: At) -> None:
    def humps(probability: np.random.Generator, level: float) -> object:
        return np.concatenate(
            [probability.normal(100, 5, TASKS // 2), probability.normal(160, 5, TASKS // 2)]
        )

    verdict = path_lengths.START_CLAIM.judge(_lengths(setting, humps))
    assert verdict.verdict == "does not hold"
    assert (verdict.value, verdict.high) == (1.0, 1.0)
    assert verdict.low == pytest.approx(stats.binomtest(10, 10).proportion_ci(method="exact").low)


def test_normal_at_some_noises_makes_it_depend_on_the_noise(setting: At) -> None:
    def skewed(probability: np.random.Generator, level: float) -> object:
        return probability.normal(150, 6, TASKS) if level < 2 else 100 + probability.exponential(40, TASKS)

    verdict = path_lengths.START_CLAIM.judge(_lengths(setting, skewed))
    assert (verdict.verdict, verdict.depends_on) == ("depends", "the distribution")


def test_equal_means_and_growing_spreads_hold(setting: At) -> None:
    evidence = _lengths(setting, lambda probability, level: probability.normal(150, 4 * 1.5**level, TASKS))
    verdict = path_lengths.NOISE_CLAIM.judge(evidence)
    assert verdict.verdict == "holds"
    ratio = _row(verdict, "noise 0.01: standard deviation over that of the level below")
    assert ratio.value == pytest.approx(1.5, rel=0.1)
    assert ratio.low is not None
    assert ratio.high is not None
    assert ratio.low < 1.5 < ratio.high


def test_means_that_move_and_spreads_that_stay_do_not(setting: At) -> None:
    evidence = _lengths(setting, lambda probability, level: probability.normal(170 + level, 5, TASKS))
    assert path_lengths.NOISE_CLAIM.judge(evidence).verdict == "does not hold"


def test_means_that_move_while_spreads_grow_make_it_depend_on_which_is_asked(setting: At) -> None:
    evidence = _lengths(setting, lambda probability, level: probability.normal(180, 5 * 2**level, TASKS))
    verdict = path_lengths.NOISE_CLAIM.judge(evidence)
    assert (verdict.verdict, verdict.depends_on) == ("depends", "whether mean or spread is asked")
    assert verdict.value == pytest.approx(30, abs=5)


def test_without_noise_free_sources_means_are_not_judged(setting: At) -> None:
    evidence = _lengths(setting, lambda probability, level: probability.normal(150, 5 * 2**level, TASKS))
    lengths = {at: sets for at, sets in evidence.lengths.items() if at.level > 0}
    verdict = path_lengths.NOISE_CLAIM.judge(replace(evidence, lengths=lengths))
    assert verdict.verdict == "not judged"
    assert "train-sources mountain-car --noise 0." in verdict.sentence
