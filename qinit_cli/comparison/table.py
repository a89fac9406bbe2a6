"""A comparison as plain values: what programs and data frames read."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from qinit_cli.analysis.intervals import Estimate
    from qinit_cli.comparison.rows import GroupComparison, Row

SCHEMA = "qinit.compare/1"
OF_ROW = ("targets", "sets", "method")  # what a row is of
MEASURES = (  # beside the average itself, in the order in which they are printed
    "difference",
    "p",
    "jumpstart",
    "asymptotic",
    "transfer_ratio",
    "time_to_threshold",
    "regret",
    "success",
    "restricted_steps",
    "iqm",
    "probability_of_improvement",
    "restricted_mean_time_to_threshold",
    "censored",
    "negative_transfer",
    "remark",
)


def told(comparisons: Sequence[GroupComparison], metric: str) -> dict[str, Any]:
    """All of it as plain values, as --format json prints it: rows, and what the intervals of each set of targets are over."""
    return {
        "schema": SCHEMA,
        "intervals": [
            {
                "targets": one.title,
                "over": one.intervals,
                "baseline": one.baseline,
                "untested": one.untested or None,
            }
            for one in comparisons
        ],
        "rows": plain_rows(comparisons, metric),
    }


def with_columns(rows: Sequence[Mapping[str, Any]], names: Sequence[str]) -> list[dict[str, Any]]:
    """The rows with what they are of and these columns alone, each with its bounds, in that order."""
    wanted = [key for name in (*OF_ROW, *names) for key in (name, f"{name}_low", f"{name}_high")]
    return [{key: row[key] for key in dict.fromkeys(wanted) if key in row} for row in rows]


def plain_rows(comparisons: Iterable[GroupComparison], metric: str) -> list[dict[str, Any]]:
    """A row for each method on each set of targets: numbers with their bounds, None where there is none."""
    return [
        _values(row, metric) | {"targets": comparison.title}
        for comparison in comparisons
        for row in comparison.rows
    ]


def _values(row: Row, metric: str) -> dict[str, Any]:
    threshold = row.threshold
    return {
        "method": row.label,
        "sets": row.sets,
        "p": row.p,
        "success": _known(row.success),
        "restricted_steps": _known(row.steps),
        "censored": None if threshold is None else threshold.censored,
        "negative_transfer": row.negative_transfer,
        "remark": row.remark,
        **_bounds(metric, row.average),
        **_bounds("difference", row.difference),
        **_bounds("transfer_ratio", row.ratio),
        **_bounds("jumpstart", row.jumpstart),
        **_bounds("asymptotic", row.asymptotic),
        **_bounds("regret", row.regret),
        **_bounds("iqm", row.iqm),
        **_bounds("probability_of_improvement", row.improvement),
        **_bounds("time_to_threshold", None if threshold is None else threshold.median),
        **_bounds(
            "restricted_mean_time_to_threshold", None if threshold is None else threshold.restricted_mean
        ),
    }


def _known(number: float) -> float | None:
    return None if math.isnan(number) else number


def _bounds(key: str, estimate: Estimate | None) -> dict[str, float | None]:
    numbers = (math.nan,) * 3 if estimate is None else (estimate.value, estimate.low, estimate.high)
    names = (key, f"{key}_low", f"{key}_high")
    return {
        name: number if math.isfinite(number) else None for name, number in zip(names, numbers, strict=True)
    }
