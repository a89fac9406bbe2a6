"""What an artefact's kind says of itself: its name and folder, what makes it, which settings and columns it must have.

A kind is known before anything is computed, so it imports numpy, and what needs it, inside its methods.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Container, Iterable, Iterator, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar, Generic, Literal, TypeVar

if TYPE_CHECKING:
    from qinit_cli.arrays import Floats
    from qinit_cli.artefacts.settings import Settings, SourcesSettings, Spec
    from qinit_cli.environments import Family
    from qinit_store.reading import Artefact
    from qinit_store.schema import Array, Axis, Column, Schema

Told = TypeVar("Told", bound="Settings")
Picture = Literal["histogram", "heatmap", "curve"]


@dataclass(frozen=True)
class Field:
    """One column of a long table."""

    name: str
    dtype: str  # as numpy writes it; "str" for text
    unit: str
    long_name: str


DIGEST = "task_digest"
DIGEST_FIELD = Field(DIGEST, "str", "", "SHA-256 of the task's hashed columns")


@dataclass(frozen=True)
class Shown:
    """An artefact in brief; numbers may be NaN where there is nothing to count."""

    numbers: dict[str, int | float | str]
    picture: Floats  # histogram: (n,); heatmap: the state axes; curve: (E,); () long where there is none
    drawn: Picture = "curve"  # how
    title: str = ""  # in words
    label: str = ""  # of its axis


@dataclass(frozen=True)
class Reported:
    """Settings under one heading of a report, which shows those of the least distance."""

    heading: str
    settings: Spec
    distance: int = (
        0  # from the artefact that they are the settings of: 1 in what was made of it, 2 beyond that
    )


class Kind(ABC, Generic[Told]):
    """One kind of artefact."""

    name: ClassVar[str]
    folder: ClassVar[str]  # in a store
    maker: ClassVar[str]  # the command that makes it
    one: ClassVar[str]  # in a sentence, as "set of sources"
    several: ClassVar[str]
    counted: ClassVar[str]  # what its setting `tasks` counts
    # the long tables, the default first, each led by the dataset that gives its axes
    tables: ClassVar[Mapping[str, str]]
    table: ClassVar[str] = ""  # the column whose axes are states and actions; "" where it has none
    has_parameters: ClassVar[bool] = False  # whether what each task was drawn as stands there
    free: ClassVar[tuple[str, ...]] = ()  # columns that may have a task axis before the axes they must have
    by_task: ClassVar[bool] = True  # whether it has a task axis
    indices: ClassVar[tuple[str, ...]] = ()  # axes that count from 0
    results: ClassVar[
        tuple[str, ...]
    ] = ()  # columns of one number a task; what else is such is what the task was drawn as
    described: ClassVar[tuple[str, ...]] = (
        "task",
    )  # axes whose entries are told apart by columns over them alone

    @abstractmethod
    def read(self, spec: Spec) -> Told:
        """The settings of an artefact; ValueError, in one clause, for the first that cannot be."""

    def least(self, states: tuple[Axis, ...], action: Axis, there: Container[str]) -> tuple[Column, ...]:
        """The columns that it has whatever its options, over these axes, given the names of those that are there."""
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
        for wanted in self.least(tuple(states), action, there):
            found = there.get(wanted.name)
            if found is None or not serves(found, wanted, wanted.name in self.free):
                return f"{wanted.name} ({wanted.dtype}) over {', '.join(wanted.dims)}"
        return ""

    def asked(self, spec: Spec) -> tuple[str, ...]:
        """The columns that these settings ask for, beside those that every artefact of the kind has."""
        return ()

    def lengths(self, artefact: Artefact) -> dict[str, int]:
        """The length of each index, as the settings make it."""
        return {}

    @abstractmethod
    def columns(self, artefact: Artefact) -> tuple[Column, ...]:
        """The columns that it may have, over the file's own axes."""

    def highest(self, artefact: Artefact) -> dict[str, float]:
        """The largest value of each column that its settings bound."""
        return {}

    def within(self, columns: Iterable[Column], artefact: Artefact) -> list[Column]:
        """The columns with the least and the largest value that these settings allow, where they say more."""
        from dataclasses import replace

        highest = self.highest(artefact)
        return [replace(column, high=highest.get(column.name, column.high)) for column in columns]

    def check_values(self, artefact: Artefact) -> None:  # neutral: few kinds have such
        """ValueError where its numbers contradict one another, or its settings."""

    def table_dims(self, schema: Schema, table: str) -> tuple[str, ...]:
        """The axes of a long table, () where there is none of that name."""
        lead = self.tables.get(table)
        return next((column.dims for column in schema.columns if column.name == lead), ())

    def has_table(self, schema: Schema) -> bool:
        """Whether its table is there: imported curves have none."""
        return any(column.name == self.table for column in schema.columns)

    def axes(self, artefact: Artefact) -> tuple[tuple[Axis, ...], Axis]:
        """The state axes and the action axis of its table."""
        axes = {axis.name: axis for axis in artefact.schema.axes}
        table = next(column for column in artefact.schema.columns if column.name == self.table)
        *states, action = (axes[name] for name in table.dims if name != "task")
        return tuple(states), action

    def longest_path(self, artefact: Artefact, drawn: SourcesSettings) -> dict[str, float]:
        """The most steps of a path of sources: it meets no state twice, or ends at the horizon; none for a plug-in's family."""
        import math

        from qinit_cli.environments import FAMILIES

        if not FAMILIES.is_own(drawn.family.name):
            return {}
        states, _ = self.axes(artefact)
        return {"eopl": 1.0 + max(math.prod(axis.values.size for axis in states), drawn.learning.horizon)}

    def family(self, artefact: Artefact) -> Family:
        """The family of its tasks; NotAllowed if that is not installed, or has other states here."""
        from qinit_cli.environments.tiled import PROBES, TiledFamily
        from qinit_cli.errors import NotAllowed

        family: Family = self.read(artefact.spec).sources.family.installed(artefact.provenance)
        if isinstance(family, TiledFamily) and PROBES in {column.name for column in artefact.schema.columns}:
            family = family.placed(artefact.read(PROBES))
        if not self.has_table(artefact.schema):
            return family
        wanted = (*family.shape, len(family.actions))
        column = next(one for one in artefact.schema.columns if one.name == self.table)
        if (there := artefact.schema.row_shape(column)) != wanted:
            there_told, here_told = (" x ".join(map(str, shape)) for shape in (there, wanted))
            raise NotAllowed(
                f"the tables of {artefact.path} are over {there_told} states and actions, {family.label} has {here_told}; "
                "install the version of its package that they were made with"
            )
        return family

    @abstractmethod
    def shown(self, artefact: Artefact) -> Shown:
        """Numbers and picture, every task verified; memory is that of a block of tasks."""

    def reported(self, told: Told) -> Iterator[Reported]:
        """Its settings as a report shows them."""
        yield Reported(self.several.capitalize(), told.spec())

    def labels(self, spec: Spec) -> dict[str, str]:
        """What tells the rows of several artefacts apart, beside their names."""
        return {}

    def derived_fields(self, table: str) -> list[Field]:
        """Columns of a long table that are no datasets."""
        return []

    def needed(self, table: str) -> tuple[str, ...]:
        """The datasets that the derived columns are made of, those that are there."""
        return ()

    def derived(self, artefact: Artefact, table: str, block: Mapping[str, Array]) -> dict[str, Array]:
        """The derived columns of a block of tasks by name, but for digests; there may be more than the table has."""
        return {}
