"""Text in the cells of tables: what a spreadsheet would compute and what Markdown would format stays text."""

from __future__ import annotations

import re
from functools import lru_cache

from qinit_store.wording import printable

# what spreadsheets take for a formula, in full width too; tabs and line breaks are written out
FORMULA = re.compile(
    "[=+\\-@\N{FULLWIDTH EQUALS SIGN}\N{FULLWIDTH PLUS SIGN}\N{FULLWIDTH HYPHEN-MINUS}\N{FULLWIDTH COMMERCIAL AT}]"
)
NUMBERS = re.compile(r"[+-]?[\d.]+(e[+-]?\d+)?(,[+-]?[\d.]+(e[+-]?\d+)?)*", re.IGNORECASE)
MARKDOWN = str.maketrans(
    {mark: f"\\{mark}" for mark in "\\|`[]*~"} | {"&": "&amp;", "<": "&lt;", ">": "&gt;"}
)


@lru_cache(maxsize=4096)
def separated(text: str) -> str:
    """The text as a cell of CSV or TSV: with an apostrophe before what a spreadsheet would compute; numbers as they are."""
    shown = printable(text)
    return f"'{shown}" if FORMULA.match(shown) and not NUMBERS.fullmatch(shown) else shown


def markdown(text: str) -> str:
    """The text as a cell of a Markdown table, in which it formats nothing and holds no HTML."""
    return printable(text).translate(MARKDOWN)
