"""What decides the average, as `qinit sensitivity --format json` has it: a sentence and a table."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from qinit_cli.report.content import Block, Cell, PageColumn, Table, Text
from qinit_cli.report.numbers import listed, number

SharesTold = Mapping[str, Any]  # "metric", "rows" and "about"

FOREMOST = 3  # rows that the sentence names


def blocks(shares: SharesTold | None) -> Iterator[Block]:
    """The largest shares in words, and all of them; nothing where there are none."""
    if shares is None:
        return
    rows: Sequence[Mapping[str, Any]] = shares["rows"]
    largest = sorted(rows, key=lambda row: -row["share"])[:FOREMOST]
    said = listed([f"{row['setting']} {100 * row['share']:.0f} %" for row in largest])
    average = f"the variance of the average {shares['metric']}"
    yield Text(f"Of {average} over these runs, the largest shares are: {said}.")
    columns = [PageColumn("setting"), PageColumn("values", numeric=True), PageColumn("share", numeric=True)]
    body = [
        [Cell(row["setting"]), Cell(number(row["values"])), Cell(f"{100 * row['share']:.1f} %")]
        for row in rows
    ]
    about = str(shares["about"])
    yield Table(f"Shares of {average}", columns, body, [f"{about[0].upper()}{about[1:]}."])
