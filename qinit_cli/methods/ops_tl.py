"""OPS-TL: choosing among source policies while learning (after Li and Zhang, 2018); a reconstruction.

The paper compares with it but gives none of its settings, and they decide its rank: report more than one. While it follows a
policy it does not explore, as all others do; --explore-while-following takes that advantage away.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

from qinit_cli.methods.method import Look
from qinit_cli.methods.plus import Plus
from qinit_cli.options import option

if TYPE_CHECKING:
    from qinit_cli.fitted import FittedTables
    from qinit_cli.kernels.policies import Policies
    from qinit_cli.methods.targets import Targets


@dataclass(frozen=True)
class OpsTl(Plus):
    """OPS-TL, a reconstruction: follows source policies chosen by UCB1, less and less, while learning."""

    library: int = option(
        20, "Source policies to choose among, the first of the fit's library.", low=0, metavar="K"
    )
    c: float = option(0.1, "Weight of the bound on a policy that was seldom tried.", low=0)
    psi0: float = option(
        1.0, "Probability of following the policy at the first step of the first episode.", low=0, high=1
    )
    rho: float = option(
        0.99,
        "Factor on that probability from episode to episode.",
        low=0,
        high=1,
        grid=(0.9, 0.97, 0.99, 0.999, 1.0),
    )
    nu: float = option(
        0.98,
        "Factor on that probability from step to step within an episode.",
        low=0,
        high=1,
        grid=(0.9, 0.98, 0.995, 1.0),
    )
    explore_while_following: bool = option(False, "Explore with epsilon while following, as the others do.")

    name: ClassVar[str] = "ops-tl"
    formula: ClassVar[str] = (
        "argmax_j W_j + c sqrt(2 ln k / n_j), followed with probability psi0 rho^(k-1) nu^t"
    )
    look: ClassVar[Look] = Look("#009E73", "d", "\\\\\\\\")
    reconstructed: ClassVar[bool] = True

    @property
    def library_wanted(self) -> int:
        """As many as its option says."""
        return self.library

    def policies(self, fit: FittedTables, targets: Targets) -> Policies:
        """The greedy policies of the first tables of the library, (K, S), and how they are chosen."""
        from qinit_cli.kernels.policies import Policies

        return Policies(
            actions=fit.library_q[: self.library].argmax(axis=2),
            weights=None if fit.library_weights is None else fit.library_weights[: self.library],
            c=self.c,
            psi0=self.psi0,
            rho=self.rho,
            nu=self.nu,
            explore_while_following=self.explore_while_following,
        )
