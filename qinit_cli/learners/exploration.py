"""Explorations: how a step's action follows from the values of its state, free of numpy so that help stays fast."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, ClassVar

from qinit_cli.options import check, option
from qinit_cli.spelling import write

if TYPE_CHECKING:
    from qinit_cli.kernels.learner import Batch
    from qinit_cli.learning import Learning


@dataclass(frozen=True)
class Exploration:
    """One exploration; a subclass has its options as fields."""

    name: ClassVar[str]

    def __post_init__(self) -> None:
        check(self)

    def kernel(self, learning: Learning, batch: Batch) -> Any:
        """What the compiled loop reads of it: a NamedTuple whose class has bodies for the parts of kernels.exploration."""
        raise NotImplementedError

    def __str__(self) -> str:
        """As it is written on the command line."""
        return write(self)


@dataclass(frozen=True)
class EpsilonGreedy(Exploration):
    """With probability epsilon any action, else a greedy one; ties at random."""

    name: ClassVar[str] = "epsilon-greedy"

    def kernel(self, learning: Learning, batch: Batch) -> Any:
        """Decided before the steps where epsilon is a number; else the limit of each episode."""
        from qinit_cli.kernels.exploration import new_epsilon_greedy

        return new_epsilon_greedy(learning)


@dataclass(frozen=True)
class Boltzmann(Exploration):
    """Action a with a probability that is proportional to exp(Q(s, a) / temperature)."""

    name: ClassVar[str] = "boltzmann"
    temperature: float = option(
        0.01, "Difference of values that makes one action e times as probable.", above=0
    )

    def kernel(self, learning: Learning, batch: Batch) -> Any:
        """The temperature."""
        from qinit_cli.kernels.exploration import new_softmax

        return new_softmax(batch, self.temperature)


@dataclass(frozen=True)
class Ucb(Exploration):
    """The action of the largest Q(s, a) + c sqrt(ln N(s) / n(s, a)), n the visits, N their sum; those not visited first.

    Ties at random. Auer et al. (2002), in each state.
    """

    name: ClassVar[str] = "ucb"
    c: float = option(0.1, "Weight of what is not known.", low=0)

    def kernel(self, learning: Learning, batch: Batch) -> Any:
        """The visits of each lane."""
        from qinit_cli.kernels.exploration import new_bounds

        return new_bounds(batch, self.c)


EXPLORATIONS: dict[str, type[Exploration]] = {each.name: each for each in (EpsilonGreedy, Boltzmann, Ucb)}
