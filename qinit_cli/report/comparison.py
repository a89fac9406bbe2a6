"""Comparisons, as `qinit compare --format json` prints them: a table for each set of targets, and what follows in short."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

from qinit_cli.report.content import Cell, Column, Table
from qinit_cli.report.numbers import chance, interval, number

Compared = dict[str, Any]  # the JSON object
Row = dict[str, Any]

OF_THE_TABLE = ("schema", "targets", "sets", "method", "remark", "baseline")  # what is no column of numbers
HEADINGS = {
    "jumpstart": "first 10",
    "asymptotic": "last 10 %",
    "restricted_steps": "steps",
}
MARKS = {"privileged": "†", "reconstruction": "‡"}
MEANINGS = {
    "privileged": "† privileged: reads the target's own parameters.",
    "reconstruction": "‡ a reconstruction: the authors' formula is not public.",
}
RESTRICTED = "Steps are min(steps, horizon): a method that seldom arrives looks better by them than it is."


def tables(compared: Compared) -> Iterator[Table]:
    """A table for each set of targets; a column with no number in it is left out."""
    for targets, rows in _by_targets(compared):
        over, baseline = _told(compared, targets)
        keys = [key for key in _columns(rows) if any(row[key] is not None for row in rows)]
        columns = [Column("method"), *(Column(_heading(key, baseline), numeric=True) for key in keys)]
        body = [[_method(row), *(_cell(row, key) for key in keys)] for row in rows]
        marks = [MEANINGS[mark] for mark in MARKS if any(mark in row["remark"] for row in rows)]
        steps = [RESTRICTED] if "restricted_steps" in keys else []
        notes = [*([f"{over[0].upper()}{over[1:]}."] if over else []), *steps, *marks]
        yield Table(targets, columns, body, [" ".join(notes)] if notes else [])


def findings(compared: Compared) -> Iterator[str]:
    """For each set of targets, one sentence: which method is best, and which are worse than the baseline."""
    for targets, rows in _by_targets(compared):
        _, baseline = _told(compared, targets)
        metric = _columns(rows)[0]
        fewest = metric == "steps"
        own = [row for row in rows if row[metric] is not None and "privileged" not in row["remark"]]
        if len(own) < 2:
            continue
        best = (min if fewest else max)(own, key=lambda row: row[metric])
        bounds = interval(best[f"{metric}_low"], best[f"{metric}_high"])
        beside = f" {bounds}" if bounds else ""
        said = f"{targets}: {'fewest' if fewest else 'highest'} {metric} by {best['method']}, {number(best[metric])}{beside}"
        worse = [row["method"] for row in own if _worse(row, fewest)]
        against = (
            f"worse than {baseline}: {', '.join(worse)}"
            if worse
            else f"none is shown to be worse than {baseline}"
        )
        yield (f"{said}; {against} (by the 95 % interval of the difference)." if baseline else f"{said}.")


def _by_targets(compared: Compared) -> list[tuple[str, list[Row]]]:
    """The rows of each set of targets, in order of appearance."""
    found: dict[str, list[Row]] = {}
    for row in compared["rows"]:
        found.setdefault(row["targets"], []).append(row)
    return list(found.items())


def _told(compared: Compared, targets: str) -> tuple[str, str]:
    """What the intervals of a set of targets are over, and what its methods are set against; "" for either that is not told."""
    for one in compared["intervals"]:
        if one["targets"] == targets:
            return one["over"], one["baseline"] or ""
    return "", ""


def _worse(row: Row, fewest: bool) -> bool:
    """Whether the whole interval of the difference is on the wrong side of nothing."""
    bound = row["difference_low"] if fewest else row["difference_high"]
    return bound is not None and bool(bound > 0 if fewest else bound < 0)


def _columns(rows: Sequence[Row]) -> list[str]:
    """The keys that are columns of their own: not the bounds of another."""
    keys = [key for key in rows[0] if key not in OF_THE_TABLE]
    bounds = {f"{key}_{end}" for key in keys for end in ("low", "high")}
    return [key for key in keys if key not in bounds]


def _heading(key: str, baseline: str) -> str:
    return f"minus {baseline}" if key == "difference" else HEADINGS.get(key, key.replace("_", " "))


def _method(row: Row) -> Cell:
    marks = "".join(sign for mark, sign in MARKS.items() if mark in row["remark"])
    unknown = "" if marks or not row["remark"] else row["remark"]
    return Cell(f"{row['method']}{' ' if marks else ''}{marks}", unknown)


def _cell(row: Row, key: str) -> Cell:
    if key == "p" or key.endswith("_p"):
        return Cell(chance(row[key]))
    return Cell(number(row[key]), interval(row.get(f"{key}_low"), row.get(f"{key}_high")))
