"""Text that others wrote, made harmless to print, and commands that can be pasted into a shell.

Names of files, labels, settings and commands come from files that anybody may have written: printed as they are, an escape
sequence could rewrite the terminal, a line break could forge a message, and a command could hide a second one.
"""

from __future__ import annotations

import os
import re
import shlex
import unicodedata
from collections.abc import Iterator, Sequence
from pathlib import PurePath

INVISIBLE = re.compile("[\u034f\u115f\u1160\u17b4\u17b5\u3164\uffa0]")  # letters and marks that draw nothing
UNDECODABLE = range(0xDC80, 0xDD00)  # how Python keeps the bytes of a file name that are no text
NAMED = {"\n": r"\n", "\r": r"\r", "\t": r"\t"}
NO_NAME = re.compile(r"[^A-Za-z0-9._]+")
SUBCOMMAND = re.compile(r"[a-z][a-z-]*")


def as_name(text: str) -> str:
    """The text with a - for each run of characters that the name of an artefact does not have."""
    return NO_NAME.sub("-", text)


def printable(text: object, *, keep: str = "") -> str:
    r"""The text on one line, with what a terminal would obey or hide written out: ESC as `\x1b`, U+202E as `\u202e`.

    That is every control character (C0, DEL, C1), line and paragraph separators, marks that change the direction or have no
    width, and what is no character. `keep` names those that stay, such as the line breaks of a traceback.
    """
    words = str(text)
    if words.isascii() and words.isprintable():
        return words
    return "".join(char if char in keep or _shown(char) else _written_out(char) for char in words)


def noun(count: int, one: str, several: str = "") -> str:
    """The word for so many: task, tasks."""
    return one if count == 1 else several or f"{one}s"


def counted(count: int, one: str, several: str = "") -> str:
    """1 task, 2 tasks."""
    return f"{count:,} {noun(count, one, several)}"


def magnitude(count: float) -> str:
    """A count as people read it: 950, 12,345, and from a million on three digits, 636 M or 1.2 G."""
    size = abs(count)
    if size < 999_999.5:
        return f"{count:,.0f}"
    unit, name = (1e9, "G") if float(f"{size:.3g}") >= 1e9 else (1e6, "M")
    return f"{float(f'{count:.3g}') / unit:g} {name}"


def sized(size: float) -> str:
    """An amount of memory or disk: 3.2 MB, 41.0 GB, 1,900.0 TB."""
    unit, word = next(
        ((unit, word) for unit, word in ((1e12, "TB"), (1e9, "GB")) if size >= unit), (1e6, "MB")
    )
    return f"{size / unit:,.1f} {word}"


def plain(value: float) -> str:
    """A measure with three digits, from a thousand on whole: 0.21, 12.3, 12,345."""
    return f"{value:,.0f}" if abs(value) >= 999.5 else f"{value:.3g}"


def shell_line(*words: object) -> str:
    """A command of these words as a shell reads it, each quoted where it needs to be: `qinit verify 'a b.h5'`."""
    return " ".join(map(_quoted, words))


def first_few(items: Sequence[object], most: int, separator: str = ", ") -> str:
    """The items, those beyond `most` as an ellipsis: 3, 5, 8, ..."""
    return separator.join([*map(str, items[:most]), *(["..."] if len(items) > most else [])])


def recorded_command(said: object) -> str:
    """The command of qinit that a file names, each word quoted anew; "" where it names anything else."""
    try:
        words = shlex.split(said) if isinstance(said, str) else []
    except ValueError:  # a quotation that does not end
        return ""
    if len(words) < 2 or words[0] != "qinit" or not SUBCOMMAND.fullmatch(words[1]):
        return ""
    return shell_line(*words)


def _shown(char: str) -> bool:
    return (char.isprintable() or unicodedata.category(char) == "Zs") and not INVISIBLE.match(char)


def _written_out(char: str) -> str:
    code = ord(char)
    if char in NAMED:
        return NAMED[char]
    if code in UNDECODABLE:
        return rf"\x{code - 0xDC00:02x}"
    return rf"\x{code:02x}" if code < 0x100 else rf"\u{code:04x}" if code < 0x10000 else rf"\U{code:08x}"


def _quoted(word: object) -> str:
    """The word as a shell reads it; with control characters as `$'...'`, which names their bytes."""
    text = str(word)
    if isinstance(word, PurePath) and text.startswith("-"):  # which would be read as an option
        text = f".{os.sep}{text}"
    return shlex.quote(text) if printable(text) == text else f"$'{''.join(_in_dollar_quotes(text))}'"


def _in_dollar_quotes(text: str) -> Iterator[str]:
    for char in text:
        if char in "\\'":
            yield f"\\{char}"
        elif _shown(char):
            yield char
        else:
            yield from (rf"\x{byte:02x}" for byte in char.encode("utf-8", "surrogateescape"))
