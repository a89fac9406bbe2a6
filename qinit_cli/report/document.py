"""The order of a page: what was asked, what came out, what it rests on."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

from qinit_cli.artefacts.kinds import KINDS
from qinit_cli.report import comparison, judged, origin, settings, shares, tuned
from qinit_cli.report.content import Block, Figure, Page, Pairs, Points, Section, Subheading, Text
from qinit_store.wording import counted


@dataclass(frozen=True)
class Material:
    """What a page is made of, read and drawn by others."""

    title: str
    question: str
    made: Sequence[tuple[str, str]]  # how, where that is known as a whole
    artefacts: Sequence[dict[str, Any]]  # see `origin.Described`; with "settings"
    compared: Sequence[tuple[str, dict[str, Any]]]  # title, and what qinit compare --format json prints
    tuned: Sequence[tuned.Tuned]
    verdicts: Sequence[dict[str, Any]]  # as qinit verdicts --format json has them
    figures: Sequence[Figure]
    undrawn: Sequence[str]  # what is not in them, and why
    absent: Sequence[str]  # what is not among the artefacts, and why
    shares: shares.SharesTold | None  # what decides the average; None where no setting varies
    of_claims: bool  # whether the paper's claims are what was asked; else they follow what was compared


def page(material: Material, maker: str) -> Page:
    """The page; a part that there is nothing for is left out."""
    sections = [section for section in _sections(material) if section.blocks]
    return Page(material.title, material.question, sections, maker)


def _sections(material: Material) -> Iterator[Section]:
    verdicts = Section("verdicts", "Verdicts", judged.blocks(material.verdicts) if material.verdicts else [])
    yield Section("in-short", "In short", _in_short(material))
    if material.of_claims:
        yield verdicts
    yield Section("comparisons", "Comparisons", list(_compared(material)))
    yield Section("sensitivity", "Sensitivity", list(shares.blocks(material.shares)))
    yield Section("tuning", "Tuning", list(tuned.blocks(material.tuned)))
    missing: list[Block] = [Text("Not drawn:"), Points(material.undrawn)] if material.undrawn else []
    yield Section("figures", "Figures", [*material.figures, *missing])
    if not material.of_claims:
        yield verdicts
    yield Section("settings", "Settings", settings.blocks([one["settings"] for one in material.artefacts]))
    yield Section(
        "provenance",
        "Provenance and hashes",
        [*map(Text, material.absent), *origin.blocks(material.artefacts)],
    )


def _compared(material: Material) -> Iterator[Block]:
    for title, one in material.compared:
        if title:
            yield Subheading(title)
        yield from comparison.tables(one)


def _in_short(material: Material) -> list[Block]:
    claims = judged.findings(material.verdicts)
    compared = _of_comparisons(material.compared)
    found = [*claims, *compared] if material.of_claims else [*compared, *claims]
    found += [one["sentences"][0] for one in material.tuned]
    count = Counter(artefact["kind"] for artefact in material.artefacts)
    rests = ", ".join(
        counted(count[name], kind.one, kind.several) for name, kind in KINDS.items() if count[name]
    )
    return [
        *([Points(found)] if found else []),
        *([Text(comparison.WORSE)] if any("worse" in said for said in found) else []),
        Text(f"All of it rests on {rests}."),
        *([Pairs(material.made)] if material.made else []),
    ]


def _of_comparisons(compared: Sequence[tuple[str, dict[str, Any]]]) -> list[str]:
    """What follows from each table, behind its title where several tables are of the same targets."""
    count = Counter(targets for _, one in compared for targets in {row["targets"] for row in one["rows"]})
    several = any(times > 1 for times in count.values())
    return [
        f"{title}: {said}" if several and title else said
        for title, one in compared
        for said in comparison.findings(one)
    ]
