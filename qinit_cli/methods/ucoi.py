"""UCOI: between mean and maximum, by confidence and uncertainty (Mehimeh et al., 2023); a reconstruction.

The formula of the original is not public. This one is made from its abstract and from what the LogQInit paper says of it: the
maximum where little is known, the mean where much is certain.
"""

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
class Ucoi(Initialisation):
    """UCOI, a reconstruction: between mean and max by how many sources agree how closely."""

    kappa: float = option(
        10.0,
        "Sources at which confidence in their mean is one half.",
        low=0,
        grid=(0.0, 1.0, 3.0, 10.0, 30.0, 100.0),
    )
    # by its own formula: without a source confidence is 0, which leaves the maximum
    fallback: Literal["zero", "largest"] = option(
        "largest", "What stands where no source knows a pair: 0, or the largest value of the table."
    )

    name: ClassVar[str] = "ucoi"
    formula: ClassVar[str] = "(1-b) mean + b max, b = 1 - c (1-u), c = n/(n+kappa), u = 2 sd/(max-min)"
    look: ClassVar[Look] = Look("#E69F00", "s", "\\\\\\\\")
    reconstructed: ClassVar[bool] = True

    def start(self, fit: FittedTables, targets: Targets) -> Floats:
        """(1-b) mean + b max, (S, A): c = n/(n+kappa) is confidence, u = 2 sd/(max-min), at most 1, uncertainty."""
        import numpy as np

        confidence = fit.n / np.maximum(
            fit.n + self.kappa, 1
        )  # where n is 0 nothing is known, kappa may be 0
        width = fit.max - fit.min
        # the largest standard deviation that values within the width can have is half of it
        uncertainty = np.where(
            width > 0, np.clip(2 * fit.std / np.where(width > 0, width, 1.0), 0.0, 1.0), 0.0
        )
        boldness = 1 - confidence * (1 - uncertainty)
        start: Floats = (1 - boldness) * fit.mean + boldness * fit.max
        return start
