"""From what was found in each setting to one verdict, by the same rules for every claim.

A claim names what it needs: distributions, what is looked at in each (an aspect: a state, a pair of methods), and how many
source sets. Where all of that is there at the paper's size, the verdict is "holds" if the claim does in every row that
decides, "does not hold" if in none, else "depends". Where anything is lacking it is "not judged": one distribution is no
evidence for all, and what was found so far stands in the details. The paper's own settings decide where they are complete,
else the first others that are; where complete evidence with other settings answers otherwise, the verdict is "depends", on
them.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Iterable, Sequence
from dataclasses import dataclass

from qinit_cli.analysis.intervals import FEW_SOURCE_SETS
from qinit_cli.claims.evidence import Evidence
from qinit_cli.claims.over_sets import OverSets
from qinit_cli.claims.setting import Setting
from qinit_cli.claims.verdict import Answer, Detail, Verdict

ENOUGH_SETS = FEW_SOURCE_SETS  # below, intervals over source sets cover less than they say
RANK_SETS = 10  # that a claim of rank rests on

TOLD = 6  # aspects that a sentence names: all of them stand in the details

Need = tuple[str, str]  # a distribution and an aspect


@dataclass(frozen=True)
class Finding:
    """What was found in one setting, and whether the claim holds there."""

    setting: Setting
    aspect: str  # what was looked at: a state, a pair of methods
    found: OverSets
    holds: bool | None = None  # None where it is told beside the claim, or too few sets could tell

    def detail(self) -> Detail:
        """The row of it."""
        value, low, high = (
            number if math.isfinite(number) else None
            for number in (self.found.value, self.found.low, self.found.high)
        )
        return Detail(f"{self.setting.label}: {self.aspect}", value, low, high, self.found.sets, self.holds)


@dataclass(frozen=True)
class Claim:
    """One claim of the paper and how it is judged."""

    name: str  # "C4"
    statement: str  # what the paper claims, one sentence
    source: str  # where it claims so
    statistic: str  # what decides
    aspects: str  # what aspects are, for "depends on": "the state"
    needs: tuple[Need, ...]
    headline: Need  # whose number stands for the claim
    command: str  # makes what is lacking; {family} stands for a distribution's options
    look: Callable[[Evidence], Iterable[Finding]]
    sets: int = ENOUGH_SETS
    option: tuple[str, Callable[[str], str]] = (
        "",
        str,
    )  # of some aspects: its name, and an aspect without it
    also: tuple[str, ...] = ()  # distributions that decide where they are there, but need not be
    digits: int = 3  # of its number in sentences

    def judge(self, evidence: Evidence) -> Verdict:
        """The verdict that the evidence allows."""
        found = sorted(self.look(evidence), key=lambda finding: finding.setting.order)
        variants = {variant: self._of(found, variant) for variant in _variants(found)}
        lacks = {variant: self._lacking(findings) for variant, findings in variants.items()}
        complete = [variant for variant in variants if not lacks[variant]]
        if not complete:
            variant = next(iter(variants), "")
            lacking = lacks.get(variant, list(self.needs))
            return self._verdict(
                "not judged", "", self._wanted(variants.get(variant, []), lacking), variant, found
            )
        main, *others = complete
        deciding = self._deciding(variants[main])
        answer, depends_on = _answer(deciding), self._depends_on(deciding)
        sentence = self._sentence(main, deciding)
        differing = {
            variant: _answer(self._deciding(variants[variant]))
            for variant in others
            if _answer(self._deciding(variants[variant])) != answer
        }
        for variant, other in differing.items():
            sentence += f" With {variant} it {_said(other)}."
        if differing:
            depends_on = " and on ".join(part for part in (depends_on, *differing) if part)
        return self._verdict("depends" if differing else answer, depends_on, sentence, main, found)

    def _of(self, found: Sequence[Finding], variant: str) -> list[Finding]:
        return [finding for finding in found if finding.setting.variant == variant]

    def _sound(self, finding: Finding) -> bool:
        """Whether it may decide: made at the paper's size, over enough source sets."""
        return (
            finding.holds is not None
            and finding.setting.full
            and (finding.found.sets == 0 or finding.found.sets >= self.sets)
        )

    def _lacking(self, findings: Iterable[Finding]) -> list[Need]:
        there = {
            (finding.setting.distribution, finding.aspect) for finding in findings if self._sound(finding)
        }
        return [need for need in self.needs if need not in there]

    def _deciding(self, findings: Iterable[Finding]) -> list[Finding]:
        distributions = {*self.also, *(distribution for distribution, _ in self.needs)}
        return [
            finding
            for finding in findings
            if self._sound(finding) and finding.setting.distribution in distributions
        ]

    def _depends_on(self, deciding: Sequence[Finding]) -> str:
        """Which of distribution and aspect the answer turns on; "" where it is the same in all rows."""
        if _answer(deciding) != "depends":
            return ""
        sides: tuple[tuple[str, Callable[[Finding], str]], ...] = (
            ("the distribution", lambda finding: finding.setting.distribution),
            (self.aspects, lambda finding: finding.aspect),
        )
        alone = [name for name, side in sides if not _mixed(deciding, side)]
        named = alone[:1] or [name for name, _ in sides]
        option, without = self.option
        if _mixed(deciding, lambda finding: f"{finding.setting.distribution} {without(finding.aspect)}"):
            named.append(option)
        return " and ".join(named)

    def _sentence(self, variant: str, deciding: Sequence[Finding]) -> str:
        said = (f"With {variant}: " if variant else "") + self._number_of(deciding)
        failing = [finding for finding in deciding if not finding.holds]
        holding, count = len(deciding) - len(failing), len(deciding)
        if not failing:
            return f"{said}. It holds in {'the one row that decides' if count == 1 else f'all {count} rows'}."
        if not holding:
            rows = "the one row that decides" if count == 1 else f"any of {count} rows"
            return f"{said}. It does not hold in {rows}."
        if holding < len(failing):
            holds = [finding for finding in deciding if finding.holds]
            return f"{said}. It holds in {holding} of {count} rows: {_gathered(holds, deciding)}."
        return f"{said}. It holds in {holding} of {count} rows; not for {_gathered(failing, deciding)}."

    def _number_of(self, findings: Sequence[Finding]) -> str:
        finding = self._headline(findings)
        if finding is None:
            return "No number yet"
        number = f"{finding.found.value:.{self.digits}f}"
        if math.isfinite(finding.found.low):
            number += f" [{finding.found.low:.{self.digits}f}, {finding.found.high:.{self.digits}f}]"
        return f"At {finding.setting.distribution}, {finding.aspect}: {number}"

    def _wanted(self, findings: Sequence[Finding], lacking: Sequence[Need]) -> str:
        """Which artefacts are lacking, and the command that makes them."""
        unsound = [
            f
            for f in findings
            if _need(f) in lacking and (f.holds is not None or 0 < f.found.sets < self.sets)
        ]
        few = [finding for finding in unsound if 0 < finding.found.sets < self.sets]
        absent = [need for need in lacking if need not in map(_need, unsound)]
        lacks = []
        if absent:
            there = {finding.setting.distribution for finding in findings}
            lacks.append(self._absent(absent, there))
        if few:
            least = min(finding.found.sets for finding in few)
            where = _listed(finding.setting.distribution for finding in few)
            lacks.append(f"{self.sets} source sets where there {_are(least)} ({where})")
        if any(not finding.setting.full for finding in unsound):
            lacks.append("evidence of the paper's size")
        command = self.command.format(family=_options(lacking[0][0]))
        return f"Lacking: {'; '.join(lacks)}. Made by {command}."

    def _absent(self, absent: Sequence[Need], there: Collection[str]) -> str:
        """The distributions of which nothing is there, and what is absent of the others."""
        whole = [name for name in dict.fromkeys(name for name, _ in absent) if name not in there]
        parts = [need for need in absent if need[0] not in whole]
        return "; ".join(
            ([_listed(whole)] if whole else []) + ([_needs_gathered(parts, self.needs)] if parts else [])
        )

    def _headline(self, findings: Iterable[Finding]) -> Finding | None:
        return next(
            (
                finding
                for finding in findings
                if (finding.setting.distribution, finding.aspect) == self.headline
            ),
            None,
        )

    def _verdict(
        self, answer: Answer, depends_on: str, sentence: str, variant: str, found: Sequence[Finding]
    ) -> Verdict:
        own = self._of(found, variant)
        headline = self._headline(own)
        number = headline.detail() if headline else None
        decides = (
            self._deciding(own) if answer != "not judged" else [f for f in own if _need(f) in self.needs]
        )
        counted = [finding.found.sets for finding in decides if finding.found.sets]
        return Verdict(
            claim=self.name,
            statement=self.statement,
            source=self.source,
            verdict=answer,
            statistic=self.statistic,
            value=number.value if number else None,
            low=number.low if number else None,
            high=number.high if number else None,
            sets=min(counted, default=0),
            depends_on=depends_on,
            sentence=sentence,
            details=tuple(finding.detail() for finding in found),
        )


def _variants(found: Iterable[Finding]) -> list[str]:
    return list(dict.fromkeys(finding.setting.variant for finding in found))


def _answer(deciding: Sequence[Finding]) -> Answer:
    holding = {finding.holds for finding in deciding}
    return "depends" if len(holding) == 2 else "holds" if True in holding else "does not hold"


def _said(answer: Answer) -> str:
    return "depends too, otherwise" if answer == "depends" else answer


def _mixed(deciding: Iterable[Finding], side: Callable[[Finding], str]) -> bool:
    """Whether a value of that side both holds and does not."""
    answers: dict[str, set[bool | None]] = {}
    for finding in deciding:
        answers.setdefault(side(finding), set()).add(finding.holds)
    return any(len(given) > 1 for given in answers.values())


def _gathered(chosen: Sequence[Finding], among: Sequence[Finding]) -> str:
    """The aspects of the chosen rows with their distributions, the first TOLD of them."""
    return _needs_gathered([_need(finding) for finding in chosen], [_need(finding) for finding in among])


def _need(finding: Finding) -> Need:
    return finding.setting.distribution, finding.aspect


def _needs_gathered(chosen: Sequence[Need], among: Sequence[Need]) -> str:
    """Each aspect with its distributions, "everywhere" where these are all there are for it."""
    parts: dict[str, list[str]] = {}
    aspects = list(dict.fromkeys(aspect for _, aspect in chosen))
    for aspect in aspects[:TOLD]:
        own = [distribution for distribution, other in chosen if other == aspect]
        whole = [distribution for distribution, other in among if other == aspect]
        everywhere = len(own) == len(whole) > 1
        parts.setdefault("everywhere" if everywhere else _listed(own), []).append(aspect)
    told = [f"{', '.join(those)} ({where})" for where, those in parts.items()]
    return "; ".join(told + ([f"and {len(aspects) - TOLD} others"] if len(aspects) > TOLD else []))


def _listed(names: Iterable[str]) -> str:
    """The names, the word that they share said once: variance 1, 3, 7."""
    said, last = [], ""
    for name in dict.fromkeys(names):
        word, _, number = name.rpartition(" ")
        said.append(number if word == last and word else name)
        last = word
    return ", ".join(said)


def _are(count: int) -> str:
    return "is 1" if count == 1 else f"are {count}"


def _options(distribution: str) -> str:
    """How train-sources is asked for a distribution of the paper."""
    match distribution.split():
        case ["variance", value]:
            return f"gridworld --variance {value}"
        case ["noise", value]:
            return f"mountain-car --noise {value}"
        case _:
            return "gridworld --goals uniform"
