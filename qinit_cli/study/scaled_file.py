"""A study's file at one of its scales: the tables with what the scale puts in their place."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from qinit_cli.errors import UsageError
from qinit_cli.nearest import nearest
from qinit_cli.study.given import Given

ENTRIES = ("distribution", "fit", "method", "table", "plot")  # lists of tables
EITHER = (("sets", "seed"), ("seed", "sets"))  # either says which source sets there are


@dataclass(frozen=True)
class ScaledFile:
    """The tables of a file, as one of its scales has them; without a scale as they stand."""

    top: Given
    file: Path
    scale: str | None

    def __post_init__(self) -> None:
        """UsageError for a scale that the file does not have, or one that changes what nothing is called."""
        scales = self.top.table("scale")
        named = [name for kind in ENTRIES for entry in self.top.tables(kind) if (name := _name(entry))]
        for name in scales.values:
            scales.table(name).check_keys(["sources", "targets", *named])
        if self.scale is not None and self.scale not in scales.values:
            there = list(scales.values)
            problem = nearest(self.scale, there) if there else "its file has no [scale.NAME]"
            raise UsageError(f"{self.file} has no scale {self.scale}; {problem}")

    def entries(self, kind: str) -> list[Given]:
        """The tables of a list."""
        return [self._scaled(entry, _name(entry)) for entry in self.top.tables(kind)]

    def of(self, key: str, entry: Given) -> Given:
        """What the study says of its sources or targets, with what an entry says of them in its place."""
        usual, own = self._scaled(self.top.table(key), key), entry.table(key)
        for one, other in EITHER:
            if one in own.values:
                usual = usual.without(other)
        return usual.merged(own)

    def _scaled(self, entry: Given, name: str | None) -> Given:
        if self.scale is None or name is None:
            return entry
        changes = self.top.table("scale").table(self.scale)
        return entry.merged(changes.table(name)) if name in changes.values else entry


def _name(entry: Given) -> str | None:
    """What an entry is called: its group, else its own name or its family."""
    name = entry.values.get("group", entry.values.get("name", entry.values.get("family")))
    return name if isinstance(name, str) else None
