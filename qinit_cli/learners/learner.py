"""What a learner is, seen from the loop: what a step leaves in the table, given what it has met.

A learner is a small frozen dataclass, free of numpy so that help stays fast: its docstring states the update and its source, its
fields are the options, and `kernel` makes what the compiled loop reads. A subclass says what is true of it.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, ClassVar

from qinit_cli.options import check
from qinit_cli.schedules import ByVisits, Exponential, Linear
from qinit_cli.spelling import write

if TYPE_CHECKING:
    from qinit_cli.kernels.learner import Batch
    from qinit_cli.learning import Learning


@dataclass(frozen=True)
class Learner:
    """The neutral learner; subclasses replace what differs."""

    name: ClassVar[str]
    learns: ClassVar[bool] = True
    steps: ClassVar[bool] = True  # it has a step size
    counts: ClassVar[bool] = True  # a step updates one state-action, so that its updates can be counted
    sums: ClassVar[bool] = False  # it can learn values that are sums of weights
    tables: ClassVar[int] = 1  # whose updates are counted apart
    waits: ClassVar[bool] = False  # an update waits for the action after its step
    shapes: ClassVar[bool] = True  # it learns from shaped rewards
    # after n updates (1 - alpha)^n of its start is left in a value: the posterior can move it
    weighs: ClassVar[bool] = True
    blends: ClassVar[bool] = False  # its kernel has nothing but `aim`: a blend can take its update over
    explores: ClassVar[bool] = True  # it needs an exploration; else it is greedy unless one is asked for
    optimism: ClassVar[float] = 0.0  # the start of source tasks

    def __post_init__(self) -> None:
        check(self)

    def refusal(self, learning: Learning) -> str:
        """Why it cannot learn with these settings, the name of one of them first; empty if it can."""
        if isinstance(learning.alpha, ByVisits) and not self.counts:
            return (
                f"alpha is {learning.alpha}; {self.name} updates many state-actions at once and takes a number, "
                f"{Linear.form} or {Exponential.form}"
            )
        return ""

    def kernel(self, learning: Learning, batch: Batch) -> Any:
        """What the compiled loop reads of it: a NamedTuple whose class has bodies for the parts of kernels.learner."""
        raise NotImplementedError

    def __str__(self) -> str:
        """As it is written on the command line."""
        return write(self)
