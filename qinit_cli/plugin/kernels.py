"""What a plug-in imports inside its functions: arrays, axes, and what compiles its steps and updates; imports numpy and Numba."""

from qinit_cli.kernels.compiled import compiled, inlined
from qinit_cli.kernels.learner import (
    Batch,
    aim,
    arrive,
    begin_task,
    chose,
    end_learning,
    is_state,
    learn_towards,
    put_value,
    target_of,
    update,
    value,
    worth,
)
from qinit_cli.kernels.loop import SteppedWorlds
from qinit_cli.kernels.parts import body
from qinit_cli.kernels.payment import with_reward
from qinit_cli.kernels.policies import Policies
from qinit_cli.kernels.random_streams import below, seeds, unit
from qinit_cli.kernels.tables import Tables
from qinit_cli.kernels.worlds import CUT, GOAL, LOST, starts, steps
from qinit_store.schema import Axis, Column

__all__ = [
    "CUT",
    "GOAL",
    "LOST",
    "Axis",
    "Batch",
    "Column",
    "Policies",
    "SteppedWorlds",
    "Tables",
    "aim",
    "arrive",
    "begin_task",
    "below",
    "body",
    "chose",
    "compiled",
    "end_learning",
    "inlined",
    "is_state",
    "learn_towards",
    "put_value",
    "seeds",
    "starts",
    "steps",
    "target_of",
    "unit",
    "update",
    "value",
    "with_reward",
    "worth",
]
