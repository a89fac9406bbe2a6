"""Where the two puddles of Sutton (1996) are; free of numpy, for compiled steps and for families that draw goals beside them."""

from __future__ import annotations

import math

# the puddles' middles: from (0.1, 0.75) to (0.45, 0.75), and from (0.45, 0.4) to (0.45, 0.8)
LEFT, RIGHT, LEVEL = 0.1, 0.45, 0.75
ASIDE, BOTTOM, TOP = 0.45, 0.4, 0.8
WIDTH = 0.1  # from a puddle's middle to its edge, where its depth falls from this to 0


def puddle_depth(x: float, y: float) -> float:
    """How deep it is at a point of the unit square: the way from there to the puddles' edge, 0 beyond it."""
    off_level = x - min(max(x, LEFT), RIGHT), y - LEVEL
    off_aside = x - ASIDE, y - min(max(y, BOTTOM), TOP)
    nearest = min(
        off_level[0] * off_level[0] + off_level[1] * off_level[1],
        off_aside[0] * off_aside[0] + off_aside[1] * off_aside[1],
    )
    return max(0.0, WIDTH - math.sqrt(nearest))
