"""A function on probe states, brought to the weights of tiles by least squares, and back."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from qinit_cli.tile_coding import TileCoding

if TYPE_CHECKING:
    from qinit_cli.arrays import Floats, Integers

# of the weights' norm, beside that of the errors: it decides what the probes leave open, and moves what they determine by
# 1e-12 of its value
RIDGE = 1e-6
TOLERANCE = 1e-12  # of the least-squares solution: 1e-9 in a weight
MOST_ITERATIONS = 5_000
MOST_RANKED = 4096  # weights whose rank is worked out: a second


@dataclass(frozen=True, eq=False)
class Projection:
    """Between values at probes (P, D) and weights of a tile coding (T)."""

    coding: TileCoding
    probes: Floats
    _found: dict[str, Floats] = field(default_factory=dict, repr=False)

    @cached_property
    def active(self) -> Integers:
        """The active tiles of each probe, (P, tilings)."""
        return self.coding.active(self.probes)

    @cached_property
    def features(self) -> Any:
        """A sparse matrix (P, T): 1 where a tile is active at a probe."""
        from scipy.sparse import csr_array

        count, tilings = self.active.shape
        ends = np.arange(0, count * tilings + 1, tilings)
        columns = np.sort(self.active, axis=1).ravel()
        return csr_array((np.ones(count * tilings), columns, ends), shape=(count, self.coding.weights))

    def values(self, weights: Floats) -> Floats:
        """The values (..., P, A) of weights (..., T, A), summed in the order of the tilings as the loop does."""
        summed: Floats = np.zeros((*weights.shape[:-2], len(self.active), weights.shape[-1]))
        for tiling in range(self.coding.tilings):
            summed += weights[..., self.active[:, tiling], :]
        return summed

    def weights(self, values: Floats) -> Floats:
        """The weights (..., T, A) whose values at the probes are nearest to `values` (..., P, A); of equals the shortest."""
        from scipy.sparse.linalg import lsmr

        key = hashlib.sha256(np.ascontiguousarray(values).tobytes()).hexdigest()
        if (kept := self._found.get(key)) is not None:  # the start of every batch of tasks
            return kept
        columns = np.moveaxis(values, -2, -1).reshape(-1, values.shape[-2])
        found = np.zeros((len(columns), self.coding.weights))
        for place, column in enumerate(columns):
            if column.any():
                found[place] = lsmr(
                    self.features,
                    column,
                    damp=RIDGE,
                    atol=TOLERANCE,
                    btol=TOLERANCE,
                    conlim=0,
                    maxiter=MOST_ITERATIONS,
                )[0]
        shaped = found.reshape(*values.shape[:-2], values.shape[-1], -1)
        weights: Floats = np.ascontiguousarray(np.moveaxis(shaped, -1, -2))
        self._found.clear()
        self._found[key] = weights
        return weights

    @cached_property
    def untouched(self) -> int:
        """Weights of an action whose tile is active at no probe."""
        return self.coding.weights - len(np.unique(self.active))

    @cached_property
    def rank(self) -> int | None:
        """Directions of the weights of an action that the probes determine; None where these are too many to tell."""
        if self.coding.weights > MOST_RANKED:
            return None
        gram = (self.features.T @ self.features).toarray()
        sizes = np.linalg.eigvalsh(gram)
        return int((sizes > len(sizes) * np.finfo(float).eps * sizes[-1]).sum())
