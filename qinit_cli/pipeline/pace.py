"""The time that is left of many things to be made: what was foreseen of each, corrected by how long others of its kind took."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field

Kind = tuple[str, ...]


@dataclass
class UnderWay:
    """One thing that is being made."""

    what: str
    kind: Kind
    foreseen: float  # seconds
    share: float = 0.0  # of it that is over


@dataclass
class Pace:
    """Seconds that were foreseen and that were taken, by kind of what is made."""

    foreseen: Mapping[Kind, float]  # of all that is to be done
    _taken: dict[Kind, float] = field(default_factory=lambda: defaultdict(float))
    _done: dict[Kind, float] = field(
        default_factory=lambda: defaultdict(float)
    )  # what was foreseen of what is done

    def took(self, kind: Kind, foreseen: float, taken: float) -> None:
        """Counts one that is done."""
        for part in _wider(kind):
            self._done[part] += foreseen
            self._taken[part] += taken

    def factor(self, kind: Kind) -> float:
        """How many seconds one foreseen second takes: of the narrowest kind of which something is done, else 1."""
        for part in _wider(kind):
            if self._done[part] > 0:
                return self._taken[part] / self._done[part]
        return 1.0

    def left(self, under_way: Iterable[UnderWay] = ()) -> float:
        """Seconds of all that is not done, one thing after the other."""
        left = sum((all_of - self._done[kind]) * self.factor(kind) for kind, all_of in self.foreseen.items())
        over = sum(one.share * one.foreseen * self.factor(one.kind) for one in under_way)
        return max(0.0, left - over)


def _wider(kind: Kind) -> Iterable[Kind]:
    """The kind, and each that has it: with ever fewer of its words."""
    return (kind[:count] for count in range(len(kind), 0, -1))
