"""What a method starts the targets of a run from, which may be made late: a complete run needs only its outline."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Self

if TYPE_CHECKING:
    from qinit_cli.methods import Initial

    Started = tuple[Initial, Sequence[Mapping[str, str]]]


@dataclass(frozen=True)
class Beginning:
    """Arrays that are made once, when they are first asked for."""

    outline: Initial  # which of the arrays have a target axis, and how many hypotheses there are; of as few targets as it takes
    make: Callable[
        [], Started
    ]  # the arrays, and the artefact that they came from beside the fit, if there is one

    @classmethod
    def known(cls, initial: Initial) -> Self:
        """Arrays that are there already."""
        return cls(initial, lambda: (initial, ()))

    @property
    def initial(self) -> Initial:
        """The arrays; ValueError where they have other axes than their outline, by which the run's columns are laid out."""
        return self._made[0]

    @property
    def inputs(self) -> Sequence[Mapping[str, str]]:
        """What they came from beside the fit."""
        return self._made[1]

    @cached_property
    def _made(self) -> Started:
        initial, inputs = self.make()
        if _layout(initial) != _layout(self.outline):
            raise ValueError("the method's arrays have other axes for one target than for several")
        return initial, inputs


def _layout(initial: Initial) -> tuple[bool, bool, int]:
    return initial.start_per_task, initial.potential_per_task, initial.hypothesis_count
