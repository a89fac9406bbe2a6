"""C4 to C7, C11 and C12 on scores whose order is known."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import pytest

from qinit_cli.claims import initialisations, transfer_methods
from qinit_cli.claims.evidence import Evidence
from qinit_cli.claims.initialisations import CLAIMED
from qinit_cli.claims.scores import Arms
from qinit_cli.claims.setting import NOISES, UNIFORM, Setting
from qinit_cli.claims.transfer_methods import DECAYS, PLAIN, label
from qinit_cli.methods.ops_tl import OpsTl

Make = Callable[..., Evidence]

PAPER = {"logqinit-median": 0.06, "ucoi": 0.05, "logqinit-mean": 0.04, "maxqinit": 0.03, "zero": 0.02}


@pytest.fixture
def given(setting: Callable[..., Setting], scores: Callable[..., Arms]) -> Make:
    """Scores of the same means at each of the distributions."""

    def made(means: Mapping[str, float], names: tuple[str, ...], sets: int = 10) -> Evidence:
        return Evidence(scores={setting(name): scores(means, sets=sets) for name in names})

    return made


def _both(first: Evidence, second: Evidence) -> Evidence:
    return Evidence(scores={**first.scores, **second.scores})


def test_the_papers_order_makes_its_claims_hold(given: Make) -> None:
    evidence = given(PAPER, CLAIMED)
    for claim in (initialisations.BEST, initialisations.THIRD_CLAIM, initialisations.LAST):
        assert claim.judge(evidence).verdict == "holds"
    third = initialisations.THIRD_CLAIM.judge(evidence)
    assert (third.value, third.low, third.high) == (3, 3, 3)


def test_another_order_makes_them_fail(given: Make) -> None:
    means = {"logqinit-median": 0.02, "ucoi": 0.03, "logqinit-mean": 0.04, "maxqinit": 0.05, "zero": 0.06}
    evidence = given(means, CLAIMED)
    for claim in (initialisations.BEST, initialisations.THIRD_CLAIM, initialisations.LAST):
        assert claim.judge(evidence).verdict == "does not hold"
    assert initialisations.THIRD_CLAIM.judge(evidence).value == 2


def test_uniform_goals_alone_may_break_them(given: Make) -> None:
    normal = given(PAPER, CLAIMED)
    best = initialisations.BEST.judge(_both(normal, given(PAPER | {"zero": 0.09}, (UNIFORM,))))
    assert best.verdict == "depends"
    assert "not for logqinit-median minus zero (uniform goals)" in best.sentence
    third = initialisations.THIRD_CLAIM.judge(_both(normal, given(PAPER | {"ucoi": 0.01}, (UNIFORM,))))
    assert (third.verdict, third.depends_on) == ("depends", "the distribution")


def test_methods_that_cannot_be_told_apart_have_no_rank(given: Make) -> None:
    third = initialisations.THIRD_CLAIM.judge(given(PAPER | {"ucoi": PAPER["logqinit-mean"]}, CLAIMED))
    assert third.verdict == "does not hold"
    assert (third.low, third.high) == (2, 3)


def test_nine_source_sets_carry_no_claim_of_rank(given: Make) -> None:
    verdict = initialisations.BEST.judge(given(PAPER, CLAIMED, sets=9))
    assert (verdict.verdict, verdict.sets) == ("not judged", 9)


def test_variance_1_is_told_and_does_not_decide(given: Make) -> None:
    evidence = _both(given(PAPER, CLAIMED), given(PAPER | {"zero": 0.9}, ("variance 1",)))
    verdict = initialisations.BEST.judge(evidence)
    assert verdict.verdict == "holds"
    assert {row.holds for row in verdict.details if row.label.startswith("variance 1:")} == {None}


def _transfer(ops: Mapping[str, float], gain: float = 0.005) -> dict[str, float]:
    """LogQInit at .05, ptrs and drs below it, ops-tl by its decay; every + better by `gain`."""
    plain = {"ptrs": 0.03, "drs": 0.02} | {label("ops-tl", options=decay): ops[decay] for decay in DECAYS}
    plus = {}
    for name, mean in plain.items():
        method, _, options = name.partition(" ")
        plus[label(method, "logqinit-median", options and f" {options}")] = mean + gain
    return {"logqinit-median": 0.05, "logqinit-mean": 0.049} | plain | plus


def test_labels_are_those_that_the_method_gives_itself() -> None:
    made = [OpsTl(), OpsTl(rho=1.0), OpsTl(rho=1.0, nu=1.0)]
    assert [one.label for one in made] == [label("ops-tl", options=decay) for decay in DECAYS]
    plus = OpsTl(init="ucoi", rho=1.0, explore_while_following=True)
    assert plus.label == label("ops-tl", "ucoi", DECAYS[1] + transfer_methods.HANDICAPPED)


def test_beating_policy_transfer_stands_only_with_every_decay(given: Make) -> None:
    slow = dict.fromkeys(DECAYS, 0.03)
    assert transfer_methods.BEATEN.judge(given(_transfer(slow), ("variance 7",))).verdict == "holds"
    fast = slow | {" rho=1.0 nu=1.0": 0.08}
    verdict = transfer_methods.BEATEN.judge(given(_transfer(fast), ("variance 7",)))
    assert (verdict.verdict, verdict.depends_on) == ("depends", "the pair of methods and OPS-TL's decay")
    assert "logqinit-median minus ops-tl rho=1.0 nu=1.0" in verdict.sentence
    assert transfer_methods.without_decay("x minus ops-tl rho=1.0 nu=1.0") == "x minus ops-tl"


def test_nothing_of_it_holds_where_all_are_better_without(given: Make) -> None:
    means = _transfer(dict.fromkeys(DECAYS, 0.08), gain=-0.005) | {"ptrs": 0.07, "drs": 0.075}
    assert transfer_methods.BEATEN.judge(given(means, ("variance 7",))).verdict == "does not hold"


def test_one_decay_is_no_evidence_for_all(given: Make) -> None:
    means = _transfer(dict.fromkeys(DECAYS, 0.03))
    two = {name: mean for name, mean in means.items() if "nu=1.0" not in name}
    verdict = transfer_methods.BEATEN.judge(given(two, ("variance 7",)))
    assert verdict.verdict == "not judged"
    assert "logqinit-median minus ops-tl rho=1.0 nu=1.0" in verdict.sentence


def test_noise_decides_which_initialisation_is_said_to_be_first(given: Make) -> None:
    claim = initialisations.BY_NOISE
    high = given(PAPER | {"logqinit-mean": 0.07}, NOISES[3:])
    assert claim.judge(_both(given(PAPER, NOISES[:2]), high)).verdict == "holds"
    same = claim.judge(given(PAPER, NOISES))
    assert same.verdict == "depends"
    assert "logqinit-mean minus logqinit-median" in same.sentence
    assert claim.judge(given(dict.fromkeys(PAPER, 0.01) | {"zero": 0.05}, NOISES)).verdict == "does not hold"


def test_a_gain_below_a_twentieth_of_logqinits_is_none(given: Make) -> None:
    means = dict.fromkeys(PLAIN, 0.005) | {"zero": 0.0, "logqinit-median": 0.2}
    claim = transfer_methods.NOTHING_GAINED
    assert claim.judge(given(means, NOISES)).verdict == "holds"
    verdict = claim.judge(given(means | {"ptrs": 0.1}, NOISES))
    assert (verdict.verdict, verdict.depends_on) == ("depends", "the method")
    assert "not for ptrs minus zero (everywhere)" in verdict.sentence
    all_gain = dict.fromkeys(means, 0.2) | {"zero": 0.0}
    assert claim.judge(given(all_gain, NOISES)).verdict == "does not hold"
