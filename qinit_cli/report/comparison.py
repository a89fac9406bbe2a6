"""Comparisons, as `qinit compare --format json` prints them: a table for each set of targets, and what follows in short."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

from qinit_cli.report.content import Block, Cell, Folded, PageColumn, Table
from qinit_cli.report.numbers import interval, number, probability

Compared = dict[str, Any]  # the JSON object
Row = dict[str, Any]

METRICS = ("return", "success", "steps")
# what a row is of, and what is said beside the table
TOLD_APART = ("schema", "targets", "sets", "method", "remark", "negative_transfer")
FOREMOST = ("difference", "p", "jumpstart", "asymptotic", "regret", "success", "restricted_steps")
HEADINGS = {
    "jumpstart": "first 10",
    "asymptotic": "last 10 %",
    "restricted_steps": "steps",
    "time_to_threshold": "median time to threshold",
    "restricted_mean_time_to_threshold": "mean time to threshold (restricted)",
    "censored": "share that never got there",
    "iqm": "IQM",
}
MARKS = {"privileged": "†", "reconstruction": "‡"}
MEANINGS = {
    "privileged": "† privileged: reads the target's own parameters.",
    "reconstruction": "‡ a reconstruction: made without the authors' formula.",
}
WORSE = "Worse is what has the whole 95 % interval of its difference, uncorrected, on the wrong side of zero."
RESTRICTED = "Steps are min(steps, horizon): a method that seldom arrives looks better by them than it is."


def tables(compared: Compared) -> Iterator[Block]:
    """A table for each set of targets, further measures folded away; a column with no number in it is left out."""
    for targets, rows in _by_targets(compared):
        over, baseline = _told(compared, targets)
        known = [key for key in _measures(rows) if any(row[key] is not None for row in rows)]
        first = [key for key in dict.fromkeys((_metric(rows), *FOREMOST)) if key in known]
        rest = [key for key in known if key not in first]
        marks = [MEANINGS[mark] for mark in MARKS if any(mark in row["remark"] for row in rows)]
        steps = [RESTRICTED] if "restricted_steps" in first else []
        notes = [
            *([f"{over[0].upper()}{over[1:]}."] if over else []),
            *_untested(compared, targets),
            *steps,
            *marks,
        ]
        yield _table(targets, rows, first, baseline, [" ".join(notes)] if notes else [])
        if rest:
            more = _table(f"{targets}: further measures", rows, rest, baseline, [])
            yield Folded(f"Further measures on {targets}", [more])


def findings(compared: Compared) -> Iterator[str]:
    """For each set of targets, one sentence: which method is best, and which are worse than the baseline."""
    for targets, rows in _by_targets(compared):
        _, baseline = _told(compared, targets)
        metric = _metric(rows)
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
        yield (f"{said}; {against}." if baseline else f"{said}.")


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


def _untested(compared: Compared, targets: str) -> list[str]:
    """Why rows of a set of targets have no p, a sentence; nothing where all have one."""
    told = [one.get("untested") for one in compared["intervals"] if one["targets"] == targets]
    return [f"{why}." for why in told if why]


def _worse(row: Row, fewest: bool) -> bool:
    """Whether the whole interval of the difference is on the wrong side of nothing."""
    bound = row["difference_low"] if fewest else row["difference_high"]
    return bound is not None and bool(bound > 0 if fewest else bound < 0)


def _metric(rows: Sequence[Row]) -> str:
    """What the averages are of."""
    return next(metric for metric in METRICS if f"{metric}_low" in rows[0])


def _measures(rows: Sequence[Row]) -> list[str]:
    """The keys that are columns of their own: not the bounds of another."""
    keys = [key for key in rows[0] if key not in TOLD_APART]
    bounds = {f"{key}_{end}" for key in keys for end in ("low", "high")}
    return [key for key in keys if key not in bounds]


def _table(
    caption: str, rows: Sequence[Row], keys: Sequence[str], baseline: str, notes: Sequence[str]
) -> Table:
    columns = [PageColumn("method"), *(PageColumn(_heading(key, baseline), numeric=True) for key in keys)]
    return Table(
        caption, columns, [[_method(row), *(_cell(row, key) for key in keys)] for row in rows], notes
    )


def _heading(key: str, baseline: str) -> str:
    return f"minus {baseline}" if key == "difference" else HEADINGS.get(key, key.replace("_", " "))


def _method(row: Row) -> Cell:
    marks = "".join(sign for mark, sign in MARKS.items() if mark in row["remark"])
    unknown = "" if marks or not row["remark"] else row["remark"]
    return Cell(f"{row['method']}{' ' if marks else ''}{marks}", unknown)


def _cell(row: Row, key: str) -> Cell:
    if key == "p":
        return Cell(probability(row[key]))
    return Cell(number(row[key]), interval(row.get(f"{key}_low"), row.get(f"{key}_high")))
