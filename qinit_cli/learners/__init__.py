"""The registry of learners: one line each, and `--learner` takes it.

Those of installed plug-ins (entry points `qinit.learners`) are in it too.
"""

from __future__ import annotations

from typing import Any

from qinit_cli.learners.learner import Learner
from qinit_cli.learners.one_step import DoubleQ, ExpectedSarsa, QLearner, Sarsa, Still
from qinit_cli.learners.optimistic import DelayedQ, RMax
from qinit_cli.learners.traces import QLambda, SarsaLambda
from qinit_cli.registry import Registry

LEARNERS: Registry[Learner] = Registry(
    "qinit.learners",
    "learner",
    (QLearner, Sarsa, ExpectedSarsa, DoubleQ, QLambda, SarsaLambda, DelayedQ, RMax, Still),
    lambda found: _fault(found),
)

__all__ = ["LEARNERS", "Learner", "QLearner"]


def _fault(found: type[Any]) -> str:
    """What a class lacks to be a learner."""
    if not issubclass(found, Learner):
        return "its class is no Learner"
    return "" if found.kernel is not Learner.kernel else "it lacks a kernel"
