"""What an artefact's kind says of itself: its name and folder, what makes it, which settings and columns it must have.

A kind is known before anything is computed, so it imports numpy, and what needs it, inside its methods.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, ClassVar

if TYPE_CHECKING:
    from qinit_store.schema import Axis, Column, Schema

Settings = Mapping[str, Any]


class Kind(ABC):
    """One kind of artefact."""

    name: ClassVar[str]
    folder: ClassVar[str]  # in a store
    maker: ClassVar[str]  # the command that makes it
    table: ClassVar[str] = ""  # the column whose axes are states and actions; "" where it has none
    free: ClassVar[tuple[str, ...]] = ()  # columns that may have a task axis before the axes they must have

    def check(self, spec: Settings) -> None:
        """ValueError, in one clause, for the first setting that cannot be."""
        said = spec.get("kind")
        if said != self.name:
            raise ValueError(f"its settings are of {said!r}, the artefact is of {self.name}")
        self.check_settings({name: value for name, value in spec.items() if name != "kind"})

    @abstractmethod
    def check_settings(self, spec: Settings) -> None:
        """The same for the settings beside the kind's name."""

    def least(self, states: tuple[Axis, ...], action: Axis) -> tuple[Column, ...]:
        """The columns that it has whatever its options, over these axes."""
        raise NotImplementedError

    def lack(self, schema: Schema, *, part: bool) -> str:
        """The first column it must have that `schema` lacks or has otherwise, in words; "" where it has all.

        A `part` of unfinished work has only the columns with a task axis. There may be others: parameters, and what later
        versions add.
        """
        import numpy as np

        from qinit_store.schema import TASK, Axis, serves

        there = {column.name: column for column in schema.columns}
        dims = tuple(name for name in there[self.table].dims if name != TASK) if self.table in there else ()
        if len(dims) < 2:
            return "its tables over states and actions"
        *states, action = (Axis(name, np.arange(1)) for name in dims)
        for wanted in self.least(tuple(states), action):
            found = there.get(wanted.name)
            if found is None or not serves(found, wanted, wanted.name in self.free):
                return f"{wanted.name} ({wanted.dtype}) over {', '.join(wanted.dims)}"
        return ""
