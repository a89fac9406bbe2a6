"""DRS: rewards shaped by the distance to the goal; section 7 of the paper."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar, Literal

from qinit_cli.methods.method import Look
from qinit_cli.methods.plus import Plus
from qinit_cli.methods.zero import Zero
from qinit_cli.options import option

if TYPE_CHECKING:
    from qinit_cli.arrays import Floats
    from qinit_cli.fitted import FittedTables
    from qinit_cli.methods.targets import Targets


@dataclass(frozen=True)
class Drs(Plus):
    """DRS: rewards shaped by the distance to the target's goal (privileged), r + gamma phi(s') - phi(s)."""

    distance: Literal["discounted", "linear"] = option(
        "discounted", "The gridworld's potential: gamma^d, or 1 - d/d_max, d the steps of the shortest way."
    )

    name: ClassVar[str] = "drs"
    formula: ClassVar[str] = "phi(s) = gamma^d(s); mountain-car: (x + 1.2) / 1.7 within [0, 1]"
    look: ClassVar[Look] = Look("#8C6D31", ">", "....")
    privileged: ClassVar[bool] = True

    @property
    def reads_sources(self) -> bool:
        """Whether the initialisation does."""
        return self.init != Zero.name

    def potential(self, fit: FittedTables, targets: Targets) -> Floats:
        """How near each state is to the goal, (S,), or (T, S) where goals differ."""
        linear = self.distance == "linear"
        return targets.family.nearness(targets.tasks, targets.learning.gamma, linear=linear)
