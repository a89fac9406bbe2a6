"""The mean of the source tables, the plainest initialisation."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

from qinit_cli.methods.method import Initialisation, Look

if TYPE_CHECKING:
    from qinit_cli.arrays import Floats
    from qinit_cli.fitted import FittedTables
    from qinit_cli.methods.targets import Targets


@dataclass(frozen=True)
class Mean(Initialisation):
    """The mean over the sources: mean_i Q_i."""

    name: ClassVar[str] = "mean"
    formula: ClassVar[str] = "mean_i Q_i"
    look: ClassVar[Look] = Look("#888888", "v", "////")

    def start(self, fit: FittedTables, targets: Targets) -> Floats:
        """mean_i Q_i over the sources with a positive value, (S, A)."""
        return fit.mean
