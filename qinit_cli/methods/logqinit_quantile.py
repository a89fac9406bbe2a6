"""LogQInit-quantile: any quantile of the fitted log-normal, the median being 0.5."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

from qinit_cli.errors import NotAllowed
from qinit_cli.methods.method import Initialisation, Look
from qinit_cli.options import option

if TYPE_CHECKING:
    from qinit_cli.arrays import Floats
    from qinit_cli.fitted import FittedTables
    from qinit_cli.methods.targets import Targets

ONE_SIGMA_BELOW = 0.15865525393145707  # Phi(-1)


@dataclass(frozen=True)
class LogQInitQuantile(Initialisation):
    """A quantile of the fitted log-normal: exp(mu + z sigma), z = Phi^-1(quantile)."""

    quantile: float = option(
        ONE_SIGMA_BELOW,
        "Share of the distribution below the start; the default is one sigma below.",
        above=0,
        below=1,
        grid=(0.02, 0.05, 0.1, 0.2, 0.3, 0.5, 0.7),
    )

    name: ClassVar[str] = "logqinit-quantile"
    formula: ClassVar[str] = "exp(mu + z sigma), z = Phi^-1(quantile)"
    look: ClassVar[Look] = Look("#332288", "P", "....")

    def start(self, fit: FittedTables, targets: Targets) -> Floats:
        """exp(mu + z sigma), (S, A); NotAllowed where the fit's estimator is not mle."""
        if fit.estimator != "mle":
            raise NotAllowed(
                f"quantiles need the estimator mle, this fit has {fit.estimator}; fit again with --estimator mle"
            )
        from qinit_cli.analysis.estimators import lognormal_quantile

        return lognormal_quantile(fit.mu, fit.sigma, self.quantile)
