"""What a report says of shares of variance."""

from __future__ import annotations

from qinit_cli.report import shares
from qinit_cli.report.content import Table, Text

ROWS = [
    {"setting": "epsilon", "values": 3, "share": 0.25},
    {"setting": "variance", "values": 2, "share": 0.5},
    {"setting": "interactions", "values": None, "share": 0.15},
    {"setting": "source sets and targets", "values": None, "share": 0.1},
]


def test_the_largest_shares_are_named_and_the_metric_is_that_of_the_shares() -> None:
    said, table = shares.blocks({"metric": "steps", "rows": ROWS, "about": "shares of something"})
    assert isinstance(said, Text)
    assert said.words == (
        "Of the variance of the average steps over these runs, the largest shares are: "
        "variance 50 %, epsilon 25 % and interactions 15 %."
    )
    assert isinstance(table, Table)
    assert table.caption == "Shares of the variance of the average steps"
    assert table.notes == ["Shares of something."]


def test_nothing_is_said_where_there_are_no_shares() -> None:
    assert list(shares.blocks(None)) == []
