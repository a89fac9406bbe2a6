"""Tables: rich on a terminal, TSV elsewhere, always whole; also csv, json, jsonl and markdown."""

from __future__ import annotations

import csv
import json
import math
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from qinit_cli.commands.groups import Display, Tabular
from qinit_cli.commands.messages import console

if TYPE_CHECKING:
    from rich.table import Table

Row = dict[str, Any]


UNBOUNDED = 10_000  # columns, wider than any table
FOLDED_WIDTH = 18  # the narrowest that a column of longer texts is folded to


@dataclass(frozen=True)
class TableColumn:
    """One column: the key of its values in a row, and how it reads for people.

    An interval has three values in a row (key, key_low, key_high): three columns for programs; for people the bounds
    stand beneath the value, or are left out to keep the table narrow.
    """

    key: str
    heading: str = ""
    digits: int | None = None  # decimals for people; None for text and counts
    interval: bool = False
    bounds_shown: bool = True
    dispensable: bool = False  # left out for people where the terminal is too narrow

    @property
    def keys(self) -> list[str]:
        """The keys of its values."""
        return [self.key, f"{self.key}_low", f"{self.key}_high"] if self.interval else [self.key]

    @property
    def title(self) -> str:
        """What stands above it."""
        return self.heading or self.key.replace("_", " ")

    def text(self, row: Row) -> str:
        """The value for people."""
        value, *bounds = (self._number(row[key]) for key in self.keys)
        return f"{value} ({' to '.join(bounds)})" if self.bounds_shown and any(bounds) else value

    def lines(self, row: Row) -> str:
        """The same on two lines, as narrow as can be: a terminal has few columns."""
        value, *bounds = (self._number(row[key]) for key in self.keys)
        narrow = [bound.replace("0.", ".", 1) for bound in bounds]
        return f"{value}\n{'–'.join(narrow)}" if self.bounds_shown and any(bounds) else value

    def _number(self, value: Any) -> str:
        if value is None:
            return ""
        return f"{value:.{self.digits}f}" if self.digits is not None else str(value)


def print_table(
    schema: str,
    columns: Sequence[TableColumn],
    rows: Sequence[Row],
    tabular: Tabular,
    display: Display,
    *,
    title: str = "",
    caption: str = "",
    extra: Row | None = None,
) -> None:
    """Prints rows of plain values on stdout; None and NaN are empty, in JSON null. `extra` joins the JSON object."""
    keys = [key for column in columns for key in column.keys]
    plain = [{key: _plain(row[key]) for key in keys} for row in rows]
    match tabular.chosen:
        case "table":
            _print_rich(columns, plain, display, title, caption)
        case "markdown":
            _print_markdown(columns, plain)
        case "json":
            print(json.dumps({"schema": schema, **(extra or {}), "rows": plain}, allow_nan=False))
        case "jsonl":
            for row in plain:
                print(json.dumps({"schema": schema, **row}, allow_nan=False))
        case separated:
            _print_separated(keys, plain, "\t" if separated == "tsv" else ",")


def _plain(value: Any) -> Any:
    if hasattr(value, "item"):
        value = value.item()
    return None if isinstance(value, float) and not math.isfinite(value) else value


def _print_rich(
    columns: Sequence[TableColumn], rows: Sequence[Row], display: Display, title: str, caption: str
) -> None:
    from rich.measure import Measurement

    terminal = console(display)
    shown = list(columns)
    dropped: list[TableColumn] = []
    while True:
        table = _rich_table(shown, rows)
        # measured with room to spare: a measure never exceeds the width that it is given
        needed = Measurement.get(terminal, terminal.options.update(width=UNBOUNDED), table).minimum
        dispensable = [column for column in shown if column.dispensable]
        if needed <= terminal.width or not dispensable:
            break
        dropped.insert(0, dispensable[-1])
        shown.remove(dispensable[-1])
    # title and caption apart: in the table they would be folded to its width
    if title:
        terminal.print(title, style="table.title", highlight=False)
    terminal.print(table)
    if caption:
        terminal.print(caption, style="table.caption", highlight=False)
    if dropped:
        names = ", ".join(column.title for column in dropped)
        terminal.print(f"not shown for lack of room: {names} (--format tsv has all)", style="dim")


def _rich_table(columns: Sequence[TableColumn], rows: Sequence[Row]) -> Table:
    from rich import box
    from rich.table import Table

    table = Table(
        box=box.SIMPLE_HEAD,
        pad_edge=False,
        padding=(0, 1, 0, 0),
    )
    for column in columns:
        numeric = any(isinstance(row[column.key], int | float) for row in rows)
        longest = max((len(column.text(row)) for row in rows), default=0)
        table.add_column(
            column.title,
            justify="right" if numeric else "left",
            no_wrap=numeric or longest <= FOLDED_WIDTH,
            overflow="fold",
            min_width=max(len(column.title), 0 if numeric else min(longest, FOLDED_WIDTH)),
        )
    for row in rows:
        table.add_row(*(column.lines(row) for column in columns))
    return table


def _print_markdown(columns: Sequence[TableColumn], rows: Sequence[Row]) -> None:
    print("| " + " | ".join(column.title for column in columns) + " |")
    print("|" + "|".join(" --- " for _ in columns) + "|")
    for row in rows:
        print("| " + " | ".join(column.text(row).replace("|", "\\|") for column in columns) + " |")


def _print_separated(keys: Sequence[str], rows: Sequence[Row], delimiter: str) -> None:
    writer = csv.writer(sys.stdout, delimiter=delimiter, lineterminator="\n")
    writer.writerow(keys)
    for row in rows:
        writer.writerow(["" if row[key] is None else row[key] for key in keys])
