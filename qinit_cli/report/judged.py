"""Verdicts on the paper's claims, as `qinit verdicts --format json` has them: a table, and what each rests on."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from qinit_cli.report.content import Block, Cell, Folded, Judgement, PageColumn, Points, Table
from qinit_cli.report.numbers import NOTHING, interval, number
from qinit_store.wording import counted

Verdict = dict[str, Any]

TONES = {"holds": "good", "does not hold": "bad", "depends": "open"}
UNJUDGED = "not judged"
SAID = {  # of one claim, of several
    "holds": ("holds", "hold"),
    "does not hold": ("does not hold", "do not hold"),
    "depends": ("depends on a setting", "depend on settings"),
    UNJUDGED: ("is not judged here", "are not judged here"),
}
DECIDES = {True: "holds", False: "does not hold", None: "told beside it"}


def blocks(verdicts: Sequence[Verdict]) -> list[Block]:
    """The claims that were judged, each with what it rests on; those that were not are folded away."""
    rest = [one for one in verdicts if one["verdict"] == UNJUDGED]
    found: list[Block] = [_judgement(one) for one in verdicts if one["verdict"] != UNJUDGED]
    if rest:
        lacking = Points([f"{one['claim']}: {one['statement']} {one['sentence']}" for one in rest])
        claims = "claim that is" if len(rest) == 1 else "claims that are"
        found.append(Folded(f"{len(rest)} {claims} not judged here, and what that would take", [lacking]))
    return found


def findings(verdicts: Sequence[Verdict]) -> list[str]:
    """One sentence: how many claims hold, which do not; [] where none was judged."""
    if all(one["verdict"] == UNJUDGED for one in verdicts):
        return []
    parts = [
        f"{len(claims)} {words[len(claims) > 1]} ({', '.join(claims)})"
        for answer, words in SAID.items()
        if (claims := [one["claim"] for one in verdicts if one["verdict"] == answer])
    ]
    whole = f"{len(verdicts)} " if any(one["verdict"] == UNJUDGED for one in verdicts) else ""
    return [f"Of the paper's {whole}claims {'; '.join(parts)}."]


def _judgement(one: Verdict) -> Judgement:
    depends = f" on {one['depends_on']}" if one["depends_on"] else ""
    answer = Cell(f"{one['verdict']}{depends}", tone=TONES[one["verdict"]])
    sets = f", {counted(one['sets'], 'source set')}" if one["sets"] else ""
    measured = " ".join(part for part in (number(one["value"]), interval(one["low"], one["high"])) if part)
    parts = [
        ("The paper", f"{one['statement'].rstrip('.')} ({one['source']})."),
        ("Found", one["sentence"]),
        ("By", f"{one['statistic']}: {measured}{sets}"),
    ]
    return Judgement(one["claim"], answer, parts, _details(one) if one["details"] else None)


def _details(one: Verdict) -> Table:
    columns = [
        PageColumn("setting"),
        PageColumn("value", numeric=True),
        PageColumn("source sets", numeric=True),
        PageColumn("there the claim"),
    ]
    rows = [
        [
            Cell(part["label"]),
            Cell(number(part["value"]), interval(part["low"], part["high"])),
            Cell(number(part["sets"]) if part["sets"] else NOTHING),
            Cell(DECIDES[part["holds"]], tone=TONES.get(DECIDES[part["holds"]], "")),
        ]
        for part in one["details"]
    ]
    return Table(f"{one['claim']}: {one['statistic']}", columns, rows)
