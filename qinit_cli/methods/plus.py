"""The "+" variants: a method that shapes or follows, started by an initialisation instead of zero."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from qinit_cli.methods.method import Initial, Initialisation, Method
from qinit_cli.methods.zero import Zero
from qinit_cli.nearest import nearest
from qinit_cli.options import option

if TYPE_CHECKING:
    from qinit_cli.fitted import FittedTables
    from qinit_cli.methods.targets import Targets


@dataclass(frozen=True)
class Plus(Method):
    """A method whose start is another method's; with zero it is the method without "+"."""

    init: str = option(
        "zero",
        "The initialisation to start from; anything but zero is the paper's + variant "
        "(its text says logqinit-mean, its Figure 6 logqinit-median).",
        metavar="METHOD",
    )

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.init not in initialisations():
            raise ValueError(f"--init is {self.init}; {nearest(self.init, initialisations())}")

    @property
    def reads_moments(self) -> bool:
        """Whether the initialisation does."""
        return self.init != Zero.name

    @property
    def label(self) -> str:
        """The name, with what it starts from unless that is zero, and the options that are not at their default."""
        started = self.name if self.init == Zero.name else f"{self.name}+{self.init}"
        return " ".join([started, *self._changed()])

    def initial(self, fit: FittedTables, targets: Targets) -> Initial:
        """The initialisation's start, filled by its own rule where no source knows, with this method's other arrays."""
        started = initialisations()[self.init]().initial(fit, targets)
        return replace(
            started, potential=self.potential_of(fit, targets), policies=self.policies(fit, targets)
        )


def initialisations() -> dict[str, type[Method]]:
    """The methods that are a start table alone, made from the fit; zero among them."""
    from qinit_cli.methods import METHODS

    return {
        name: method
        for name, method in METHODS.items()
        if method is Zero or (issubclass(method, Initialisation) and not method.privileged)
    }
