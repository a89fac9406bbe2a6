"""Posterior: weighing the source tables by the target's own steps; beyond the paper.

LogQInit commits to one table before the first step. The sources are a set of hypotheses, and the target's transitions tell
between them without a model: docs/posterior.md derives the evidence, its scale and the correction of the table that learns.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass, replace
from typing import TYPE_CHECKING, ClassVar, Literal

from qinit_cli.errors import NotAllowed
from qinit_cli.methods.method import Initial, Look, Method
from qinit_cli.options import option

if TYPE_CHECKING:
    from qinit_cli.arrays import Floats
    from qinit_cli.environments.family import Family
    from qinit_cli.fitted import FittedTables
    from qinit_cli.kernels.posterior import Hypotheses
    from qinit_cli.methods.targets import Targets


@dataclass(frozen=True)
class EvidenceRule:
    """How fast a kind of evidence moves the weights."""

    temperature: float
    freeze: int  # goals
    cap: float  # variances


# Where states are Markov an error that a table does not expect is evidence however large: its own goal was passed, or the
# target's found. Elsewhere bins hide part of the state, and true tables err too: much cooler evidence, of many more goals.
WEIGHING = {"centred": EvidenceRule(0.05, 3, 200.0), "bounded": EvidenceRule(0.01, 30, 5.0)}


@dataclass(frozen=True)
class Posterior(Method):
    """Posterior, beyond the paper: starts from a mean of the sources and weighs them by the target's own TD errors."""

    evidence: Literal["by-family", "centred", "bounded"] = option(
        "by-family",
        "Squared TD errors less what the source itself has (centred), or as they are, each step's much bounded; by-family: "
        "centred where the table's states are Markov.",
    )
    temperature: float | None = option(
        None,
        "Factor of the evidence: 0 leaves all weights equal.",
        low=0,
        default_text="0.05 if centred, else 0.01",
        grid=(0.0, 0.0005, 0.002, 0.01, 0.05, 0.2),
    )
    floor: float = option(0.01, "Least standard deviation of a TD error, above 0.", low=1e-9)
    excess: float = option(0.0, "Squared TD error, in variances, that counts as none.", low=0)
    cap: float | None = option(
        None,
        "Most that one step's squared TD error counts, in variances.",
        low=0,
        default_text="200 if centred, else 5",
    )
    freeze: int | None = option(
        None,
        "Goals reached after which the weights stay; 0: they never freeze.",
        low=0,
        default_text="3 if centred, else 30",
        # with the temperature: cooler evidence needs more goals, and neither alone gains
        grid=(1, 3, 30, 300),
    )
    threshold: float = option(
        0.05, "Movement of the weights, summed over sources, at which the table follows.", low=0, high=2
    )
    mixing: Literal["arithmetic", "geometric"] = option(
        "arithmetic", "Which mean of the source tables: with equal weights, mean or logqinit-median."
    )
    library: int | None = option(
        None,
        "Sources to weigh, the first of the fit's library.",
        low=0,
        metavar="K",
        default_text="all of it",
    )

    name: ClassVar[str] = "posterior"
    formula: ClassVar[str] = "sum_i w_i Q_i, ln w_i = -temperature sum of z_i^2 over the target's own steps"
    weighs: ClassVar[bool] = True
    look: ClassVar[Look] = Look("#882255", "X", "////")

    @property
    def library_wanted(self) -> int:
        """As many as its option says."""
        return self.library or 0

    def on(self, family: Family) -> Posterior:
        """With the evidence that suits the family, and what suits that."""
        evidence = self._evidence(family)
        return replace(self, evidence=evidence, **asdict(self._weighing(evidence)))

    def _evidence(self, family: Family) -> Literal["centred", "bounded"]:
        if self.evidence == "by-family":
            return "centred" if family.tabular else "bounded"
        return self.evidence

    def _weighing(self, evidence: str) -> EvidenceRule:
        given = {
            name: value for name in asdict(WEIGHING[evidence]) if (value := getattr(self, name)) is not None
        }
        return replace(WEIGHING[evidence], **given)

    def start(self, fit: FittedTables, targets: Targets) -> Floats:
        """The mean of the tables under equal weights, (S, A), NaN where none of them knows."""
        return self.hypotheses(fit, targets.family).mean()

    def initial(self, fit: FittedTables, targets: Targets) -> Initial:
        """The mean's start, and the tables with which learning goes on to change it."""
        return replace(super().initial(fit, targets), hypotheses=self.hypotheses(fit, targets.family))

    def hypotheses(self, fit: FittedTables, family: Family) -> Hypotheses:
        """The library's tables, within the bounds of returns, with the rules of weighing.

        NotAllowed where the variances of their TD errors are unknown.
        """
        import numpy as np

        from qinit_cli.kernels.posterior import Hypotheses

        if np.isnan(fit.library_td_var).any():
            raise NotAllowed(
                "the posterior weighs tables by the variances of their TD errors, which are unknown of these imported tables; "
                "import them with an array td_var, or choose another method"
            )
        evidence = self._evidence(family)
        return Hypotheses(
            q=np.clip(fit.library_q[: self.library], 0.0, 1.0),
            td_var=fit.library_td_var[: self.library],
            **asdict(self._weighing(evidence)),
            floor=self.floor,
            excess=self.excess,
            threshold=self.threshold,
            geometric=self.mixing == "geometric",
            centred=evidence == "centred",
            bounds=fit.bounds,
        )
