"""The columns and rows that `qinit compare` prints, and what stands beneath them for people."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

from qinit_cli.commands.tables import TableColumn
from qinit_cli.comparison.distinctions import separator
from qinit_cli.errors import UsageError
from qinit_cli.nearest import nearest
from qinit_store.wording import printable

if TYPE_CHECKING:
    from qinit_cli.comparison.rows import GroupComparison

MARKS = {"privileged": "†", "reconstruction": "‡", "imported": "§"}  # at a method's name, for people
NAMED = ("targets", "sets", "method")  # what a row is of
UNREMARKED = ("negative_transfer", "remark")  # stand beneath the table for people


def columns(metric: str, baseline: str, *, greedy: bool) -> list[TableColumn]:
    """All of them: the more telling first, for the last are left out where a terminal is too narrow."""
    return [
        *(TableColumn(name) for name in NAMED),
        TableColumn(metric, metric, 4, interval=True),
        TableColumn("difference", f"minus {baseline}", 4, interval=True),
        TableColumn("p", "p", 4, dispensable=True),
        _summary("jumpstart", "first" if greedy else "first 10", 4),
        _summary("asymptotic", "last 10%", 4),
        _summary("transfer_ratio", "ratio", 2),
        _summary("time_to_threshold", "threshold", 0),
        _summary("regret", "regret", 4),
        *([] if metric == "success" else [TableColumn("success", digits=3, dispensable=True)]),
        TableColumn(
            "restricted_steps", "restricted steps" if metric == "steps" else "steps", 1, dispensable=True
        ),
        _summary("iqm", "IQM", 4),
        _summary("probability_of_improvement", "P(improve)", 2),
        _summary("restricted_mean_time_to_threshold", "RMST", 1),
        TableColumn("censored", digits=3, dispensable=True),
        *(TableColumn(name) for name in UNREMARKED),
    ]


def chosen(there: list[TableColumn], names: str | None) -> list[TableColumn]:
    """What a row is of and the columns with these names, separated by commas, in that order; all without names."""
    if names is None:
        return there
    known = {column.key: column for column in there}
    wanted = [name.strip() for name in names.split(",")]
    unknown = [name for name in wanted if name not in known]
    if unknown:
        raise UsageError(f"--columns {unknown[0]}: {nearest(unknown[0], list(known))}")
    return [replace(known[name], by_name=name in wanted) for name in dict.fromkeys((*NAMED, *wanted))]


def for_people(columns: list[TableColumn]) -> list[TableColumn]:
    """Those that do not stand in the title or beneath the table."""
    return [column for column in columns if column.key not in ("targets", "sets", *UNREMARKED)]


def caption(comparison: GroupComparison, metric: str) -> str:
    """What the intervals are over, whose transfer is negative, why a ratio or p is missing, and what the marks mean."""
    rows = comparison.rows
    lines = [comparison.intervals]
    worse = [printable(row.label) for row in rows if row.negative_transfer]
    if worse:
        side = "above" if metric == "steps" else "below"
        names = " and ".join([separator(worse).join(worse[:-1]), worse[-1]] if worse[1:] else worse)
        lines.append(
            f"negative transfer: {names} {'are' if worse[1:] else 'is'} worse than learning from "
            f"{printable(comparison.baseline)}, the whole interval of the difference {side} 0"
        )
    if any(row.difference is not None and row.ratio is None for row in rows):
        lines.append(f"no transfer ratio where the interval of {comparison.baseline} touches 0")
    if comparison.untested:
        lines.append(comparison.untested)
    lines += [f"{MARKS[remark]} {remark}" for remark in MARKS if any(row.remark == remark for row in rows)]
    return "\n".join(lines)


def marked(row: dict[str, Any]) -> dict[str, Any]:
    """The row with its remark as a mark at the method, which the caption explains."""
    return row | {"method": row["method"] + MARKS.get(row["remark"], "")}


def _summary(key: str, heading: str, digits: int) -> TableColumn:
    """A column whose interval is left out for people."""
    return TableColumn(key, heading, digits, interval=True, bounds_shown=False, dispensable=True)
