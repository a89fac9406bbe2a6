"""What a learner is, seen from the loop: what a step leaves in the table, given what it has met.

A learner is a small frozen dataclass, free of numpy so that help stays fast: its docstring states the update and its source, its
fields are the options, and `kernel` makes what the compiled loop reads. A subclass says what is true of it.
"""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import TYPE_CHECKING, Any, ClassVar

from qinit_cli.options import check

if TYPE_CHECKING:
    from qinit_cli.kernels.learner import Batch
    from qinit_cli.learning import Learning


@dataclass(frozen=True)
class Learner:
    """The neutral learner; subclasses replace what differs."""

    name: ClassVar[str]
    counts: ClassVar[bool] = True  # whether a step changes one value alone: its updates can be counted
    steps: ClassVar[bool] = True  # whether it has a step size
    weighs: ClassVar[bool] = (
        True  # whether (1 - alpha)^n of its start is left after n updates: the posterior can move it
    )
    shapes: ClassVar[bool] = True  # whether it learns from shaped rewards
    optimism: ClassVar[float] = (
        0.0  # value of unknown state-actions where nothing is transferred: the start of source tasks
    )
    explores: ClassVar[bool] = (
        True  # whether it needs an exploration; else it is greedy unless one is asked for
    )
    waits: ClassVar[bool] = False  # whether an update waits for the action after its step
    tables: ClassVar[int] = 1  # whose updates are counted apart
    learns: ClassVar[bool] = True

    def __post_init__(self) -> None:
        check(self)

    def kernel(self, learning: Learning, batch: Batch) -> Any:
        """What the compiled loop reads of it: a NamedTuple whose class has bodies for the parts of kernels.learner."""
        raise NotImplementedError

    def __str__(self) -> str:
        """As it is written on the command line: the name, and the options that are not the usual ones."""
        given = [
            f"{field.name.rstrip('_')}={getattr(self, field.name)}"
            for field in fields(self)
            if getattr(self, field.name) != field.default
        ]
        return ":".join([self.name, ",".join(given)] if given else [self.name])
