"""The mellow learner's compiled update."""

from __future__ import annotations

from typing import Any, NamedTuple

from qinit_cli.plugin.kernels import body, is_state, learn_towards, update, value, worth


class Towards(NamedTuple):
    """What the loop reads of the learner."""

    share: float


@body(update, Towards)
def _update(learner: Any, memory: Any, step: Any, setting: Any, hooks: Any, recording: Any) -> Any:
    target = worth(memory, step.after)
    if is_state(memory, step.after):
        summed = 0.0
        for action in range(memory.actions):
            summed += value(memory, step.after, action)
        mean = setting.gamma * (summed / memory.actions)
        target = (1.0 - learner.share) * target + learner.share * mean
    return learn_towards(target, memory, step, setting, hooks, recording)
