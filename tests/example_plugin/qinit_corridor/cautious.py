"""A start below what the sources know."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, ClassVar

from qinit_cli.plugin import Fit, Initialisation, Targets, option

if TYPE_CHECKING:
    from numpy.typing import NDArray


@dataclass(frozen=True)
class Cautious(Initialisation):
    """The mean of the sources less some of their standard deviations."""

    caution: float = option(0.5, "Standard deviations below the mean.", low=0)

    name: ClassVar[str] = "cautious"
    formula: ClassVar[str] = "mean_i Q_i - caution * sd"

    def start(self, fit: Fit, targets: Targets) -> NDArray[Any]:
        """mean_i Q_i - caution * sd, (S, A); NaN where no source knows."""
        return fit.mean - self.caution * fit.std
