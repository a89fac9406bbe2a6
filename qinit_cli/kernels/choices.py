# mypy: allow-untyped-defs, allow-untyped-calls
"""What a step's draw decides, but for the greedy actions: worked out before the step, a block at a time.

A choice is ((slip * 12) + pick) * 16 + ties. Ties are a bit for each action, all of them when the step
explores; the greedy ones of the state are or-ed in. A pick of 0 to 11 decides among 1, 2, 3 or 4 tied actions
as exactly as the 12 bits it came from do, since floor(floor(12 x) / (12 / n)) = floor(n x).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from qinit_cli.kernels.compiled import inlined, inner
from qinit_cli.kernels.random_streams import LOW_12, LOW_20, THIRTY_TWO, TWELVE

PICKS = 12
TIES = 16
SLIPS = 4

_NONE, _ONE, _PICKS, _TIES = np.uint64(0), np.uint64(1), np.uint64(PICKS), np.uint64(TIES)


def _actions() -> NDArray[np.uint8]:
    table = np.zeros((SLIPS, PICKS, TIES), np.uint8)
    for pick in range(PICKS):
        for ties in range(1, TIES):
            tied = [action for action in range(4) if ties >> action & 1]
            table[:, pick, ties] = tied[pick * len(tied) // PICKS]
    return table


# by choice: the action taken, and from WAYS on the way that the agent goes: one address for both
ACTIONS = np.stack([_actions(), (_actions() + np.arange(SLIPS, dtype=np.uint8)[:, None, None]) % 4]).ravel()
WAYS = np.uint64(SLIPS * PICKS * TIES)


NO_SLIP = np.full(SLIPS - 1, 1 << 32, np.uint64)  # limits that no draw reaches


@inner
def decide(draws, exploration, all_actions, slips, choices):
    """Writes into `choices` u2 what the draws u8 decide.

    A step explores if its 20 bits are below `exploration`; it slips once for each of the three limits `slips`
    u8 (3,) that its upper 32 bits reach. `all_actions` has a bit for each action.
    """
    first, second, third = slips[0], slips[1], slips[2]
    for index in range(len(choices)):
        explored = all_actions if ((draws[index] >> TWELVE) & LOW_20) < exploration else _NONE
        choices[index] = greedy_choice(draws[index], first, second, third) | explored


@inlined
def greedy_choice(draw, first, second, third):
    """What a draw decides for a step that does not explore."""
    upper = draw >> THIRTY_TWO
    slip = (_ONE if upper >= first else _NONE) + (_ONE if upper >= second else _NONE)
    slip += _ONE if upper >= third else _NONE
    pick = ((draw & LOW_12) * _PICKS) >> TWELVE
    return (slip * _PICKS + pick) * _TIES
