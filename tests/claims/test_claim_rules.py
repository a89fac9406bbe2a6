"""From rows to a verdict: the rules that all claims share."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import pytest

from qinit_cli.claims.claim import Claim, Finding
from qinit_cli.claims.evidence import Evidence
from qinit_cli.claims.over_sets import OverSets
from qinit_cli.claims.registry import CLAIMS
from qinit_cli.claims.setting import Setting
from qinit_cli.claims.verdict import Verdict

At = Callable[..., Setting]
Holds = Callable[[str, str], bool]
NEEDS = (("variance 1", "here"), ("variance 1", "there"), ("variance 3", "here"), ("variance 3", "there"))


def _rows(setting: At, holds: Holds, variant: str = "") -> list[Finding]:
    return [
        Finding(
            setting(distribution, variant), aspect, OverSets(0.5, 0.4, 0.6, 10), holds(distribution, aspect)
        )
        for distribution, aspect in NEEDS
    ]


def _judged(rows: list[Finding], **changes: Any) -> Verdict:
    claim = Claim(
        name="C0",
        statement="All is well.",
        source="nowhere",
        statistic="a number",
        aspects="the place",
        needs=NEEDS,
        headline=NEEDS[0],
        command="qinit train-sources {family} --seed SEED",
        look=lambda evidence: rows,
    )
    return replace(claim, **changes).judge(Evidence())


def _always(distribution: str, aspect: str) -> bool:
    return True


def _never(distribution: str, aspect: str) -> bool:
    return False


def test_what_holds_in_every_row_holds(setting: At) -> None:
    verdict = _judged(_rows(setting, _always))
    assert (verdict.verdict, verdict.depends_on, verdict.sets) == ("holds", "", 10)
    assert (verdict.value, verdict.low, verdict.high) == (0.5, 0.4, 0.6)
    assert verdict.sentence == "At variance 1, here: 0.500 [0.400, 0.600]. It holds in all 4 rows."


def test_what_holds_in_no_row_does_not_hold(setting: At) -> None:
    verdict = _judged(_rows(setting, _never))
    assert verdict.verdict == "does not hold"
    assert verdict.sentence.endswith("It does not hold in any of 4 rows.")


@pytest.mark.parametrize(
    ("holds", "on", "failing"),
    [
        (
            lambda distribution, aspect: distribution == "variance 1",
            "the distribution",
            "here, there (variance 3)",
        ),
        (lambda distribution, aspect: aspect == "here", "the place", "there (everywhere)"),
        (
            lambda distribution, aspect: (distribution, aspect) != NEEDS[3],
            "the distribution and the place",
            "there (variance 3)",
        ),
    ],
)
def test_what_holds_in_some_rows_depends_on_what_tells_them_apart(
    holds: Holds, on: str, failing: str, setting: At
) -> None:
    verdict = _judged(_rows(setting, holds))
    assert (verdict.verdict, verdict.depends_on) == ("depends", on)
    assert f"rows; not for {failing}." in verdict.sentence


def test_the_fewer_rows_are_named(setting: At) -> None:
    verdict = _judged(_rows(setting, lambda distribution, aspect: (distribution, aspect) == NEEDS[0]))
    assert verdict.sentence.endswith("It holds in 1 of 4 rows: here (variance 1).")


def test_a_sentence_names_no_more_than_six_aspects(setting: At) -> None:
    rows = [
        Finding(setting("variance 1"), str(number), OverSets(0.0, sets=9), holds=number > 8)
        for number in range(18)
    ]
    needs = tuple(("variance 1", str(number)) for number in range(18))
    verdict = _judged(rows, needs=needs, headline=needs[0])
    assert verdict.sentence.endswith("not for 0, 1, 2, 3, 4, 5 (variance 1); and 3 others.")


def test_one_distribution_is_no_evidence_for_all(setting: At) -> None:
    rows = [row for row in _rows(setting, _always) if row.setting.distribution == "variance 1"]
    verdict = _judged(rows)
    assert verdict.verdict == "not judged"
    made = "qinit train-sources gridworld --variance 3 --seed SEED"
    assert verdict.sentence == f"Lacking: variance 3. Made by {made}."
    assert [row.label for row in verdict.details] == ["variance 1: here", "variance 1: there"]


def test_too_few_source_sets_withhold_the_verdict_and_are_told(setting: At) -> None:
    rows = [replace(row, found=replace(row.found, sets=9)) for row in _rows(setting, _always)]
    assert _judged(rows).verdict == "holds"
    verdict = _judged(rows, sets=10)
    assert (verdict.verdict, verdict.sets) == ("not judged", 9)
    assert verdict.sentence.startswith("Lacking: 10 source sets where there are 9 (variance 1, 3).")


def test_what_lacks_beside_other_rows_of_its_distribution_is_named(setting: At) -> None:
    rows = [row for row in _rows(setting, _always) if row.aspect == "here"]
    rows += [Finding(setting("variance 3"), "elsewhere", OverSets(0.0, sets=2))]
    verdict = _judged(rows)
    assert verdict.sentence.startswith("Lacking: there (everywhere). Made by")
    assert verdict.sets == 10


def test_what_reads_no_sources_needs_no_source_sets(setting: At) -> None:
    rows = [replace(row, found=replace(row.found, sets=0)) for row in _rows(setting, _always)]
    assert _judged(rows, sets=10).verdict == "holds"


def test_evidence_that_is_smaller_than_the_papers_does_not_decide(setting: At) -> None:
    rows = [replace(row, setting=replace(row.setting, full=False)) for row in _rows(setting, _always)]
    verdict = _judged(rows)
    assert verdict.verdict == "not judged"
    assert "evidence of the paper's size" in verdict.sentence


def test_rows_beside_the_claim_and_other_distributions_do_not_decide(setting: At) -> None:
    rows = _rows(setting, _always)
    beside = [
        Finding(setting("variance 1"), "elsewhere", OverSets(0.1, sets=10)),
        Finding(setting("variance 2"), "here", OverSets(0.1, sets=10), holds=False),
    ]
    assert _judged(rows + beside).verdict == "holds"
    assert _judged(rows + beside, also=("variance 2",)).verdict == "depends"


def test_the_papers_own_settings_decide_where_they_are_complete(setting: At) -> None:
    exact = _rows(setting, _always, "exact sources")
    both = _judged(exact + _rows(setting, _always))
    assert (both.verdict, both.depends_on) == ("holds", "")
    assert both.sentence.startswith("At variance 1")
    alone = _judged(exact)
    assert (alone.verdict, alone.sentence[:20]) == ("holds", "With exact sources: ")
    assert alone.details[0].label == "variance 1, exact sources: here"


def test_settings_that_change_the_answer_are_what_it_depends_on(setting: At) -> None:
    verdict = _judged(_rows(setting, _always) + _rows(setting, _never, "exact sources"))
    assert (verdict.verdict, verdict.depends_on) == ("depends", "exact sources")
    assert verdict.sentence.endswith("With exact sources it does not hold.")


def test_a_row_without_an_interval_has_none(setting: At) -> None:
    [row] = _judged([Finding(setting("variance 1"), "here", OverSets(math.nan, sets=1))]).details
    assert (row.value, row.low, row.high) == (None, None, None)


def test_without_evidence_every_claim_but_the_arithmetic_one_says_what_is_lacking() -> None:
    judged = {claim.name: claim.judge(Evidence()) for claim in CLAIMS}
    assert list(judged) == [f"C{number}" for number in range(1, 14)]
    assert judged.pop("C13").verdict == "does not hold"
    for verdict in judged.values():
        assert verdict.verdict == "not judged"
        assert verdict.sentence.startswith("Lacking: ")
        assert "Made by qinit train-sources " in verdict.sentence


def test_ranks_want_ten_source_sets() -> None:
    assert {claim.name for claim in CLAIMS if claim.sets >= 10} == {"C4", "C5", "C6", "C7", "C11", "C12"}


@pytest.mark.parametrize("claim", CLAIMS, ids=lambda claim: claim.name)
def test_every_headline_is_one_of_the_rows_that_decide(claim: Claim) -> None:
    assert claim.headline in claim.needs
