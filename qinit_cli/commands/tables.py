"""Tables: rich on a terminal, TSV elsewhere, always whole; also csv, json, jsonl and markdown."""

from __future__ import annotations

import csv
import json
import math
import re
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from qinit_cli.cells import markdown, separated
from qinit_cli.commands.console import console
from qinit_cli.commands.option_groups import Display, Tabular
from qinit_store.wording import printable

if TYPE_CHECKING:
    from rich.table import Table

Row = dict[str, Any]


UNBOUNDED = 10_000  # columns, wider than any table
FOLDED_WIDTH = 18  # the narrowest that a column of longer texts is folded to
SIGNIFICANT = 5  # digits of a number, which large ones need no decimals for
NEEDLESS = re.compile(r"^(-?)0\.")  # the zero of -0.25, but not that of 10.25


@dataclass(frozen=True)
class TableColumn:
    """One column: the key of its values in a row, and how it reads for people.

    An interval has three values in a row (key, key_low, key_high): three columns for programs; for people the bounds
    stand beneath the value, or are left out to keep the table narrow.
    """

    key: str
    heading: str = ""
    digits: int | None = None  # decimals for people, fewer of large numbers; None for text and counts
    interval: bool = False
    bounds_shown: bool = True
    dispensable: bool = False  # left out for people where the terminal is too narrow
    by_name: bool = False  # asked for: shown to people even where it is empty

    @property
    def keys(self) -> list[str]:
        """The keys of its values."""
        return [self.key, f"{self.key}_low", f"{self.key}_high"] if self.interval else [self.key]

    @property
    def title(self) -> str:
        """What stands above it."""
        return printable(self.heading or self.key.replace("_", " "))

    def text(self, row: Row) -> str:
        """The value for people."""
        value, *bounds = self._numbers(row)
        return f"{value} ({' to '.join(bounds)})" if self.bounds_shown and any(bounds) else value

    def lines(self, row: Row) -> str:
        """The same on two lines, as narrow as can be: a terminal has few columns."""
        value, *bounds = self._numbers(row)
        narrow = [NEEDLESS.sub(r"\1.", bound) for bound in bounds]
        return f"{value}\n{'–'.join(narrow)}" if self.bounds_shown and any(bounds) else value

    def empty(self, rows: Sequence[Row]) -> bool:
        """Whether it has no value in any row."""
        return all(row[self.key] in (None, "") for row in rows)

    def _numbers(self, row: Row) -> list[str]:
        """The value and its bounds, all with as many decimals as the largest of them has."""
        values = [row[key] for key in self.keys]
        if self.digits is None:
            return ["" if value is None else printable(value) for value in values]
        decimals = _decimals(
            max((abs(value) for value in values if value is not None), default=0.0), self.digits
        )
        return ["" if value is None else f"{value:{decimals}}" for value in values]


def _decimals(size: float, most: int) -> str:
    """How a number of that size is written: SIGNIFICANT digits, at most so many decimals; a tiny one as a power."""
    if 0 < size < 0.5 * 10.0**-most:
        return ".2g"
    return f".{max(0, min(most, SIGNIFICANT - len(str(int(size)))))}f"


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
        case spreadsheet:
            _print_separated(keys, plain, "\t" if spreadsheet == "tsv" else ",")


def _plain(value: Any) -> Any:
    if hasattr(value, "item"):
        value = value.item()
    return None if isinstance(value, float) and not math.isfinite(value) else value


def _print_rich(
    columns: Sequence[TableColumn], rows: Sequence[Row], display: Display, title: str, caption: str
) -> None:
    from rich.measure import Measurement

    terminal = console(display)
    shown = [column for column in columns if column.by_name or not rows or not column.empty(rows)]
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
        terminal.print(printable(title), style="table.title")
    terminal.print(table)
    if caption:
        terminal.print(printable(caption, keep="\n"), style="table.caption")
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
    print("| " + " | ".join(markdown(column.title) for column in columns) + " |")
    print("|" + "|".join(" --- " for _ in columns) + "|")
    for row in rows:
        print("| " + " | ".join(markdown(column.text(row)) for column in columns) + " |")


def _print_separated(keys: Sequence[str], rows: Sequence[Row], delimiter: str) -> None:
    writer = csv.writer(sys.stdout, delimiter=delimiter, lineterminator="\n")
    writer.writerow(map(separated, keys))
    for row in rows:
        writer.writerow(["" if row[key] is None else _cell(row[key]) for key in keys])


def _cell(value: Any) -> Any:
    """A number as it is, anything else as text that stays text."""
    return value if isinstance(value, int | float) else separated(str(value))
