"""Learners whose step changes one value."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, ClassVar

from qinit_cli.learners.learner import Learner

if TYPE_CHECKING:
    from qinit_cli.kernels.learner import Batch
    from qinit_cli.learning import Learning


@dataclass(frozen=True)
class QLearner(Learner):
    """Q-learning: Q(s, a) += alpha (r + gamma max_b Q(s', b) - Q(s, a)).

    Watkins (1989); Sutton & Barto (2018), section 6.5.
    """

    name: ClassVar[str] = "q-learning"
    blends: ClassVar[bool] = True
    sums: ClassVar[bool] = True

    def kernel(self, learning: Learning, batch: Batch) -> Any:
        """No memory of its own."""
        from qinit_cli.kernels.learner import QLearn

        return QLearn()


@dataclass(frozen=True)
class Sarsa(Learner):
    """Sarsa: Q(s, a) += alpha (r + gamma Q(s', a') - Q(s, a)), a' the action taken in s'.

    a' is chosen before the update. Where the horizon cuts an episode off no action follows, and the exploration's expectation
    over Q(s', .) takes the place of Q(s', a'). Rummery & Niranjan (1994); Sutton & Barto (2018), section 6.4.
    """

    name: ClassVar[str] = "sarsa"
    blends: ClassVar[bool] = True
    sums: ClassVar[bool] = True
    waits: ClassVar[bool] = True

    def kernel(self, learning: Learning, batch: Batch) -> Any:
        """No memory of its own."""
        from qinit_cli.kernels.learner import OnPolicy

        return OnPolicy()


@dataclass(frozen=True)
class ExpectedSarsa(Learner):
    """Expected Sarsa: Q(s, a) += alpha (r + gamma sum_b pi(b | s') Q(s', b) - Q(s, a)), pi the exploration at the time.

    van Seijen et al. (2009); Sutton & Barto (2018), section 6.6.
    """

    name: ClassVar[str] = "expected-sarsa"
    blends: ClassVar[bool] = True
    sums: ClassVar[bool] = True

    def kernel(self, learning: Learning, batch: Batch) -> Any:
        """No memory of its own."""
        from qinit_cli.kernels.learner import InExpectation

        return InExpectation()


@dataclass(frozen=True)
class DoubleQ(Learner):
    """Double Q-learning: a coin picks the table that learns, A(s, a) += alpha (r + gamma B(s', argmax A(s', .)) - A(s, a)).

    A and B begin as the method's start; it acts on their mean, which is what is stored. The first of tied actions is the argmax.
    van Hasselt (2010), algorithm 1.
    """

    name: ClassVar[str] = "double-q"
    weighs: ClassVar[bool] = False  # each table has updates of its own
    tables: ClassVar[int] = 2

    def kernel(self, learning: Learning, batch: Batch) -> Any:
        """Both tables of each lane."""
        from qinit_cli.kernels.double_q import new_double

        return new_double(batch)


@dataclass(frozen=True)
class Still(Learner):
    """No learning: the start acts, and stays what it is."""

    name: ClassVar[str] = "none"
    steps: ClassVar[bool] = False
    weighs: ClassVar[bool] = False
    shapes: ClassVar[bool] = False
    learns: ClassVar[bool] = False

    def kernel(self, learning: Learning, batch: Batch) -> Any:
        """No memory of its own."""
        from qinit_cli.kernels.learner import Nothing

        return Nothing()
