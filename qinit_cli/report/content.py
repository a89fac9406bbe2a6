"""What a page holds, before anyone thinks of HTML: sections of text, tables and figures."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar


@dataclass(frozen=True)
class Text:
    """A paragraph."""

    kind: ClassVar[str] = "text"
    words: str


@dataclass(frozen=True)
class Points:
    """A list of sentences."""

    kind: ClassVar[str] = "points"
    items: Sequence[str]


@dataclass(frozen=True)
class Subheading:
    """A heading within a section."""

    kind: ClassVar[str] = "subheading"
    words: str


@dataclass(frozen=True)
class Pairs:
    """Names and what they are, one pair a line."""

    kind: ClassVar[str] = "pairs"
    pairs: Sequence[tuple[str, str]]


@dataclass(frozen=True)
class PageColumn:
    """A column of a table; numbers stand at its right edge."""

    title: str
    numeric: bool = False
    code: bool = False  # to be copied: a command, a hash


@dataclass(frozen=True)
class Cell:
    """What stands in a table, and what stands small beneath it."""

    text: str
    beneath: str = ""
    tone: str = ""  # "good", "bad" or "open": a colour beside the words, never instead of them


@dataclass(frozen=True)
class Table:
    """Rows of cells, the first of each the row's heading; the note stands beneath."""

    kind: ClassVar[str] = "table"
    caption: str
    columns: Sequence[PageColumn]
    rows: Sequence[Sequence[Cell]]
    notes: Sequence[str] = ()


@dataclass(frozen=True)
class Figure:
    """A picture with what stands beneath it, and what is said of it to those who do not see it."""

    kind: ClassVar[str] = "figure"
    title: str
    caption: str
    alt: str
    svg: str  # as a file holds it


@dataclass(frozen=True)
class Judgement:
    """A claim, what was found, and on what that rests."""

    kind: ClassVar[str] = "judgement"
    claim: str
    answer: Cell
    parts: Sequence[tuple[str, str]]  # what the paper says, what was found, by which number
    details: Table | None


@dataclass(frozen=True)
class Folded:
    """Blocks that are opened on demand."""

    kind: ClassVar[str] = "folded"
    summary: str
    blocks: Sequence[Block]


Block = Text | Points | Subheading | Pairs | Table | Figure | Judgement | Folded


@dataclass(frozen=True)
class Section:
    """A part of the page with a heading; `name` is its anchor."""

    name: str
    heading: str
    blocks: Sequence[Block]


@dataclass(frozen=True)
class Page:
    """All of it, in the order in which it is read."""

    title: str
    lead: str
    sections: Sequence[Section]
    maker: str  # the program and its version
