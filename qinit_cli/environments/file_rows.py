"""The rows of a file in which tasks are listed: a CSV with a header, or a line of JSON each."""

from __future__ import annotations

import ast
import math
from dataclasses import dataclass
from functools import cached_property, lru_cache
from pathlib import Path, PurePath
from typing import Any

from qinit_cli.environments.family import Role
from qinit_cli.errors import UsageError

LARGEST = 2**53  # whole numbers beyond it are not all told apart by a float
ROLES: tuple[Role, ...] = ("source", "target")
SPLIT = "split"  # a column of this name tells whose a row is
JSON_LINES = (".jsonl", ".ndjson")
CONTEXTS_FILE = ".json"
OF_ROWS = (".csv", CONTEXTS_FILE, *JSON_LINES)
CONTEXTS = "contexts"  # the column of whole contexts, by which CARL's environments take them


@dataclass(frozen=True)
class Rows:
    """What a file of tasks has."""

    path: str
    columns: dict[str, tuple[Any, ...]]
    digest: str  # SHA-256 of its bytes, in hexadecimal

    @property
    def count(self) -> int:
        """How many rows there are."""
        return len(next(iter(self.columns.values())))

    @property
    def labels(self) -> tuple[str, ...]:
        """The label of each row in the column `split`; none without one."""
        return tuple(map(str, self.columns.get(SPLIT, ())))

    @cached_property
    def of(self) -> dict[Role, tuple[int, ...]]:
        """The rows of sources, and those of targets, by `split` or in turn; UsageError where a row is neither."""
        whose = self._whose()
        return {role: tuple(row for row, own in enumerate(whose) if own == role) for role in ROLES}

    def _whose(self) -> tuple[Role, ...]:
        if SPLIT not in self.columns:
            return tuple("target" if row % 2 else "source" for row in range(self.count))
        for row, whose in enumerate(self.columns[SPLIT]):
            if whose not in ROLES:
                raise UsageError(
                    f"row {row} of {self.path} has the {SPLIT} {whose!r:.40}; write source or target, or choose rows by --use"
                )
        return self.columns[SPLIT]


def read_rows(path: str) -> Rows:
    """The columns of a CSV or of JSON lines; UsageError, one sentence, where it is neither."""
    try:
        stat = Path(path).stat()
        return _read_rows(path, stat.st_mtime_ns, stat.st_size)
    except OSError as error:
        raise UsageError(
            f"{path} cannot be read ({error.strerror}); tasks are drawn from it, so put it there"
        ) from error


@lru_cache(16)
def _read_rows(path: str, changed: int, size: int) -> Rows:
    import csv
    import hashlib
    import json

    content = Path(path).read_bytes()
    try:
        text = content.decode("utf-8-sig")
        if PurePath(path).suffix == CONTEXTS_FILE:
            rows = _contexts(json.loads(text))
        elif PurePath(path).suffix in JSON_LINES:
            rows = [json.loads(line) for line in text.splitlines() if line.strip()]
            if not all(isinstance(row, dict) for row in rows):
                raise ValueError("a line is no object")
        else:
            reader = csv.DictReader(text.splitlines(), strict=True)
            table, header = list(reader), reader.fieldnames or ()
            if len(set(header)) < len(header):
                raise ValueError("two columns have the same name")
            if any(None in row or None in row.values() for row in table):
                raise ValueError("a row has more or fewer fields than the header")
            rows = [{key: literal(value) for key, value in row.items()} for row in table]
    except (ValueError, csv.Error) as error:
        raise UsageError(
            f"{path} is no CSV with a header, no .jsonl of objects and no .json of contexts: {error}"
        ) from error
    if not rows:
        raise UsageError(f"{path} has no rows")
    if uneven := next((place for place, row in enumerate(rows) if row.keys() != rows[0].keys()), 0):
        raise UsageError(f"row {uneven} of {path} has other columns than row 0")
    if not rows[0]:
        raise UsageError(f"the rows of {path} are empty")
    columns = {key: tuple(row[key] for row in rows) for key in rows[0]}
    return Rows(path, columns, hashlib.sha256(content).hexdigest())


def _contexts(told: Any) -> list[dict[str, Any]]:
    """A row for each context of {ID: {FEATURE: VALUE}}: its features, and `contexts`, itself by its id. ValueError."""
    if not (isinstance(told, dict) and all(isinstance(one, dict) for one in told.values())):
        raise ValueError("it is no object of objects")
    return [{**features, CONTEXTS: {key: features}} for key, features in told.items()]


def literal(text: str) -> Any:
    """What Python writes so, nan and inf among it, else the text itself."""
    if text.lstrip("+-") in ("nan", "inf"):  # numbers, whatever becomes of them
        return float(text)
    try:
        return ast.literal_eval(text)
    except (ValueError, SyntaxError):
        return text


def is_number(value: Any) -> bool:
    """Whether a column of floats or of whole numbers holds it as it is."""
    if isinstance(value, bool):
        return False
    return (isinstance(value, int) and abs(value) < LARGEST) or (
        isinstance(value, float) and math.isfinite(value)
    )
