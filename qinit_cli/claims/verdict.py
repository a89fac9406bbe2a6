"""What the evidence says of one claim of the paper, as tables, pages and JSON show it."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any, Literal

Answer = Literal["holds", "does not hold", "depends", "not judged"]
SCHEMA = "qinit.verdicts/1"


@dataclass(frozen=True)
class Detail:
    """One setting that a claim was looked at in: a distribution, a state, an option, a pair of methods."""

    label: str
    value: float | None
    low: float | None  # of the 95 % interval; None where there is none
    high: float | None
    sets: int  # source sets
    holds: bool | None  # None where it is told beside the claim and does not decide


@dataclass(frozen=True)
class Verdict:
    """One claim, judged by one statistic."""

    claim: str  # "C4"
    statement: str  # what the paper claims, one sentence
    source: str  # where it claims so
    verdict: Answer
    statistic: str  # what the number is
    value: float | None
    low: float | None  # of its 95 % interval
    high: float | None
    sets: int  # source sets; 0 where none is needed or there
    depends_on: str  # the setting that the answer depends on; else ""
    sentence: str  # what was found, or which artefacts are lacking and the command that makes them
    details: tuple[Detail, ...]

    def told(self) -> dict[str, Any]:
        """Plain values by name, a row of schema SCHEMA."""
        return asdict(self)
