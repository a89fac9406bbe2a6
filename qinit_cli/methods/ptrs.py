"""PTRS: policy transfer by reward shaping (Brys et al., 2015), the potential being the sources' mean value."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar, Literal

from qinit_cli.methods.method import Look
from qinit_cli.methods.plus import Plus
from qinit_cli.options import option

if TYPE_CHECKING:
    from qinit_cli.arrays import Floats
    from qinit_cli.fitted import FittedTables
    from qinit_cli.methods.targets import Targets


@dataclass(frozen=True)
class Ptrs(Plus):
    """PTRS: rewards shaped by the sources' mean value, r + gamma phi(s') - phi(s).

    Shaping by phi equals starting from phi (Wiewiora, 2003), so with an --init the sources count twice.
    """

    phi: Literal["mean-max", "max-mean"] = option(
        "mean-max", "The potential: mean_i max_a Q_i, or max_a mean_i Q_i."
    )

    name: ClassVar[str] = "ptrs"
    formula: ClassVar[str] = "phi(s) = mean_i max_a Q_i(s, a)"
    look: ClassVar[Look] = Look("#CC79A7", "<")

    def potential(self, fit: FittedTables, targets: Targets) -> Floats:
        """mean_i max_a Q_i or max_a mean_i Q_i, (S,); 0 where no source knows the state."""
        import numpy as np

        if self.phi == "mean-max":
            return fit.value_mean
        best: Floats = np.where(fit.known, fit.mean, 0.0).max(axis=1)
        return best
