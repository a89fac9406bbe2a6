"""A learner that does not count on acting at its best."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, ClassVar

from qinit_cli.plugin import Learner, Learning, option

if TYPE_CHECKING:
    from qinit_cli.plugin.kernels import Batch


@dataclass(frozen=True)
class Mellow(Learner):
    """Mellow Q-learning: Q(s, a) += alpha (r + gamma ((1 - share) max_b Q(s', b) + share mean_b Q(s', b)) - Q(s, a))."""

    share: float = option(0.1, "Weight of the mean.", low=0, high=1)

    name: ClassVar[str] = "mellow"

    def kernel(self, learning: Learning, batch: Batch) -> Any:
        """The share."""
        from qinit_corridor.mellow_kernel import Towards

        return Towards(float(self.share))
