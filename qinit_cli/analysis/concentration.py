"""How far weights have gathered on few of what they weigh."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from qinit_cli.arrays import Floats


def effective_number(weights: Floats) -> Floats:
    """1 / sum w^2 along the last axis: how many equal weights would be as concentrated (Kish)."""
    shares = np.asarray(weights, np.float64)
    number: Floats = shares.sum(axis=-1) ** 2 / (shares**2).sum(axis=-1)
    return number


def largest_share(weights: Floats) -> Floats:
    """The share of the heaviest along the last axis."""
    shares = np.asarray(weights, np.float64)
    share: Floats = shares.max(axis=-1) / shares.sum(axis=-1)
    return share
