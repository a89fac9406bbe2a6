"""Where the keys of a TOML text stand: tomllib tells values without their lines, which errors name."""

from __future__ import annotations

import re
from collections import Counter

KeyPlace = tuple[str | int, ...]  # ("distribution", 0, "variance")

HEADER = re.compile(r"\s*(\[\[?)\s*([^\[\]]+?)\s*\]\]?\s*(?:#.*)?$")
KEY = re.compile(r"""\s*((?:[\w-]+|"[^"]*"|'[^']*')(?:\s*\.\s*(?:[\w-]+|"[^"]*"|'[^']*'))*)\s*=""")
PART = re.compile(r"""[\w-]+|"[^"]*"|'[^']*'""")
QUOTED = re.compile(r'''"""|\'\'\'|"(?:\\.|[^"\\])*"|'[^']*'|#.*''')


def lines(text: str) -> dict[KeyPlace, int]:
    """The line, counted from 1, of each table and key of a valid text; a key within an inline table has its table's line."""
    found: dict[KeyPlace, int] = {}
    count: Counter[KeyPlace] = Counter()  # tables of each list so far
    table: KeyPlace = ()
    depth, ending = 0, ""  # of brackets that are open, and the end of the text that is
    for number, line in enumerate(text.splitlines(), 1):
        if ending:
            _, closed, line = line.partition(ending)
            if not closed:
                continue
            ending = ""
        elif depth == 0 and (header := HEADER.match(line)):
            table = _within(header[2], count)
            if header[1] == "[[":
                count[table] += 1
                table = (*table, count[table] - 1)
            found.setdefault(table, number)
            continue
        elif depth == 0 and (key := KEY.match(line)):
            found.setdefault((*table, *_parts(key[1])), number)
        bare = QUOTED.sub(lambda quoted: quoted[0] if len(quoted[0]) == 3 else "", line)
        for mark in ('"""', "'''"):
            if bare.count(mark) % 2:
                ending = mark
        depth += sum(bare.count(one) for one in "[{") - sum(bare.count(one) for one in "]}")
    return found


def _within(name: str, count: Counter[KeyPlace]) -> KeyPlace:
    """The table of that name; below a list of tables it is of the last so far."""
    place: KeyPlace = ()
    *above, last = _parts(name)
    for part in above:
        place = (*place, part)
        if count[place]:
            place = (*place, count[place] - 1)
    return (*place, last)


def _parts(name: str) -> list[str]:
    return [part.strip("\"'") for part in PART.findall(name)]
