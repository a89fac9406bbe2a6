"""LogQInit-mean: the mean of the fitted log-normal; section 6 of the paper."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

from qinit_cli.methods.method import Initialisation, Look

if TYPE_CHECKING:
    from qinit_cli.arrays import Floats
    from qinit_cli.fitted import FittedTables
    from qinit_cli.methods.targets import Targets


@dataclass(frozen=True)
class LogQInitMean(Initialisation):
    """The mean of the fitted log-normal: exp(mu + sigma^2/2) (LogQInit-mean, section 6)."""

    name: ClassVar[str] = "logqinit-mean"
    formula: ClassVar[str] = "exp(mu + sigma^2/2)"
    look: ClassVar[Look] = Look("#56B4E9", "D", "////")

    def start(self, fit: FittedTables, targets: Targets) -> Floats:
        """exp(mu + sigma^2/2), (S, A), by the fit's estimator."""
        return fit.lognormal_mean
