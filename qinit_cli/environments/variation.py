"""What changes from task to task, or is set for all of them, in an environment that somebody else has written."""

from __future__ import annotations

import re
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, Self

from qinit_cli.environments.file_rows import literal
from qinit_cli.environments.taken_names import FILE_TASK, OF_TASKS
from qinit_cli.environments.varied_values import KINDS, FileRows, VariedValues

if TYPE_CHECKING:
    import numpy as np

    from qinit_cli.environments.family import Role

NAME = re.compile(r"[A-Za-z][A-Za-z0-9_]*")
AXIS = re.compile(r"state|row|col|x\d+")
LONGEST = 64  # letters of a column's name


@dataclass(frozen=True)
class Variation:
    """A constructor argument or an attribute that each task draws."""

    name: str
    kind: str
    values: VariedValues

    @classmethod
    def read(cls, text: str) -> Self:
        """The variation in NAME=KIND:WHAT; ValueError where there is none."""
        name, _, told = text.partition("=")
        kind, colon, what = told.partition(":")
        if not (colon and NAME.fullmatch(name) and kind in KINDS):
            raise ValueError(
                f"--vary {text}: write {' or '.join(f'NAME={k}:{v.form}' for k, v in KINDS.items())}"
            )
        if len(name) > LONGEST:
            raise ValueError(
                f"--vary {text}: {name} has {len(name)} letters; a column of an artefact has {LONGEST} at most"
            )
        try:
            return cls(name, kind, KINDS[kind].read(what, name))
        except ValueError as error:
            raise ValueError(
                f"--vary {text}: {str(error) or f'write NAME={kind}:{KINDS[kind].form}'}"
            ) from error

    def among(self, use: str | None, targets: str | None) -> Self:
        """The same where rows of its file are named as sources or targets; what is drawn otherwise stays as it is."""
        if not isinstance(self.values, FileRows) or (use is None and targets is None):
            return self
        return replace(self, values=replace(self.values, use=use, targets=targets))

    @property
    def column(self) -> str:
        """What the drawn value is called in an artefact, where each name stands for one thing."""
        name = self.name.lower()
        return f"{name}_drawn" if name in (*OF_TASKS, FILE_TASK) or AXIS.fullmatch(name) else name

    @property
    def label(self) -> str:
        """What it is in an artefact's name."""
        return f"{self.name}-{self.values.label}"

    @property
    def description(self) -> str:
        """What the drawn value is."""
        return ", ".join(part for part in (self.name, self.values.note) if part)

    def available(self, role: Role) -> int | None:
        """How many values there are; None: any number is drawn."""
        return self.values.available(role)

    def draw(self, rng: np.random.Generator, index: int, role: Role) -> float | int:
        """The drawn value of the task at that index of sources or targets."""
        return self.values.draw(rng, index, role)

    def value(self, drawn: float | int) -> Any:
        """What the environment is given."""
        return self.values.value(drawn)


def stored(text: str) -> str:
    """The words of a variation as they are stored: of a file, with the digest of what it holds, unless they have one."""
    variation = Variation.read(text)
    if isinstance(variation.values, FileRows):
        return f"{variation.name}={variation.kind}:{variation.values.stored()}"
    return text


def setting(text: str) -> tuple[str, Any]:
    """The name and the value in NAME=VALUE: what Python writes so, nan and inf among it, else the text itself."""
    name, equals, value = text.partition("=")
    if not (equals and NAME.fullmatch(name)):
        raise ValueError(f"--set {text}: write NAME=VALUE")
    return name, literal(value)
