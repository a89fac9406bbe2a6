"""A start that no source decides."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, ClassVar

from qinit_cli.plugin import Fit, Look, Method, Targets, option

if TYPE_CHECKING:
    from numpy.typing import NDArray


@dataclass(frozen=True)
class Hopeful(Method):
    """Every value starts at the same hope, whatever the sources know."""

    hope: float = option(0.5, "Where every value starts.", low=0, high=1)

    name: ClassVar[str] = "hopeful"
    formula: ClassVar[str] = "hope"
    look: ClassVar[Look] = Look("#123456", "h")

    @property
    def reads_sources(self) -> bool:
        """It reads none: one run of it serves all source sets."""
        return False

    def start(self, fit: Fit, targets: Targets) -> NDArray[Any]:
        """The hope, (S, A)."""
        import numpy as np

        return np.full(fit.mean.shape, self.hope)
