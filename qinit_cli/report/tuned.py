"""What choosing parameters found: the choice and what it is worth in words, and every candidate in a table."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from qinit_cli.report.content import Block, Cell, PageColumn, Points, Subheading, Table
from qinit_cli.report.numbers import interval, number

Tuned = Mapping[
    str, Any
]  # "title", "sentences" and "rows", as `qinit tune --format json` has them, and their "parameters"

NOTE = "95 % bootstrap intervals over the sources, uncorrected; the largest of several averages reads a little too high."


def blocks(tuned: Sequence[Tuned]) -> Iterator[Block]:
    """A part for each choice."""
    for one in tuned:
        yield Subheading(one["title"])
        yield Points(one["sentences"])
        yield _table(one)


def _table(one: Tuned) -> Table:
    columns = [
        *(PageColumn(name, numeric=True) for name in one["parameters"].values()),
        PageColumn("return", numeric=True),
        PageColumn("minus default", numeric=True),
        PageColumn(""),
    ]
    rows = [
        [
            *(Cell(f"{row[name]:.6g}") for name in one["parameters"]),
            _measured(row, "average"),
            Cell(number(None)) if row["default"] else _measured(row, "difference"),
            Cell(", ".join(mark for mark in ("default", "chosen") if row[mark])),
        ]
        for row in one["rows"]
    ]
    return Table(f"{one['title']}: the candidates", columns, rows, [NOTE])


def _measured(row: Mapping[str, Any], key: str) -> Cell:
    return Cell(number(row[key]), interval(row[f"{key}_low"], row[f"{key}_high"]))
