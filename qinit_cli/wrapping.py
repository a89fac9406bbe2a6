"""Lines for a person's terminal, broken between words; a command that is to be copied stays on one line."""

from __future__ import annotations

import os
import re
from collections.abc import Iterator
from typing import TextIO

STARTS = {"qinit", "pip", "dask", "make"}  # words that a command begins with
GROUPS = {"train-sources", "transfer", "lifelong", "tune", "plot", "reproduce", "import"}  # a name follows
ARGUMENT = re.compile(
    r"-|['\"]|[A-Z0-9]|.*[/.=:]\w"
)  # how an option, a value, a path or a placeholder begins
ENDS = (",", ";", ":", ".", ")")  # what ends a command within a sentence


def wrapped(text: str, stream: TextIO) -> str:
    """The text as it goes to the stream: on a terminal broken between words where its lines end, elsewhere as it is."""
    width = columns(stream)
    if width is None:
        return text
    return "\n".join("\n".join(_lines(line, width)) for line in text.split("\n"))


def columns(stream: TextIO) -> int | None:
    """How wide the terminal is that the stream goes to; None where it goes to none."""
    if not stream.isatty():
        return None
    chosen = os.environ.get("COLUMNS", "")
    if chosen.isdecimal() and int(chosen):
        return int(chosen)
    try:
        return os.get_terminal_size(stream.fileno()).columns or None
    except OSError:  # a stream that only looks like a terminal
        return None


def _lines(text: str, width: int) -> Iterator[str]:
    """The line in lines of at most `width`, longer only where one unit is; nothing but blanks is left out."""
    first, *rest = _units(text.split(" "))
    line = first
    for unit in rest:
        if line.strip() and len(line) + 1 + len(unit) > width:
            yield line
            line = unit
        else:
            line = f"{line} {unit}"
    yield line


def _units(words: list[str]) -> Iterator[str]:
    """What must not be broken: words, commands, and what stands between backquotes."""
    place = 0
    while place < len(words):
        end = place + 1
        if words[place].count("`") % 2:
            end = next((at + 1 for at in range(end, len(words)) if "`" in words[at]), end)
        elif words[place].lstrip("(") in STARTS:
            end = _end_of_command(words, place)
        yield " ".join(words[place:end])
        place = end


def _end_of_command(words: list[str], place: int) -> int:
    """The place behind the last word of the command that begins here."""
    end = place + 1
    names = 2 if end < len(words) and words[end] in GROUPS else 1
    while end < len(words) and not words[end - 1].endswith(ENDS):
        value = words[end - 1].startswith("-") and len(words[end - 1]) > 1
        if end - place > names and not value and not ARGUMENT.match(words[end]):
            break
        end += 1
    return end
