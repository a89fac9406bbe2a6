"""The target's own Q*, the reference that no method may look at; section 7 of the paper."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

from qinit_cli.methods.method import Look, Method

if TYPE_CHECKING:
    from qinit_cli.arrays import Floats
    from qinit_cli.fitted import FittedTables
    from qinit_cli.methods.targets import Targets


@dataclass(frozen=True)
class Optimal(Method):
    """The target's own Q* (privileged): a reference, not a bound, as learning goes on from it."""

    name: ClassVar[str] = "optimal"
    formula: ClassVar[str] = "Q* of the target"
    privileged: ClassVar[bool] = True
    reference: ClassVar[bool] = True
    attains: ClassVar[bool] = True
    look: ClassVar[Look] = Look("#000000", "*", "----", ":")
    needs_tables: ClassVar[bool] = True

    @property
    def reads_sources(self) -> bool:
        """It reads the target alone."""
        return False

    def start(self, fit: FittedTables, targets: Targets) -> Floats:
        """Q* of each target, (T, S, A), as shares."""
        return fit.bounds.shares(targets.tables)
