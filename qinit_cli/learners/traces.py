"""Learners whose step changes what led to it, too: eligibility traces."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, ClassVar, Literal

from qinit_cli.learners.learner import Learner
from qinit_cli.options import option

if TYPE_CHECKING:
    from qinit_cli.kernels.learner import Batch
    from qinit_cli.learning import Learning


@dataclass(frozen=True)
class Tracing(Learner):
    """A learner with eligibility traces, which updates many state-actions at once."""

    counts: ClassVar[bool] = False
    sums: ClassVar[bool] = True
    weighs: ClassVar[bool] = False
    lambda_: float = option(0.9, "Share of a trace that lasts a step, beside gamma.", low=0, high=1)
    traces: Literal["replacing", "accumulating"] = option(
        "replacing", "A state-action that is met again has a trace of 1, or one more than it had."
    )
    least: float = option(0.01, "Trace below which a state-action is forgotten.", above=0, below=1)

    def kernel(self, learning: Learning, batch: Batch) -> Any:
        """The traces of each lane."""
        from qinit_cli.kernels.traces import new_traces

        decay = learning.gamma * self.lambda_
        return new_traces(batch, decay, self.traces == "accumulating", self.least, waits=self.waits)


@dataclass(frozen=True)
class QLambda(Tracing):
    """Watkins' Q(lambda): every Q(x, b) += alpha delta e(x, b), delta = r + gamma max_c Q(s', c) - Q(s, a).

    Traces e fall by gamma lambda a step, and are all cut where the action taken is not greedy. Watkins (1989); Sutton & Barto
    (2018), section 12.10. With lambda 0 it is Q-learning.
    """

    name: ClassVar[str] = "q-lambda"


@dataclass(frozen=True)
class SarsaLambda(Tracing):
    """Sarsa(lambda): every Q(x, b) += alpha delta e(x, b), delta = r + gamma Q(s', a') - Q(s, a), a' the action taken in s'.

    Traces e fall by gamma lambda a step. Where the horizon cuts an episode off, see Sarsa. Rummery & Niranjan (1994);
    Sutton & Barto (2018), section 12.7. With lambda 0 it is Sarsa.
    """

    name: ClassVar[str] = "sarsa-lambda"
    waits: ClassVar[bool] = True
