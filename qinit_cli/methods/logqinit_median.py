"""LogQInit-median: the median of the fitted log-normal; section 6 of the paper."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

from qinit_cli.errors import NotAllowed
from qinit_cli.methods.method import Initialisation, Look

if TYPE_CHECKING:
    from qinit_cli.arrays import Floats
    from qinit_cli.fitted import FittedTables
    from qinit_cli.methods.targets import Targets


@dataclass(frozen=True)
class LogQInitMedian(Initialisation):
    """The median of the fitted log-normal: exp(mu) (LogQInit-median, section 6)."""

    name: ClassVar[str] = "logqinit-median"
    formula: ClassVar[str] = "exp(mu)"
    reference: ClassVar[bool] = True
    look: ClassVar[Look] = Look("#0072B2", "o")

    def start(self, fit: FittedTables, targets: Targets) -> Floats:
        """exp(mu), (S, A), by the fit's estimator; NotAllowed where that has no median."""
        if fit.estimator == "shen":
            raise NotAllowed("this fit's estimator, shen, has no median; fit again with --estimator mle")
        return fit.lognormal_median
