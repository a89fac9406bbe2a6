"""MaxQInit: optimism from the best source (Abel et al., 2018)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar, Literal

from qinit_cli.methods.method import Initialisation, Look
from qinit_cli.options import option

if TYPE_CHECKING:
    from qinit_cli.arrays import Floats
    from qinit_cli.fitted import FittedTables
    from qinit_cli.methods.targets import Targets


@dataclass(frozen=True)
class MaxQInit(Initialisation):
    """The largest value that any source has there: max_i Q_i (Abel et al., 2018)."""

    fallback: Literal["zero", "largest"] = option(
        "largest", "What stands where no source knows a pair: 0, or the largest value of the table."
    )

    name: ClassVar[str] = "maxqinit"
    formula: ClassVar[str] = "max_i Q_i"
    look: ClassVar[Look] = Look("#D55E00", "^", "....")

    def start(self, fit: FittedTables, targets: Targets) -> Floats:
        """max_i Q_i, (S, A)."""
        return fit.max
