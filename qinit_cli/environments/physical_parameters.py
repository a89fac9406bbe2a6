"""What a task of a physical world is made of: masses, lengths and forces, each fixed or drawn from task to task."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from qinit_cli.environments.varied_values import KINDS, UniformValues, VariedValues
from qinit_cli.options import flag

if TYPE_CHECKING:
    from qinit_store.schema import Column

VARYING = ("uniform", "loguniform", "truncnorm", "choice")  # distributions with a least and a largest value
METAVAR = "NUMBER|KIND:WHAT"


@dataclass(frozen=True)
class PhysicalParameter:
    """A positive number with a unit; `read` takes what is drawn for it."""

    name: str
    description: str
    unit: str
    low: float
    high: float

    def read(self, text: str) -> VariedValues:
        """What a number or KIND:WHAT has; ValueError where it is neither, or has values beyond the bounds."""
        told = f"{flag(self.name)} {text}"
        kind, colon, what = text.partition(":")
        if colon and kind not in VARYING:
            remedy = f"write {self._forms()}"
            if kind == "normal":
                remedy = f"a normal has negative values too; write truncnorm:{KINDS['truncnorm'].form}"
            raise ValueError(f"{told}: {remedy}")
        try:
            values = KINDS[kind].read(what, self.name) if colon else UniformValues.read(f"{text},{text}", "")
        except ValueError as error:
            reason = str(error) or f"write {f'{kind}:{KINDS[kind].form}' if colon else self._forms()}"
            raise ValueError(f"{told}: {reason}") from error
        low, high = values.bounds
        if values.note or low is None or high is None:  # words to choose from
            raise ValueError(f"{told}: {self.description} is a number")
        if not self.low <= low <= high <= self.high:
            raise ValueError(f"{told}: {self.description} must be from {self.low:g} to {self.high:g}")
        return values

    def column(self, text: str) -> Column:
        """The column of what is drawn."""
        from qinit_store.schema import Column

        low, high = self.read(text).bounds
        return Column(self.name, ("task",), "<f8", self.unit, self.description, low=low, high=high)

    def _forms(self) -> str:
        return "a number, or " + " or ".join(f"{kind}:{KINDS[kind].form}" for kind in VARYING)
