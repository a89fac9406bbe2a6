"""Artefacts in memory: made, read and hashed as those in files are, and gone with the last reference to them."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any, Self

import numpy as np

from qinit_store import encoding
from qinit_store.digest import content_sha256, task_digests
from qinit_store.encoding import SCHEMA_VERSION
from qinit_store.errors import Damaged, Refused
from qinit_store.reading import Artefact
from qinit_store.schema import TASK, TASK_DIGEST, Array, Schema
from qinit_store.spec import Spec, canonical_json, read_json, settings, spec_sha256


class Held(Artefact):
    """An artefact whose columns are arrays in memory; `path` is the name that it would have, where there is no file."""

    def __init__(
        self,
        name: Path,
        schema: Schema,
        spec: Spec,
        ids: Array,
        rows: Mapping[str, Array],
        statics: Mapping[str, Array],
        provenance: Mapping[str, Any],
        inputs: Sequence[Mapping[str, str]],
    ) -> None:
        spec_json = canonical_json(spec)
        self.path, self.kind, self.format = name, schema.kind, f"qinit/{schema.kind}"
        self.spec = settings(read_json(spec_json))
        self.spec_sha256 = spec_sha256(spec)
        self.provenance = dict(provenance)
        self.inputs = tuple(dict(one) for one in inputs)
        self.schema_version = SCHEMA_VERSION
        self.schema, self.tasks = schema, ids
        self.strange: list[str] = []
        self.trouble = ""
        self._rows = dict(rows)
        self._statics = {axis.name: axis.values for axis in schema.axes} | dict(statics)
        self._ahead: dict[str, Array] = {}
        self._digests = task_digests(schema.task_columns, ids, self._rows)
        self._rows[TASK_DIGEST] = self._digests
        self.content_sha256 = content_sha256(self.kind, spec_json, ids, self._digests, self._statics)

    def of_kind(self, kind: str | None) -> Self:
        """Itself; Refused if it is of another kind."""
        if kind not in (None, self.kind):
            raise Refused(f"{self.path} is of the kind {self.kind}; {kind} is needed")
        return self

    def damage(self, reason: str) -> Damaged:
        """Damaged for this reason: the arrays cannot be what was made."""
        return Damaged(f"{self.path}, in memory, is damaged: {reason}")

    def read_ahead(self, names: Iterable[str]) -> dict[str, Array]:
        """The whole columns `names`."""
        return {name: self._rows[self._column(name).name].copy() for name in names}

    def close(self) -> None:
        """Keeps it open: its arrays go with the last reference."""

    def _unverified(self, first: int, stop: int) -> dict[str, Array]:
        rows = {
            column.name: self._rows[column.name][first:stop].copy() for column in self.schema.task_columns
        }
        return {TASK: self.tasks[first:stop].copy(), **rows}


class HeldWork:
    """An artefact in the making, in memory: what `work.Work` is for files."""

    complete = False
    set_aside = 0

    def __init__(self, name: Path, schema: Schema, spec: Spec) -> None:
        self._name, self._schema, self._spec = name, schema, spec
        self._saved: list[tuple[Array, dict[str, Array]]] = []
        self._places: dict[int, tuple[int, int]] = {}  # task id: which of these, row
        self.made: Held | None = None

    @property
    def saved(self) -> Array:
        """The ids of the finished tasks, ascending."""
        return np.array(sorted(self._places), dtype=np.int64)

    @property
    def kept(self) -> int:
        """How many these are."""
        return len(self._places)

    def save(self, rows: Mapping[str, Any], tasks: Array) -> None:
        """Takes finished tasks, every column with a leading task axis; ValueError where one does not fit."""
        columns = encoding.checked(self._schema, self._schema.task_columns, rows, tasks.size)
        self._places |= {number: (len(self._saved), row) for row, number in enumerate(tasks.tolist())}
        self._saved.append((tasks, columns))

    def row(self, number: int) -> dict[str, Array]:
        """The finished task with the id `number`, without the task axis."""
        part, row = self._places[number]
        return {name: values[row] for name, values in self._saved[part][1].items()}

    def finish(
        self,
        tasks: Array | None = None,
        statics: Mapping[str, Any] | None = None,
        provenance: Mapping[str, Any] | None = None,
        inputs: Sequence[Mapping[str, str]] = (),
    ) -> Path:
        """Makes the artefact of all finished tasks; `made` holds it. Its name."""
        ids = self.saved
        order = np.argsort(np.concatenate([part for part, _ in self._saved])) if self._saved else ids
        rows = {
            column.name: np.concatenate([columns[column.name] for _, columns in self._saved])[order]
            for column in self._schema.task_columns
            if column.given and self._saved
        }
        fixed = encoding.checked(self._schema, self._schema.static_columns, statics or {}, 0)
        self.made = Held(self._name, self._schema, self._spec, ids, rows, fixed, provenance or {}, inputs)
        self._saved, self._places = [], {}
        return self._name
