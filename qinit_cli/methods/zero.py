"""Learning from scratch, the baseline of every comparison."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from qinit_cli.methods.method import Look, Method


@dataclass(frozen=True)
class Zero(Method):
    """No transfer: every value starts at 0."""

    name: ClassVar[str] = "zero"
    formula: ClassVar[str] = "0"
    reference: ClassVar[bool] = True
    transfers: ClassVar[bool] = False
    look: ClassVar[Look] = Look("#000000")

    @property
    def reads_sources(self) -> bool:
        """It reads none."""
        return False
