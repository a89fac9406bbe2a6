"""What a plug-in imports inside its functions: arrays, axes, and a compiled step of its own; imports numpy and Numba."""

from qinit_cli.kernels.compiled import compiled, inlined
from qinit_cli.kernels.loop import SteppedWorlds
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
    "Column",
    "Policies",
    "SteppedWorlds",
    "Tables",
    "below",
    "compiled",
    "inlined",
    "seeds",
    "starts",
    "steps",
    "unit",
]
